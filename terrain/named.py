"""Grounds by name or from a catalogue file."""

from __future__ import annotations

import math
import os

from .catalogue import shipped_terrains, terrain_sheet
from .errors import GrouserError
from .parameters import RigidTerrain, SoilTerrain, Terrain


def terrain_names() -> tuple[str, ...]:
    """Names that :func:`named` knows, sorted."""
    return tuple(sorted(shipped_terrains()))


def named(name: str | os.PathLike[str]) -> Terrain:
    """Return a published ground, or one of a catalogue file of your own.

    Parameters
    ----------
    name : str or path-like
        Such as ``"asphalt"`` or ``"lete-sand"``, see :func:`terrain_names`; or a file, a string that ends in ``.toml``
        or any path-like object, with ``#name`` behind it where the file holds several grounds.

    Raises
    ------
    ConfigurationError
        If the name is unknown, or the file holds several grounds and none was named.
    InvalidInputError
        If the file holds no such ground, or an impossible one.

    Examples
    --------
    >>> named("asphalt").mu
    0.8
    """
    values = terrain_sheet(name).values
    try:
        if "mu" in values:
            return RigidTerrain(**values)
        return SoilTerrain(
            c=1000 * values["c_kpa"], phi=math.radians(values["phi_deg"]), fr=values["fr"], k=values["k"]
        )
    except GrouserError as error:
        raise type(error)(f"{os.fspath(name)}: {error}") from error


def resolve_terrain(terrain: str | os.PathLike[str] | Terrain) -> Terrain:
    """Return a terrain given by name, by catalogue file or as itself.

    Raises
    ------
    ConfigurationError
        If it is none of them.
    InvalidInputError
        If the file holds no such ground, or an impossible one.
    """
    return terrain if isinstance(terrain, RigidTerrain | SoilTerrain) else named(terrain)
