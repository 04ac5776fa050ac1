"""What every Gymnasium task of one tracked vehicle shares: actions, the control period, breaking off, info, frames."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from typing import Any, Final, Generic, Literal

import gymnasium
import numpy as np
from numpy.typing import NDArray

from ..terrain import (
    ConfigurationError,
    FloatArray,
    ForceBackend,
    OffMapError,
    SimulationDivergedError,
    TrackedVehicle,
    make_backend,
    unknown_name,
)
from .batch import Batch
from .observation import OBSERVATION_BOUND, Observation, belt_command, check_action
from .rendering import RENDER_MODES, Renderer, RenderMode
from .reward import Outcome, RewardFunction, evaluate_reward, single_view
from .simulator import Simulator
from .state import VehicleState
from .step_info import drawn_info, force_info
from .task import SHARED_TERMS, ConfigT, EpisodeT, Start, Task

ActionSpace = gymnasium.Space[NDArray[np.float32]]
ObservationSpace = gymnasium.Space[Observation]

#: Whether control periods are simulated by the compiled engine or tick by tick in Python.
Engine = Literal["compiled", "python"]
ENGINES: Final[tuple[Engine, ...]] = ("compiled", "python")


class TrackedVehicleEnv(gymnasium.Env[Observation, NDArray[np.float32]], Generic[ConfigT, EpisodeT]):
    """One tracked vehicle at a task.

    Parameters
    ----------
    task : Task
        What is asked of the vehicle.
    backend : str or ForceBackend
        Name for :func:`grouser.terrain.make_backend`, or a backend.
    render_mode : {"rgb_array", "human"}, optional
        How :meth:`render` shows the vehicle.
    backend_options : mapping, optional
        For :func:`grouser.terrain.make_backend`.
    engine : {"compiled", "python"}, optional
        What simulates a control period; by default the compiled engine, wherever it has the backend and the ground.
    reward : callable, optional
        Takes the place of the task's own; see :class:`StepView`.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - as Gymnasium declares it
        "render_modes": list(RENDER_MODES),
        "render_fps": 10,
    }

    def __init__(
        self,
        task: Task[ConfigT, EpisodeT],
        backend: str | ForceBackend,
        *,
        render_mode: RenderMode | None,
        backend_options: Mapping[str, Any] | None,
        engine: Engine | None,
        reward: RewardFunction | None,
    ) -> None:
        if engine is not None and engine not in ENGINES:
            raise unknown_name("engine", engine, ENGINES)
        if render_mode is not None and render_mode not in RENDER_MODES:
            raise unknown_name("render mode", render_mode, RENDER_MODES)
        self.task: Final = task
        self.vehicle: Final = task.vehicle
        built = make_backend(backend, mode=task.mode, vehicle=task.vehicle, **(backend_options or {}))
        self.simulator = make_simulator(task, built, task.vehicle)
        self._engine = engine
        self._reward = reward
        self._batch = None if engine == "python" else self._compile()
        self._in_batch = False
        self._shown_state: VehicleState | None = None
        self.render_mode = render_mode
        # Gymnasium widens render_mode to any string.
        self._draw_mode = render_mode
        self._renderer: Renderer | None = None
        self.metadata = self.metadata | {"render_fps": round(1 / self.config.control_period)}
        self.action_space, self.observation_space = spaces(task)
        self._action = np.zeros(2)
        self._step_count = 0
        self._begun: EpisodeT | None = None
        self._theta: FloatArray | None = None

    def _compile(self) -> Batch[ConfigT, EpisodeT] | None:
        """Return the compiled engine of this one vehicle, where there is one."""
        try:
            return Batch(self.task, self.simulator.backend, 1, reward=self._reward)
        except ConfigurationError:
            if self._engine == "compiled":
                raise
            return None

    @property
    def config(self) -> ConfigT:
        """Settings of the task."""
        return self.task.config

    def reconfigure(self, **settings: Any) -> None:
        """Change settings of starts, commands and randomization, from the next reset on.

        Parameters
        ----------
        **settings
            Those that ``changeable`` of the task's configuration names.

        Raises
        ------
        ConfigurationError
            If a key is unknown, or its setting holds for the life of an environment; nothing has changed then.
        InvalidInputError
            If a value is impossible; nothing has changed then.
        """
        self.task.reconfigure(**settings)

    @property
    def _episode(self) -> EpisodeT:
        if self._begun is None:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        return self._begun

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode.

        The same draws are made whatever the options, so that an option changes nothing but what it names.
        """
        super().reset(seed=seed)
        start = self.task.start(self.np_random, options or {})
        self._in_batch = self._begin_in_batch(start)
        if start.vehicle != self.simulator.vehicle:
            self.simulator = make_simulator(self.task, self.simulator.backend, start.vehicle)
        self.simulator.set_ground(start.ground)
        self._show(start.state)
        self._begun = start.episode
        self._step_count = 0
        self._action = np.zeros(2)
        if self._renderer is not None:
            self._renderer.reset()
        if self.render_mode == "human":
            self.render()
        return self._observation(), self._measures(start.state) | drawn_info(self.task.mode, self.task.drawn(start))

    def _begin_in_batch(self, start: Start[EpisodeT]) -> bool:
        """Begin an episode in the compiled engine, unless there is none or it does not have the ground."""
        if self._batch is None:
            return False
        try:
            self._batch.begin(0, start)
        except ConfigurationError:
            if self._engine == "compiled":
                raise
            return False
        return True

    def _show(self, state: VehicleState) -> None:
        """Let the simulator have the engine's state."""
        self._shown_state = state
        self.simulator.set_state(state)

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Hold an action for one control period.

        Raises
        ------
        InvalidInputError
            If the action is not two numbers in [-1, 1].
        """
        checked = check_action(action)
        episode = self._episode
        outcome = self._step_in_batch(checked) if self._in_batch else self._step_in_python(checked, episode)
        if self.render_mode == "human":
            self.render()
        return outcome

    def _step_in_batch(self, action: FloatArray) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        batch = self._batch
        if batch is None:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        fleet, simulator = batch.fleet, self.simulator
        if simulator.get_state() is not self._shown_state:
            fleet.set_state(0, simulator.get_state())
        if simulator.ground is not fleet.ground(0):
            fleet.set_ground(0, simulator.ground)
        batch.step(action[None])
        state = fleet.get_state(0)
        self._show(state)
        info = self._measures(state)
        if fleet.diverged[0] or fleet.off_map[0]:
            info |= {"diverged" if fleet.diverged[0] else "off_map": True}
        else:
            terms = dict(zip(batch.term_names, batch.terms[0].tolist(), strict=True))
            info |= force_info(simulator.backend, batch.record(0)) | {"reward_terms": terms}
        ends = bool(batch.terminated[0]), bool(batch.truncated[0])
        return self._observation(), float(batch.rewards[0]), *ends, info

    def _step_in_python(
        self, action: FloatArray, episode: EpisodeT
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        command = belt_command(action, self.vehicle, self.config)
        try:
            for _ in range(self.task.ticks):
                record = self.simulator.step(command)
        except SimulationDivergedError:
            return self._broken_off(action, "diverged")
        except OffMapError:
            return self._broken_off(action, "off_map")
        own, terminated = self.task.assess(episode, record.state)
        costs = self.task.costs(action, self._action, record)
        terms = dict(zip((*self.task.terms, *SHARED_TERMS), own + costs, strict=True))
        previous, self._action = self._action, action
        self._step_count += 1
        truncated = not terminated and self._step_count >= self.task.steps
        measures = self._measures(record.state)
        info = force_info(self.simulator.backend, record) | measures | {"reward_terms": terms}
        reward = sum(terms.values())
        if self._reward is not None:
            outcome = Outcome(record.forces, measures, terms, reward, terminated, truncated, broken_off=False)
            reward = evaluate_reward(self._reward, single_view(record.state, action, previous, outcome)).item()
        return self._observation(), reward, terminated, truncated, info

    def _broken_off(self, action: FloatArray, why: str) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """End the episode where the last solved tick left the vehicle: one bad episode must not end a training."""
        previous, self._action = self._action, action
        self._step_count += 1
        state = self.simulator.get_state()
        self.task.follow(self._episode, state)
        measures, reward = self._measures(state), self.task.broken_off_reward
        if self._reward is not None:
            terms = dict.fromkeys((*self.task.terms, *SHARED_TERMS), 0.0)
            outcome = Outcome(np.zeros(3), measures, terms, reward, terminated=True, truncated=False, broken_off=True)
            reward = evaluate_reward(self._reward, single_view(state, action, previous, outcome)).item()
        return self._observation(), reward, True, False, {why: True} | measures

    def render(self) -> NDArray[np.uint8] | None:
        """Show the vehicle from above: an image (height, width, 3), or a window."""
        if self._draw_mode is None:
            gymnasium.logger.warn("render() without a render_mode: pass render_mode='rgb_array' to gymnasium.make")
            return None
        if self._renderer is None:
            fps = self.metadata["render_fps"]
            self._renderer = Renderer(self.task.shown_path, self.vehicle, self._draw_mode, fps=fps)
        simulator, state = self.simulator, self.simulator.get_state()
        command = None if self._begun is None else self.task.commanded(state, tuple(self._measures(state).values()))
        return self._renderer.draw(state, label=simulator.backend.name, ground=simulator.ground, command=command)

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _measures(self, state: VehicleState) -> dict[str, Any]:
        """Return what the task tells of the vehicle."""
        if self._in_batch and self._batch is not None:
            return dict(zip(self.task.measures, self._batch.measures[0].tolist(), strict=True))
        return dict(zip(self.task.measures, self.task.measure(self._episode, state), strict=True))

    def _observation(self) -> Observation:
        if self._in_batch and self._batch is not None:
            observation: Observation = self._batch.observations[0].copy()
            return observation
        state = self.simulator.get_state()
        if self.config.observe_terrain:
            # Off the map the vehicle sees what it saw last.
            with contextlib.suppress(OffMapError):
                self._theta = self.simulator.ground.parameters_at(state.x, state.y)
        return self.task.observe(self._episode, state, self._action, self._theta)


def make_simulator(task: Task[ConfigT, EpisodeT], backend: ForceBackend, vehicle: TrackedVehicle) -> Simulator:
    """Return the simulator of a task's vehicle, or of one that differs outside the force block."""
    config = task.config
    return Simulator(
        vehicle,
        backend,
        task.ground,
        tick=config.tick,
        integrator=config.integrator,
        ground_sampling=config.ground_sampling,
    )


def spaces(task: Task[ConfigT, EpisodeT]) -> tuple[ActionSpace, ObservationSpace]:
    """Return action and observation space of one vehicle at a task."""
    return (
        gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32),
        gymnasium.spaces.Box(-OBSERVATION_BOUND, OBSERVATION_BOUND, (task.observation_size,), np.float32),
    )
