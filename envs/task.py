"""What a task of a tracked vehicle is, apart from who steps it: draws, observation, reward, end of an episode."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Final, Generic, NamedTuple, TypeVar

import numpy as np

from ..native import Speed, Tracking
from ..terrain import (
    FloatArray,
    Ground,
    Mode,
    SlopedGround,
    TrackedVehicle,
    resolve_ground,
    resolve_vehicle,
)
from .footing import sample_ground
from .observation import Observation, compose_observation, observation_size
from .path import Path
from .rollout import whole_ratio
from .simulator import TickRecord
from .slip_power import slip_power, slip_power_block
from .state import VehicleState
from .surroundings import Randomizer, Surroundings, drawn_names
from .task_config import RandomizedTaskConfig, changed_config

#: Terms of the reward that every task has, after its own.
SHARED_TERMS: Final = ("action_change", "slip_power")

ConfigT = TypeVar("ConfigT", bound=RandomizedTaskConfig)
EpisodeT = TypeVar("EpisodeT")


class Start(NamedTuple, Generic[EpisodeT]):
    """How an episode begins.

    Parameters
    ----------
    state : VehicleState
        Of the vehicle, at time 0.
    ground : Ground
        Of the episode.
    vehicle : TrackedVehicle
        Of the episode.
    episode : object
        What the task remembers of it.
    """

    state: VehicleState
    ground: Ground
    vehicle: TrackedVehicle
    episode: EpisodeT


class Task(ABC, Generic[ConfigT, EpisodeT]):
    """A task: everything but the simulation.

    An episode is what the task remembers of a drive; the same task serves any number of them.

    Parameters
    ----------
    vehicle : str, path-like or TrackedVehicle
        The vehicle.
    terrain : str, path-like or Ground
        Ground of an episode unless its reset names another.
    config : RandomizedTaskConfig
        Settings.

    Raises
    ------
    InvalidInputError
        If periods do not divide.
    """

    #: Names of the task's own terms of the reward, and of what it tells of a vehicle in ``info``, in SI units.
    terms: ClassVar[tuple[str, str]]
    measures: ClassVar[tuple[str, str]]

    def __init__(
        self,
        vehicle: str | os.PathLike[str] | TrackedVehicle,
        terrain: str | os.PathLike[str] | Ground,
        config: ConfigT,
    ) -> None:
        self.config: ConfigT = config
        self.vehicle: Final = resolve_vehicle(vehicle)
        self.ground: Final = self.prepare_ground(terrain)
        self.mode: Final[Mode] = self.ground.mode
        self.drawn_names: Final = drawn_names(self.mode)
        self._randomizer = self._make_randomizer(config)
        self.ticks: Final = whole_ratio(config.control_period, config.tick, "control_period and tick")
        self.steps: Final = whole_ratio(config.time_limit, config.control_period, "time_limit and control_period")
        self.observation_size: Final = observation_size(self.mode, config)
        self.slip_block: Final = slip_power_block(self.vehicle, self.mode)

    @property
    @abstractmethod
    def reference_speed(self) -> float:
        """Speed in m/s that the slip power is measured by: W v_ref."""

    @property
    def slip_power_scale(self) -> float:
        """W v_ref in W."""
        return self.vehicle.weight * self.reference_speed

    @property
    @abstractmethod
    def memory_size(self) -> int:
        """Numbers that the compiled engine keeps of an episode."""

    @property
    @abstractmethod
    def broken_off_reward(self) -> float:
        """Reward of the step in which the simulation broke off."""

    @abstractmethod
    def start(self, generator: np.random.Generator, options: Mapping[str, Any]) -> Start[EpisodeT]:
        """Draw how an episode begins.

        The same draws are made whatever the options, so that an option changes nothing but what it names.

        Raises
        ------
        ConfigurationError
            If an option is unknown.
        InvalidInputError
            If an option's value is impossible.
        OffMapError
            If the vehicle would start off its map.
        """

    @abstractmethod
    def follow(self, episode: EpisodeT, state: VehicleState) -> None:
        """Move what the episode remembers after the vehicle."""

    @abstractmethod
    def assess(self, episode: EpisodeT, state: VehicleState) -> tuple[tuple[float, float], bool]:
        """Follow the vehicle, and return the task's own terms of the reward and whether it ends the episode."""

    @abstractmethod
    def show(self, episode: EpisodeT, state: VehicleState) -> FloatArray:
        """Return the task's own part of an observation, shape (12,)."""

    @abstractmethod
    def measure(self, episode: EpisodeT, state: VehicleState) -> tuple[float, float]:
        """Return what ``measures`` names."""

    @abstractmethod
    def rules(self) -> Tracking | Speed:
        """Return the task as the compiled engine takes it."""

    @abstractmethod
    def remember(self, episode: EpisodeT) -> FloatArray:
        """Return what an episode remembers as the compiled engine keeps it, shape (memory_size,)."""

    @property
    def shown_path(self) -> Path | None:
        """The path that frames show, where there is one."""
        return None

    def commanded(self, state: VehicleState, measures: Sequence[float]) -> tuple[float, float] | None:
        """Return the speed in m/s and yaw rate in rad/s that frames show as commanded, where they are."""
        return None

    def prepare_ground(self, terrain: str | os.PathLike[str] | Ground) -> Ground:
        """Return the ground on the configured slope."""
        ground = resolve_ground(terrain)
        if self.config.grade == 0 and self.config.bank == 0:
            return ground
        return SlopedGround(ground, self.config.grade, self.config.bank)

    def reconfigure(self, **settings: Any) -> None:
        """Change settings of starts, commands and randomization, from the next episode on.

        Raises
        ------
        ConfigurationError
            If a key is unknown, or its setting holds for the life of an environment; nothing has changed then.
        InvalidInputError
            If a value is impossible; nothing has changed then.
        """
        config = changed_config(self.config, settings)
        self._randomizer = self._make_randomizer(config)
        self.config = config

    def _make_randomizer(self, config: ConfigT) -> Randomizer:
        return Randomizer(config.randomize, self.ground, self.vehicle, self.prepare_ground)

    @property
    def grounds(self) -> tuple[Ground, ...]:
        """The task's ground, and those that its randomization names."""
        return (self.ground, *self._randomizer.grounds)

    def surroundings(self, generator: np.random.Generator, options: Mapping[str, Any]) -> Surroundings:
        """Draw ground and vehicle of an episode, after everything else that its start draws.

        Raises
        ------
        ConfigurationError
            If the reset option ``terrain`` is of another mode.
        """
        ground = self.prepare_ground(options["terrain"]) if "terrain" in options else None
        return self._randomizer.draw(generator, ground)

    def drawn(self, start: Start[EpisodeT]) -> tuple[float, ...] | None:
        """Return what ``drawn_names`` names of an episode, in SI units, where anything is randomized.

        θ is that under the vehicle at its start.
        """
        return self._randomizer.drawn(Surroundings(start.ground, start.vehicle), start.state.x, start.state.y)

    def begin(self, state: VehicleState, surroundings: Surroundings, episode: EpisodeT) -> Start[EpisodeT]:
        """Return the start of an episode, once its ground is seen to reach there."""
        ground, vehicle = surroundings
        sample_ground(ground, vehicle, self.config.ground_sampling, x=state.x, y=state.y, heading=state.heading)
        return Start(state, ground, vehicle, episode)

    def observe(
        self, episode: EpisodeT, state: VehicleState, action: FloatArray, theta: FloatArray | None
    ) -> Observation:
        """Return the observation of a state, given the previous action and, where it is observed, the terrain."""
        return compose_observation(
            state,
            self.show(episode, state),
            action,
            vehicle=self.vehicle,
            config=self.config,
            mode=self.mode,
            theta=theta,
        )

    def costs(self, action: FloatArray, previous: FloatArray, record: TickRecord) -> tuple[float, float]:
        """Return the terms of action change and slip power for the last tick of a control period."""
        change = action - previous
        return (
            -self.config.action_change_weight * float(change @ change),
            -self.config.slip_power_weight * slip_power(self.slip_block, record) / self.slip_power_scale,
        )
