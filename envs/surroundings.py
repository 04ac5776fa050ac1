"""Ground and vehicle of an episode: the task's own, or drawn."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np

from ..terrain import (
    ConfigurationError,
    FloatArray,
    Ground,
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
from .randomization import DRAWN_VEHICLE_NAMES, Factors, Randomization

_MOST_PARAMETERS: Final = 4
_DRAWN_NUMBERS: Final = _MOST_PARAMETERS + len(DRAWN_VEHICLE_NAMES)


def drawn_names(mode: Mode) -> tuple[str, ...]:
    """Return what ``info`` calls the numbers that an episode draws, each in SI units."""
    return (*interface(mode).parameter_names, *DRAWN_VEHICLE_NAMES)


class Surroundings(NamedTuple):
    """Ground and vehicle of an episode."""

    ground: Ground
    vehicle: TrackedVehicle


class Randomizer:
    """Draws the surroundings of episodes, where anything is randomized.

    Each draw then takes seven numbers from the generator, whatever is randomized: four for the terrain, one for each of
    ``DRAWN_VEHICLE_NAMES``. So another thing to be randomized changes no other draw.

    Parameters
    ----------
    randomization : Randomization or None
        What to draw.
    ground : Ground
        Of the task.
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
        randomization: Randomization | None,
        ground: Ground,
        vehicle: TrackedVehicle,
        prepare: Callable[[Ground], Ground],
    ) -> None:
        self._randomized: Final = randomization is not None
        randomization = randomization or Randomization()
        self._own: Final = Surroundings(ground, vehicle)
        self._factors: Final = [
            (index, name, *pair)
            for index, name in enumerate(DRAWN_VEHICLE_NAMES)
            if (pair := getattr(randomization, name)) is not None
        ]
        terrain = randomization.terrain
        self._prepare: Final = prepare
        self._ranges: Final = parameter_ranges(terrain, ground.mode) if isinstance(terrain, str) else None
        self._scales: Final = _scales(terrain, ground.mode) if isinstance(terrain, dict) else None
        named = terrain if isinstance(terrain, tuple) else ()
        #: Those that one is drawn from, where grounds are named.
        self.grounds: Final = tuple(prepare(_resolved(each, ground.mode)) for each in named)
        for end in (0.0, 1.0):
            self._at(np.full(_DRAWN_NUMBERS, end))

    def draw(self, generator: np.random.Generator, ground: Ground | None = None) -> Surroundings:
        """Draw ground and vehicle of an episode.

        Parameters
        ----------
        generator : numpy.random.Generator
            What they are drawn from.
        ground : Ground, optional
            Takes the place of the drawn one, as the task takes it; the same draws are made.

        Raises
        ------
        ConfigurationError
            If the ground is of another mode.
        """
        drawn = self._at(generator.random(_DRAWN_NUMBERS)) if self._randomized else self._own
        if ground is None:
            return drawn
        mode = self._own.ground.mode
        if ground.mode != mode:
            raise ConfigurationError(f"the task is on {mode} ground, got {ground.mode}")
        return drawn._replace(ground=ground)

    def drawn(self, surroundings: Surroundings, x: float, y: float) -> tuple[float, ...] | None:
        """Return what :func:`drawn_names` names of an episode, θ at (x, y), where anything is randomized."""
        if not self._randomized:
            return None
        ground, vehicle = surroundings
        theta = ground.parameters_at(x, y).tolist()
        return (*theta, *(getattr(vehicle, name) for name in DRAWN_VEHICLE_NAMES))

    def _at(self, draw: FloatArray) -> Surroundings:
        ground = self._ground_at(draw[:_MOST_PARAMETERS])
        if not self._factors:
            return self._own._replace(ground=ground)
        shares = draw[_MOST_PARAMETERS:].tolist()
        drawn = {
            name: getattr(self._own.vehicle, name) * _log_uniform(low, high, shares[index])
            for index, name, low, high in self._factors
        }
        return Surroundings(ground, replace(self._own.vehicle, **drawn))

    def _ground_at(self, draw: FloatArray) -> Ground:
        if self.grounds:
            return self.grounds[min(int(draw[0] * len(self.grounds)), len(self.grounds) - 1)]
        if self._ranges is not None:
            theta = self._ranges.at(draw[: len(self._ranges.low)]).tolist()
            return self._prepare(terrain_type(self._ranges.mode)(*theta))
        if self._scales is not None:
            shares = draw[: len(self._scales)].tolist()
            factors = [_log_uniform(*pair, share) for pair, share in zip(self._scales, shares, strict=True)]
            return _scaled(self._own.ground, np.array(factors))
        return self._own.ground


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
