"""What an episode draws beside its start: the ground that it is on, and the drive and inertia of its vehicle."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Final

from ..terrain import RANGE_NAMES, Ground, InvalidInputError, unknown_name
from ..terrain.parameters import RangeName

#: Lowest and highest factor on a number, drawn log-uniformly between them.
Factors = tuple[float, float]

#: Ranges by name, grounds of which one is drawn, or factors on parameters of the task's own ground.
TerrainChoice = RangeName | Sequence[str | os.PathLike[str] | Ground | Mapping[str, Any]] | Mapping[str, Factors]

#: What of the vehicle lies outside the force block, so that every backend holds whatever is drawn.
DRAWN_VEHICLE_NAMES: Final = ("belt_time_constant", "belt_acceleration", "yaw_inertia")

_LARGEST_FACTOR: Final = 1e3


@dataclass(frozen=True)
class Randomization:
    """What differs from episode to episode, beside the start.

    Parameters
    ----------
    terrain : {"wide", "paper"}, sequence of grounds, or mapping, optional
        The training ranges that θ is drawn from, by the law of :meth:`~grouser.terrain.ParameterRanges.sample`; grounds
        of which one is drawn, each a name, a file, a ground or a mapping of terrain parameters; or factors on
        parameters of the task's own ground by name, such as ``{"mu": (0.5, 1.2)}``.
    belt_time_constant, belt_acceleration, yaw_inertia : pair of float, optional
        Lowest and highest factor on the vehicle's own.

    Raises
    ------
    ConfigurationError
        If the ranges' name is unknown.
    InvalidInputError
        If a pair of factors is impossible, or the terrain is something else.

    Examples
    --------
    >>> Randomization(terrain="wide", yaw_inertia=(0.8, 1.25)).yaw_inertia
    (0.8, 1.25)
    """

    terrain: TerrainChoice | None = None
    belt_time_constant: Factors | None = None
    belt_acceleration: Factors | None = None
    yaw_inertia: Factors | None = None

    def __post_init__(self) -> None:
        for name in DRAWN_VEHICLE_NAMES:
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _factors(name, getattr(self, name)))
        object.__setattr__(self, "terrain", _checked_terrain(self.terrain))

    @classmethod
    def of(cls, settings: Randomization | Mapping[str, Any] | None) -> Randomization | None:
        """Return a randomization given as one, as a mapping of its fields, or not at all.

        Raises
        ------
        ConfigurationError
            If a key is unknown, with the nearest one that exists.
        InvalidInputError
            If it is something else, or a value is impossible.
        """
        if settings is None or isinstance(settings, cls):
            return settings
        if not isinstance(settings, Mapping):
            raise InvalidInputError(f"randomize takes a Randomization or a mapping of its fields, got {settings!r}")
        known = {field.name for field in fields(cls)}
        for key in settings:
            if key not in known:
                raise unknown_name("randomization", key, known)
        return cls(**settings)


def _checked_terrain(terrain: Any) -> TerrainChoice | None:
    """Return a terrain to draw, its containers copied."""
    if isinstance(terrain, str):
        if terrain not in RANGE_NAMES:
            raise unknown_name("parameter range to draw the terrain from", terrain, RANGE_NAMES)
        return terrain
    if isinstance(terrain, Mapping):
        return {str(name): _factors(f"terrain {name}", pair) for name, pair in terrain.items()}
    if isinstance(terrain, Sequence):
        if not terrain:
            raise InvalidInputError("randomization needs at least one ground to draw, got none")
        return tuple(terrain)
    if terrain is not None:
        raise InvalidInputError(
            f"the terrain to draw is {' or '.join(map(repr, RANGE_NAMES))}, a sequence of grounds, or factors by "
            f"parameter, got {terrain!r}"
        )
    return None


def _factors(name: str, pair: Any) -> Factors:
    try:
        low, high = map(float, pair)
    except (TypeError, ValueError):
        low, high = math.nan, math.nan
    if not 0.0 < low <= high <= _LARGEST_FACTOR:
        raise InvalidInputError(
            f"factors of {name} are a pair 0 < low <= high of at most {_LARGEST_FACTOR:g}, got {pair!r}"
        )
    return low, high
