"""What an episode draws beside its start: the ground that it is on, and the drive and inertia of its vehicle."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Final, NamedTuple

import numpy as np

from ..terrain import (
    RANGE_NAMES,
    ConfigurationError,
    FloatArray,
    Ground,
    InvalidInputError,
    Mode,
    RigidTerrain,
    SlopedGround,
    SoilTerrain,
    TerrainField,
    TrackedVehicle,
    interface,
    parameter_ranges,
    resolve_ground,
    terrain_from_mapping,
    terrain_type,
    unknown_name,
)
from ..terrain.parameters import RangeName

#: Lowest and highest factor on a number, drawn log-uniformly between them.
Factors = tuple[float, float]

#: Ranges by name, grounds of which one is drawn, or factors on parameters of the task's own ground.
TerrainChoice = RangeName | Sequence[str | os.PathLike[str] | Ground | Mapping[str, Any]] | Mapping[str, Factors]

#: What of the vehicle lies outside the force block, so that every backend holds whatever is drawn.
DRAWN_VEHICLE_NAMES: Final = ("belt_time_constant", "belt_acceleration", "yaw_inertia")

_LARGEST_FACTOR: Final = 1e3
_MOST_PARAMETERS: Final = 4
_DRAWN_NUMBERS: Final = _MOST_PARAMETERS + len(DRAWN_VEHICLE_NAMES)


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


class Surroundings(NamedTuple):
    """Ground and vehicle of an episode."""

    ground: Ground
    vehicle: TrackedVehicle


class Randomizer:
    """Draws the surroundings of episodes.

    Each draw takes seven numbers from the generator, whatever is randomized: four for the terrain, one for each of
    ``DRAWN_VEHICLE_NAMES``. So another thing to be randomized changes no other draw.

    Parameters
    ----------
    randomization : Randomization
        What to draw.
    ground : Ground
        Of the task, on its slope.
    vehicle : TrackedVehicle
        Of the task.
    prepare : callable
        Returns a ground as the task takes it, once it is seen to fit.

    Raises
    ------
    ConfigurationError
        If a ground is unknown or of another mode, or factors do not apply to the task's ground.
    InvalidInputError
        If a ground does not fit the task, or factors make an impossible one.
    """

    def __init__(
        self,
        randomization: Randomization,
        ground: Ground,
        vehicle: TrackedVehicle,
        prepare: Callable[[Ground], Ground],
    ) -> None:
        self._vehicle: Final = vehicle
        self._factors: Final = [
            (index, name, *pair)
            for index, name in enumerate(DRAWN_VEHICLE_NAMES)
            if (pair := getattr(randomization, name)) is not None
        ]
        terrain = randomization.terrain
        self._own: Final = ground
        self._prepare: Final = prepare
        self._ranges: Final = parameter_ranges(terrain, ground.mode) if isinstance(terrain, str) else None
        self._scales: Final = _scales(terrain, ground.mode) if isinstance(terrain, dict) else None
        named = terrain if isinstance(terrain, tuple) else ()
        #: Those that one is drawn from, where grounds are named.
        self.grounds: Final = tuple(prepare(_resolved(each, ground.mode)) for each in named)
        for end in (0.0, 1.0):
            self._at(np.full(_DRAWN_NUMBERS, end))

    def draw(self, generator: np.random.Generator) -> Surroundings:
        """Draw ground and vehicle of an episode."""
        return self._at(generator.random(_DRAWN_NUMBERS))

    def _at(self, draw: FloatArray) -> Surroundings:
        ground = self._ground_at(draw[:_MOST_PARAMETERS])
        if not self._factors:
            return Surroundings(ground, self._vehicle)
        shares = draw[_MOST_PARAMETERS:].tolist()
        drawn = {
            name: getattr(self._vehicle, name) * _log_uniform(low, high, shares[index])
            for index, name, low, high in self._factors
        }
        return Surroundings(ground, replace(self._vehicle, **drawn))

    def _ground_at(self, draw: FloatArray) -> Ground:
        if self.grounds:
            return self.grounds[min(int(draw[0] * len(self.grounds)), len(self.grounds) - 1)]
        if self._ranges is not None:
            theta = self._ranges.at(draw[: len(self._ranges.low)]).tolist()
            return self._prepare(terrain_type(self._ranges.mode)(*theta))
        if self._scales is not None:
            shares = draw[: len(self._scales)].tolist()
            factors = [_log_uniform(*pair, share) for pair, share in zip(self._scales, shares, strict=True)]
            return _scaled(self._own, np.array(factors))
        return self._own


def _resolved(ground: Any, mode: Mode) -> Ground:
    if isinstance(ground, Mapping):
        ground = terrain_from_mapping(ground)
    resolved = resolve_ground(ground)
    if resolved.mode != mode:
        raise ConfigurationError(f"the task is on {mode} ground, and one to be drawn is {resolved.mode}: {ground!r}")
    return resolved


def _scales(factors: Mapping[str, Factors], mode: Mode) -> list[Factors]:
    """Return the factors of every parameter, in interface order."""
    names = interface(mode).parameter_names
    for name in factors:
        if name not in names:
            raise unknown_name(f"{mode} terrain parameter", name, names)
    return [factors.get(name, (1.0, 1.0)) for name in names]


def _scaled(ground: Ground, factors: FloatArray) -> Ground:
    if isinstance(ground, SlopedGround):
        return replace(ground, ground=_scaled(ground.ground, factors))
    if isinstance(ground, RigidTerrain | SoilTerrain):
        return type(ground)(*(ground.parameters * factors).tolist())
    if isinstance(ground, TerrainField):
        return replace(ground, parameters=ground.parameters * factors)
    raise ConfigurationError(
        f"factors apply to a terrain, a TerrainField or a SlopedGround over one, not to a {type(ground).__name__}"
    )


def _log_uniform(low: float, high: float, share: float) -> float:
    return low * math.exp(share * math.log(high / low))
