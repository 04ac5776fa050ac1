"""The sheets of vehicles and grounds, by name from ``data/`` or from a file of the user's."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Final

from .catalogue_file import Layout, LayoutOf, Sheet, SourcedNumber, check_keys, parse_catalogue
from .errors import ConfigurationError, InvalidInputError, unknown_name

__all__ = [
    "UNITS",
    "Sheet",
    "SourcedNumber",
    "read_terrains",
    "read_vehicles",
    "shipped_terrains",
    "shipped_vehicles",
    "terrain_sheet",
    "vehicle_sheet",
]

#: Unit of every number that a catalogue holds: of vehicles as :class:`TrackedVehicle` has them, of grounds as the
#: tables print them.
UNITS: Final[Mapping[str, str]] = {
    "mass": "kg",
    "yaw_inertia": "kg m²",
    "contact_length": "m",
    "tread": "m",
    "track_width": "m",
    "cg_height": "m",
    "road_wheels": "",
    "sprocket_radius": "m",
    "maximum_speed": "m/s",
    "training_speed": "m/s",
    "soft_speed": "m/s",
    "cg_offset": "m",
    "belt_time_constant": "s",
    "belt_acceleration": "m/s²",
    "patch_length": "m",
    "hull_length": "m",
    "hull_width": "m",
    "mu": "",
    "c_kpa": "kPa",
    "phi_deg": "°",
    "fr": "",
    "k": "m",
}


def _units(*names: str) -> dict[str, str]:
    return {name: UNITS[name] for name in names}


_GROUNDS: Final = {
    "rigid": Layout("rigid ground", _units("mu", "fr", "k"), options=("mode",)),
    "soil": Layout("soil", _units("c_kpa", "phi_deg", "fr", "k"), options=("mode",)),
}
_GROUND_KEYS: Final = tuple(dict.fromkeys(key for layout in _GROUNDS.values() for key in layout.units))
_VEHICLE: Final = Layout(
    "vehicle",
    _units(*(name for name in UNITS if name not in _GROUND_KEYS)),
    optional=("patch_length", "hull_length", "hull_width"),
    whole=("road_wheels",),
    options=("contact",),
)
_SUFFIX: Final = ".toml"


def _vehicle_layout(table: Mapping[str, object], where: str) -> Layout:
    return _VEHICLE


def _terrain_layout(table: Mapping[str, object], where: str) -> Layout:
    """Return the layout of the mode that the keys stand for."""
    mode = table.get("mode")
    if mode is not None and (not isinstance(mode, str) or mode not in _GROUNDS):
        raise ConfigurationError(f"{where}: {unknown_name('mode', mode, _GROUNDS)}")
    keys = "rigid" if "mu" in table else "soil" if "c_kpa" in table or "phi_deg" in table else mode
    if keys is None:
        check_keys(table, ("summary", "mode", *_GROUND_KEYS), where)
        raise InvalidInputError(f"{where} needs mu, of rigid ground, or c_kpa and phi_deg, of soil")
    if mode not in (None, keys):
        raise InvalidInputError(f"{where}: mode is {mode!r}, but the keys are those of {keys!r} ground")
    return _GROUNDS[keys]


@cache
def shipped_vehicles() -> Mapping[str, Sheet]:
    """Return the sheets of ``data/vehicles.toml`` by name."""
    return _shipped("vehicles.toml", _vehicle_layout)


@cache
def shipped_terrains() -> Mapping[str, Sheet]:
    """Return the sheets of ``data/terrains.toml`` by name."""
    return _shipped("terrains.toml", _terrain_layout)


def read_vehicles(file: str | os.PathLike[str]) -> dict[str, Sheet]:
    """Read every vehicle of a catalogue file.

    Raises
    ------
    InvalidInputError, ConfigurationError
        If it cannot be read or is not such a catalogue; the message names file, table and key.
    """
    return _read(file, _vehicle_layout)


def read_terrains(file: str | os.PathLike[str]) -> dict[str, Sheet]:
    """Read every ground of a catalogue file.

    Raises
    ------
    InvalidInputError, ConfigurationError
        If it cannot be read or is not such a catalogue; the message names file, table and key.
    """
    return _read(file, _terrain_layout)


def vehicle_sheet(name_or_file: str | os.PathLike[str]) -> Sheet:
    """Return the sheet of a vehicle.

    Parameters
    ----------
    name_or_file : str or path-like
        Preset name; or a catalogue file, a string that ends in ``.toml`` or any path-like object, with
        ``#name`` behind it where the file holds several vehicles.

    Raises
    ------
    ConfigurationError
        If the name is unknown, or the file holds several and none was named.
    InvalidInputError
        If the file is not a catalogue of vehicles.

    Examples
    --------
    >>> vehicle_sheet("m113").values["mass"]
    11300.0
    """
    return _find("vehicle", name_or_file, shipped_vehicles(), _vehicle_layout)


def terrain_sheet(name_or_file: str | os.PathLike[str]) -> Sheet:
    """Return the sheet of a ground, named as :func:`vehicle_sheet` takes it.

    Raises
    ------
    ConfigurationError
        If the name is unknown, or the file holds several and none was named.
    InvalidInputError
        If the file is not a catalogue of grounds.

    Examples
    --------
    >>> terrain_sheet("lete-sand").values["phi_deg"]
    31.1
    """
    return _find("terrain", name_or_file, shipped_terrains(), _terrain_layout)


def _shipped(file: str, layout_of: LayoutOf) -> dict[str, Sheet]:
    text = files(__package__).joinpath("data", file).read_text(encoding="utf-8")
    return parse_catalogue(text, file, layout_of)


def _read(file: str | os.PathLike[str], layout_of: LayoutOf) -> dict[str, Sheet]:
    try:
        text = Path(file).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InvalidInputError(f"cannot read {os.fspath(file)}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise InvalidInputError(f"{os.fspath(file)} is not TOML: {error}") from error
    return parse_catalogue(text, os.fspath(file), layout_of)


def _find(what: str, name_or_file: str | os.PathLike[str], shipped: Mapping[str, Sheet], layout_of: LayoutOf) -> Sheet:
    file, entry = _split(name_or_file)
    if file is None:
        if not isinstance(name_or_file, str) or name_or_file not in shipped:
            raise unknown_name(what, name_or_file, shipped)
        return shipped[name_or_file]
    sheets = _read(file, layout_of)
    if not sheets:
        raise InvalidInputError(f"{file} holds no {what}: give it a table, such as [mine]")
    if entry is None:
        if len(sheets) > 1:
            raise ConfigurationError(
                f"{file} holds several {what}s, {', '.join(sheets)}: ask for one, such as {file}#{next(iter(sheets))}"
            )
        return next(iter(sheets.values()))
    if entry not in sheets:
        raise unknown_name(f"{what} of {file}", entry, sheets)
    return sheets[entry]


def _split(name_or_file: object) -> tuple[str | None, str | None]:
    """Return the file and the entry of ``file.toml#entry``, each None where there is none."""
    if not isinstance(name_or_file, str | os.PathLike):
        return None, None
    text = str(os.fspath(name_or_file))
    if text.lower().endswith(_SUFFIX):
        return text, None
    end = text.lower().rfind(f"{_SUFFIX}#") + len(_SUFFIX)
    if end >= len(_SUFFIX):
        return text[:end], text[end + 1 :]
    return (text, None) if isinstance(name_or_file, os.PathLike) else (None, None)
