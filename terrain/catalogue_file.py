"""The format of a catalogue: TOML tables in which every number names its source."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

from .errors import ConfigurationError, InvalidInputError, unknown_name

#: Where a number comes from: printed there; computed from what is printed; chosen by us; made up, without a machine.
Kind = Literal["published", "derived", "assumed", "synthetic"]
KINDS: Final[tuple[Kind, ...]] = ("published", "derived", "assumed", "synthetic")

_REFERENCES: Final = "references"


@dataclass(frozen=True)
class SourcedNumber:
    """One number of a catalogue.

    Parameters
    ----------
    name : str
        Its key.
    value : float
        In ``unit``; an int where the catalogue holds one and the key counts something.
    unit : str
        Empty for a bare number.
    source : str
        The text of its reference.
    kind : {"published", "derived", "assumed", "synthetic"}
        The kind of its reference.
    """

    name: str
    value: float
    unit: str
    source: str
    kind: Kind


@dataclass(frozen=True)
class Sheet:
    """One entry of a catalogue.

    Parameters
    ----------
    name : str
        Name of its table.
    summary : str
        What it is, in a few words; may be empty.
    numbers : tuple of SourcedNumber
        In the order of the layout, whatever the order of the file.
    options : mapping of str to str
        What is no number, such as ``contact``; only what the file gives.
    """

    name: str
    summary: str
    numbers: tuple[SourcedNumber, ...]
    options: Mapping[str, str]

    @property
    def values(self) -> dict[str, float]:
        """The numbers by name, in the catalogue's units."""
        return {number.name: number.value for number in self.numbers}

    @property
    def sources(self) -> tuple[str, ...]:
        """Texts of the references, each once, in the order of the numbers."""
        return tuple(dict.fromkeys(number.source for number in self.numbers))


@dataclass(frozen=True)
class Layout:
    """Which keys an entry has.

    Parameters
    ----------
    what : str
        What it describes, for errors.
    units : mapping of str to str
        Unit of every number by key.
    optional : collection of str
        Numbers that may be missing.
    whole : collection of str
        Numbers that count something.
    options : collection of str
        Keys of bare text besides ``summary``.
    """

    what: str
    units: Mapping[str, str]
    optional: Collection[str] = ()
    whole: Collection[str] = ()
    options: Collection[str] = ()


#: Gives the layout of a table, and takes the table's place for errors.
LayoutOf = Callable[[Mapping[str, object], str], Layout]


def parse_catalogue(text: str, file: str, layout_of: LayoutOf) -> dict[str, Sheet]:
    """Read the entries of a catalogue.

    Parameters
    ----------
    text : str
        Its TOML.
    file : str
        What errors call it.
    layout_of : callable
        Gives the layout of a table.

    Raises
    ------
    InvalidInputError
        If it is not TOML, or a number, a source or a required key is missing or of another type.
    ConfigurationError
        If a key, a reference or the kind of a reference is unknown.
    """
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InvalidInputError(f"{file} is not TOML: {error}") from error
    listed = _table(tables.pop(_REFERENCES, {}), f"{file}, [{_REFERENCES}]")
    references = {key: _reference(value, f"{file}, [{_REFERENCES}.{key}]") for key, value in listed.items()}
    return {name: _sheet(name, value, references, f"{file}, [{name}]", layout_of) for name, value in tables.items()}


def check_keys(table: Mapping[str, object], known: Collection[str], where: str, what: str = "key") -> None:
    """Raise ConfigurationError, with the nearest one that exists, where a table has an unknown key."""
    for key in table:
        if key not in known:
            raise _unknown(where, what, key, known)


def _unknown(where: str, what: str, name: object, known: Collection[str]) -> ConfigurationError:
    return ConfigurationError(f"{where}: {unknown_name(what, name, known)}")


def _table(value: object, where: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise InvalidInputError(f"{where} must be a table, got {value!r}")
    return value


def _text(value: object, where: str) -> str:
    if not isinstance(value, str) or not value.strip():
        raise InvalidInputError(f"{where} must be text in quotes, got {value!r}")
    return value


def _reference(value: object, where: str) -> tuple[str, Kind]:
    table = _table(value, where)
    check_keys(table, ("text", "kind"), where)
    for key in ("text", "kind"):
        if key not in table:
            raise InvalidInputError(f"{where} lacks {key}: a reference has a text and a kind, {', '.join(KINDS)}")
    for kind in KINDS:
        if table["kind"] == kind:
            return _text(table["text"], f"{where}, text"), kind
    raise _unknown(where, "kind", table["kind"], KINDS)


def _sheet(
    name: str, value: object, references: Mapping[str, tuple[str, Kind]], where: str, layout_of: LayoutOf
) -> Sheet:
    table = _table(value, where)
    layout = layout_of(table, where)
    check_keys(table, ("summary", *layout.options, *layout.units), where, f"key of a {layout.what}")
    required = [key for key in layout.units if key not in layout.optional]
    missing = [key for key in required if key not in table]
    if missing:
        raise InvalidInputError(f"{where} lacks {', '.join(missing)}: a {layout.what} needs {', '.join(required)}")
    numbers = tuple(
        _number(key, table[key], references, f"{where}, {key}", layout) for key in layout.units if key in table
    )
    options = {key: _text(table[key], f"{where}, {key}") for key in layout.options if key in table}
    summary = _text(table["summary"], f"{where}, summary") if "summary" in table else ""
    return Sheet(name, summary, numbers, options)


def _number(
    name: str, given: object, references: Mapping[str, tuple[str, Kind]], where: str, layout: Layout
) -> SourcedNumber:
    if not isinstance(given, dict):
        raise InvalidInputError(f'{where} must be {{ value = NUMBER, source = "REFERENCE" }}, got {given!r}')
    check_keys(given, ("value", "source"), where)
    if "source" not in given:
        raise InvalidInputError(f"{where} has no source: name a key of [{_REFERENCES}]")
    source = _text(given["source"], f"{where}, source")
    if source not in references:
        raise _unknown(where, "reference", source, references)
    value = given.get("value")
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InvalidInputError(f"{where}, value must be a finite number, got {value!r}")
    text, kind = references[source]
    return SourcedNumber(name, value if name in layout.whole else float(value), layout.units[name], text, kind)
