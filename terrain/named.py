"""Grounds by name, read from ``data/terrains.toml``."""

from __future__ import annotations

import math
import tomllib
from functools import cache
from importlib.resources import files

from .errors import unknown_name
from .parameters import RigidTerrain, SoilTerrain, Terrain


@cache
def _catalogue() -> dict[str, Terrain]:
    tables = tomllib.loads(files(__package__).joinpath("data", "terrains.toml").read_text(encoding="utf-8"))
    rigid: dict[str, Terrain] = {name: RigidTerrain(**values) for name, values in tables["rigid"].items()}
    soil: dict[str, Terrain] = {
        name: SoilTerrain(c=1000 * values["c_kpa"], phi=math.radians(values["phi_deg"]), fr=values["fr"], k=values["k"])
        for name, values in tables["soil"].items()
    }
    return rigid | soil


def terrain_names() -> tuple[str, ...]:
    """Names that :func:`named` knows, sorted."""
    return tuple(sorted(_catalogue()))


def named(name: str) -> Terrain:
    """Return a published ground.

    Parameters
    ----------
    name : str
        Such as ``"asphalt"`` or ``"lete-sand"``; see :func:`terrain_names`.

    Raises
    ------
    ConfigurationError
        If the name is unknown.

    Examples
    --------
    >>> named("asphalt").mu
    0.8
    """
    catalogue = _catalogue()
    if name not in catalogue:
        raise unknown_name("terrain", name, catalogue)
    return catalogue[name]


def resolve_terrain(terrain: str | Terrain) -> Terrain:
    """Return a terrain given by name or as itself.

    Raises
    ------
    ConfigurationError
        If it is neither.
    """
    return terrain if isinstance(terrain, RigidTerrain | SoilTerrain) else named(terrain)
