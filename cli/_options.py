"""Options that several verbs share, so that they read alike everywhere."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from ..envs import path_names
from ..terrain import InvalidInputError, backend_names, terrain_names, vehicle_names


def starting_with(names: Callable[[], tuple[str, ...]]) -> Callable[[str], list[str]]:
    """Return what completes an option to one of the names."""

    def complete(incomplete: str) -> list[str]:
        return [name for name in names() if name.startswith(incomplete)]

    return complete


def _one_of(names: tuple[str, ...]) -> str:
    return ", ".join(names)


Vehicle = Annotated[
    str,
    typer.Option(
        metavar="NAME|FILE.toml",
        help=f"Vehicle: {_one_of(vehicle_names())}, or a TOML file of your own.",
        autocompletion=starting_with(vehicle_names),
    ),
]
Terrain = Annotated[
    str,
    typer.Option(
        metavar="NAME|FILE",
        help=f"Ground: {_one_of(terrain_names())}, a TOML file of your own, or a terrain field as .npz.",
        autocompletion=starting_with(terrain_names),
    ),
]
PathOrFile = Annotated[
    str,
    typer.Option(
        "--path",
        metavar="NAME|FILE.csv",
        help=f"Path: {_one_of(path_names())}, or a CSV file of x, y in m.",
        autocompletion=starting_with(path_names),
    ),
]
Backend = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        help=f"Who gives the force: {_one_of(backend_names())}.",
        autocompletion=starting_with(backend_names),
    ),
]
Speed = Annotated[float, typer.Option(metavar="M/S", help="Reference speed, and speed at the start, in m/s.")]
Artifact = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE", help="Surrogate of the vehicle and the ground's mode.", show_default="the one that is shipped"
    ),
]
Seed = Annotated[int, typer.Option(min=0, help="Of every random draw; the same seed gives the same result.")]
Workers = Annotated[int, typer.Option(min=1, help="Processes. The results do not depend on their number.")]


def label_of(name_or_file: str) -> str:
    """Return what rows and files are called after: a name itself, of a file its entry or its stem."""
    file, _, entry = name_or_file.partition("#")
    return entry or Path(file).stem


def names_of(text: str, what: str) -> list[str]:
    """Split ``a,b``.

    Raises
    ------
    InvalidInputError
        If there is no name, or one comes twice.
    """
    names = [name.strip() for name in text.split(",") if name.strip()]
    if not names or len(set(names)) < len(names):
        raise InvalidInputError(f"{what} must be different names with commas between, got {text!r}")
    return names


def whole_numbers(text: str, what: str) -> tuple[int, ...]:
    """Read ``128,128``.

    Raises
    ------
    InvalidInputError
        If it is anything else.
    """
    try:
        return tuple(int(part) for part in text.split(","))
    except ValueError as error:
        raise InvalidInputError(f"{what} must be whole numbers such as 128,128, got {text!r}") from error


def numbers(text: str, what: str) -> tuple[float, ...]:
    """Read ``1,1,3``.

    Raises
    ------
    InvalidInputError
        If it is anything else.
    """
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError as error:
        raise InvalidInputError(f"{what} must be numbers such as 1,1,3, got {text!r}") from error
