"""Episodes of one task, any number at once, in the compiled engine."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, Generic

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.utils import seeding
from numpy.typing import ArrayLike, NDArray

from ..native import Episodes
from ..terrain import FloatArray, ForceBackend, GuardedBackend, InvalidInputError, parameter_ranges
from .engine import compiled_kernel
from .fleet import VehicleFleet
from .footing import sample_ground
from .log import STATE_NAMES
from .observation import OBSERVATION_BOUND
from .reward import VIEWED_STATES, RewardFunction, StepView, columns, evaluate_reward
from .simulator import TickRecord
from .task import SHARED_TERMS, ConfigT, EpisodeT, Start, Task

_Flags = NDArray[np.bool_]

# As native/include/grouser/ground.h has it.
_MOST_PARAMETERS: Final = 4


class Batch(Generic[ConfigT, EpisodeT]):
    """Vehicles at one task, each in an episode of its own.

    What one vehicle sees and earns is the same to the bit whatever stands beside it, and on however many threads. The
    arrays are the engine's own: they change with every step, so that who hands them on hands on copies.

    Parameters
    ----------
    task : Task
        What is asked of every vehicle.
    backend : ForceBackend
        A compiled one.
    count : int
        Number of vehicles.
    threads : int
        That share them.
    reward : callable, optional
        Takes the place of the task's own; see :class:`StepView`.

    Attributes
    ----------
    idle : ndarray of bool, shape (n,)
        To be set: whether a vehicle sits out the next step.
    observations : ndarray of float32, shape (n, k)
    rewards : ndarray, shape (n,)
    terms : ndarray, shape (n, 4)
        Of the reward, as ``term_names`` has them.
    measures : ndarray, shape (n, 2)
        What the task tells of a vehicle, in SI units.
    drawn : ndarray, shape (n, k)
        Of the episode, as the task's ``drawn_names`` have it, where ``randomized`` holds.
    randomized : ndarray of bool, shape (n,)
    terminated, truncated : ndarray of bool, shape (n,)
    backend_names : ndarray of object, shape (n,)
        Who moves each vehicle: of a guarded backend, while its guard has not changed over.

    Raises
    ------
    ConfigurationError
        If the backend or the ground is not compiled.
    InvalidInputError
        If there is no vehicle or no thread.
    """

    def __init__(
        self,
        task: Task[ConfigT, EpisodeT],
        backend: ForceBackend,
        count: int,
        *,
        threads: int = 1,
        reward: RewardFunction | None = None,
    ) -> None:
        config = task.config
        self.task: Final = task
        self.term_names: Final = (*task.terms, *SHARED_TERMS)
        self.fleet: Final = VehicleFleet(
            task.vehicle,
            backend,
            task.ground,
            count,
            tick=config.tick,
            integrator=config.integrator,
            ground_sampling=config.ground_sampling,
            threads=threads,
        )
        self.idle: Final[_Flags] = np.zeros(count, np.bool_)
        self.observations: Final[NDArray[np.float32]] = np.zeros((count, task.observation_size), np.float32)
        self.rewards: Final[FloatArray] = np.zeros(count)
        self.terms: Final[FloatArray] = np.zeros((count, len(self.term_names)))
        self.measures: Final[FloatArray] = np.zeros((count, len(task.measures)))
        self.drawn: Final[FloatArray] = np.zeros((count, len(task.drawn_names)))
        self.randomized: Final[_Flags] = np.zeros(count, np.bool_)
        self.terminated: Final[_Flags] = np.zeros(count, np.bool_)
        self.truncated: Final[_Flags] = np.zeros(count, np.bool_)
        driving = backend.primary if isinstance(backend, GuardedBackend) else backend
        self.backend_names: Final[NDArray[np.object_]] = np.full(count, driving.name, dtype=object)
        self._reward = reward
        self._unbegun: _Flags = np.ones(count, np.bool_)
        self._actions = np.zeros((count, 2))
        self._poses = np.zeros((count, 3))
        self._memory = np.zeros((count, task.memory_size))
        self._generators: list[np.random.Generator | None] = [None] * count
        self._seeds: list[int | None] = [None] * count
        self._periods = np.zeros(count)
        self._previous = np.zeros((count, 2))
        self._parameters = np.zeros((count, _MOST_PARAMETERS))
        self._episodes = self._compile()

    def _compile(self) -> Episodes:
        """Return the engine over the batch's own arrays."""
        task, config = self.task, self.task.config
        ranges = parameter_ranges("wide", task.mode)
        return Episodes(
            fleet=self.fleet.compiled,
            rules=task.rules(),
            slip_block=compiled_kernel(task.slip_block),
            ticks=task.ticks,
            steps=task.steps,
            twist=config.action_mode == "twist",
            control_period=config.control_period,
            training_speed=task.vehicle.training_speed,
            tread=task.vehicle.tread,
            yaw_rate_scale=config.yaw_rate_scale,
            bound=OBSERVATION_BOUND,
            action_change_weight=config.action_change_weight,
            slip_power_weight=config.slip_power_weight,
            slip_power_scale=task.slip_power_scale,
            broken_off_reward=task.broken_off_reward,
            ranges=np.array([ranges.low, ranges.high]) if config.observe_terrain else np.empty((0, len(ranges.low))),
            actions=self._actions,
            idle=self.idle,
            observations=self.observations,
            rewards=self.rewards,
            terms=self.terms,
            measures=self.measures,
            terminated=self.terminated,
            truncated=self.truncated,
            memory=self._memory,
            periods=self._periods,
            previous=self._previous,
            parameters=self._parameters,
            poses=self._poses,
        )

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_episodes"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._episodes = self._compile()

    def __len__(self) -> int:
        return len(self.rewards)

    @property
    def generators(self) -> tuple[np.random.Generator, ...]:
        """What the starts of each vehicle's episodes are drawn from."""
        return tuple(self._generator(index) for index in range(len(self)))

    @property
    def seeds(self) -> tuple[int | None, ...]:
        """What each generator was made from."""
        return tuple(self._seeds)

    def seed(self, index: int, seed: int | None) -> None:
        """Begin the draws of a vehicle anew, as ``reset(seed=...)`` of a single environment does."""
        self._generators[index], self._seeds[index] = seeding.np_random(seed)

    def _generator(self, index: int) -> np.random.Generator:
        generator = self._generators[index]
        if generator is None:
            generator, self._seeds[index] = seeding.np_random()
            self._generators[index] = generator
        return generator

    def restart(self, index: int, options: Mapping[str, Any] | None = None) -> None:
        """Draw and begin a vehicle's next episode."""
        self.begin(index, self.task.start(self._generator(index), options or {}))

    def begin(self, index: int, start: Start[EpisodeT]) -> None:
        """Begin an episode; its first observation and measures are in the arrays."""
        if self.fleet.ground(index) is not start.ground:
            self.fleet.set_ground(index, start.ground)
        if self.fleet.get_vehicle(index) is not start.vehicle:
            self.fleet.set_vehicle(index, start.vehicle)
        self.fleet.set_state(index, start.state)
        drawn = self.task.drawn(start)
        self.randomized[index] = drawn is not None
        if drawn is not None:
            self.drawn[index] = drawn
        self._memory[index] = self.task.remember(start.episode)
        self._episodes.begin(index)
        self._unbegun[index] = False

    def step(self, actions: ArrayLike) -> None:
        """Hold an action of every vehicle that is not idle for one control period.

        Parameters
        ----------
        actions : array_like, shape (n, 2)
            In [-1, 1].

        Raises
        ------
        InvalidInputError
            If the shape is another, or a number is not in [-1, 1]; nothing has moved then. If the reward function
            returns another shape, or what is not finite.
        ResetNeeded
            If a vehicle has no episode yet.
        """
        if self._unbegun.any():
            raise ResetNeeded("call reset() before step()")
        given = np.asarray(actions)
        if given.shape != self._actions.shape or given.dtype.kind not in "fiu":
            raise InvalidInputError(
                f"actions are numbers of shape {self._actions.shape}, a pair in [-1, 1] for each vehicle, got "
                f"{given.dtype} of shape {given.shape}"
            )
        np.copyto(self._actions, given)
        previous = None if self._reward is None else self._previous.copy()
        try:
            self._episodes.step()
        except ValueError as error:
            raise InvalidInputError(f"{error}, got {self._first_bad_action()}") from error
        if self._reward is not None and previous is not None:
            rewards = evaluate_reward(self._reward, self._view(previous))
            np.copyto(self.rewards, rewards, where=~self.idle)

    def _view(self, previous_actions: FloatArray) -> StepView:
        fleet = self.fleet
        broken_off = fleet.diverged | fleet.off_map
        motion = dict(zip(STATE_NAMES, fleet.numbers.copy(), strict=True))
        forces = np.array(fleet.record.forces, order="F")
        forces[broken_off] = 0.0
        return StepView(
            **{name: motion[name] for name in VIEWED_STATES},
            forces=forces,
            actions=np.array(self._actions, order="F"),
            previous_actions=np.array(previous_actions, order="F"),
            measures=columns(self.task.measures, self.measures),
            terms=columns(self.term_names, self.terms),
            reward=self.rewards.copy(),
            terminated=self.terminated.copy(),
            truncated=self.truncated.copy(),
            broken_off=broken_off,
        )

    def _first_bad_action(self) -> list[float]:
        bad = ~(np.abs(self._actions) <= 1.0).all(axis=1) & ~self.idle
        return self._actions[int(bad.argmax())].tolist() if bad.any() else []

    def record(self, index: int) -> TickRecord:
        """Return what a vehicle's last tick did."""
        fleet, record = self.fleet, self.fleet.record
        x, y, heading = self._poses[index].tolist()
        ground, sampling = fleet.ground(index), fleet.ground_sampling
        return TickRecord(
            record.row[index].copy(),
            record.forces[index].copy(),
            fleet.get_state(index),
            int(record.iterations[index]),
            int(record.divisions[index]),
            fleet.detection(index),
            sample_ground(ground, fleet.vehicle, sampling, x=x, y=y, heading=heading),
        )
