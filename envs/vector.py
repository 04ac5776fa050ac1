"""Vector environments over the compiled engine: Gymnasium's tasks for any number of vehicles at once."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, Final, Generic, Literal

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from ..terrain import (
    ForceBackend,
    Ground,
    TrackedVehicle,
    unknown_name,
)
from .observation import Observation
from .path import Path
from .path_task import PathEpisode, PathTask
from .rendering import Renderer
from .reward import RewardFunction
from .speed_config import SpeedConfig, speed_config
from .speed_task import SpeedEpisode, SpeedTask
from .task import ConfigT, EpisodeT, Task
from .tracked_env import spaces
from .tracking_config import TrackingConfig, tracking_config
from .vector_arguments import (
    check_rendered_envs,
    check_reset_mask,
    check_track_forces,
    make_batch,
    resolve_autoreset_mode,
    sub_seeds,
)
from .vector_info import VectorInfo, batch_info, merged, reset_info

_Flags = NDArray[np.bool_]
Step = tuple[Observation, NDArray[np.float64], _Flags, _Flags, dict[str, Any]]

VECTOR_RENDER_MODES: Final = ("rgb_array",)


class TrackedVehicleVectorEnv(VectorEnv[Observation, ArrayLike, NDArray[Any]], Generic[ConfigT, EpisodeT]):
    """Any number of tracked vehicles at one task, stepped together on several threads.

    Sub-environment i is the single environment of the task, reset with its seed: equal actions give the same
    observations, rewards and ends to the bit, episode after episode, whatever the number of sub-environments and
    threads. So are the infos, but that ``track_forces`` and ``sprocket_power`` have to be asked for.

    Parameters
    ----------
    task : Task
        What is asked of every vehicle.
    backend : str or ForceBackend
        A compiled one: ``"physics"``, ``"exact"``, ``"native"`` or ``"guarded"``.
    num_envs : int
        Number of sub-environments.
    threads : int
        Threads that share them.
    autoreset_mode : AutoresetMode or str
        ``AutoresetMode.NEXT_STEP``, where the step after an end resets and ignores the action, or
        ``AutoresetMode.SAME_STEP``, where the step that ends also resets, with the last observation and info in
        ``infos["final_obs"]`` and ``infos["final_info"]``.
    backend_options : mapping, optional
        For :func:`grouser.terrain.make_backend`.
    reward : callable, optional
        Takes the place of the task's own; see :class:`StepView`.
    render_mode : {"rgb_array"}, optional
        What :meth:`render` returns.
    rendered_envs : int, optional
        Frames are those of the first so many sub-environments; by default of all.
    track_forces : bool
        Whether infos tell ``track_forces`` and ``sprocket_power``, for which the force block is asked twice more a
        step, and each vehicle's ground in Python.

    Raises
    ------
    ConfigurationError
        If the backend or the ground is not compiled, the autoreset mode is unknown, or track forces are asked of a
        backend that does not know the tracks apart.
    InvalidInputError
        If there is no sub-environment or no thread.
    """

    def __init__(
        self,
        task: Task[ConfigT, EpisodeT],
        backend: str | ForceBackend,
        num_envs: int,
        *,
        threads: int,
        autoreset_mode: AutoresetMode | str,
        backend_options: Mapping[str, Any] | None,
        reward: RewardFunction | None,
        render_mode: Literal["rgb_array"] | None,
        rendered_envs: int | None,
        track_forces: bool,
    ) -> None:
        if render_mode not in (None, *VECTOR_RENDER_MODES):
            raise unknown_name("render mode of a vector environment", render_mode, VECTOR_RENDER_MODES)
        self.autoreset_mode: Final = resolve_autoreset_mode(autoreset_mode)
        self.batch: Final = make_batch(
            task, backend, num_envs, threads=threads, backend_options=backend_options, reward=reward
        )
        self._track_forces = check_track_forces(track_forces, self.batch.fleet.backend)
        self.task: Final = task
        self.num_envs = num_envs
        self.single_action_space, self.single_observation_space = spaces(task)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.metadata = {
            "render_modes": list(VECTOR_RENDER_MODES),
            "render_fps": round(1 / task.config.control_period),
            "autoreset_mode": self.autoreset_mode,
        }
        self.render_mode = render_mode
        self._rendered = check_rendered_envs(rendered_envs, num_envs)
        self._renderers: list[Renderer] = []
        self._ended: _Flags = np.zeros(num_envs, np.bool_)
        self._all: _Flags = np.ones(num_envs, np.bool_)

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """Generator of each sub-environment."""
        return self.batch.generators

    @property
    def np_random_seed(self) -> tuple[int | None, ...]:  # type: ignore[override]
        """Seed of each sub-environment."""
        return self.batch.seeds

    def reconfigure(self, **settings: Any) -> None:
        """Change settings of starts, commands and randomization of every sub-environment, from its next episode on.

        Raises
        ------
        ConfigurationError
            If a key is unknown, or its setting holds for the life of an environment; nothing has changed then.
        InvalidInputError
            If a value is impossible; nothing has changed then.
        """
        self.task.reconfigure(**settings)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, VectorInfo]:
        """Start an episode in every sub-environment.

        Parameters
        ----------
        seed : int or sequence of int, optional
            Of each sub-environment; one number s stands for s, s + 1, s + 2, ...
        options : dict, optional
            Of the task's single environment, for all alike; and ``reset_mask``, a bool array of shape (n,), to reset
            only where it holds.

        Raises
        ------
        InvalidInputError
            If there are not as many seeds as sub-environments, or the mask is not one.
        """
        chosen = dict(options or {})
        mask = self._all
        if "reset_mask" in chosen:
            mask = check_reset_mask(chosen.pop("reset_mask"), self.num_envs)
        seeds = sub_seeds(seed, self.num_envs)
        for index in np.flatnonzero(mask).tolist():
            if seeds[index] is not None:
                self.batch.seed(index, seeds[index])
            self.batch.restart(index, chosen)
        self._ended = self._ended & ~mask
        return self.batch.observations.copy(), reset_info(self.batch, mask)

    def step(self, actions: ArrayLike) -> Step:
        """Hold an action of every sub-environment for one control period.

        Parameters
        ----------
        actions : array_like, shape (n, 2)
            In [-1, 1].

        Returns
        -------
        observations : ndarray of float32, shape (n, k)
        rewards : ndarray, shape (n,)
        terminations, truncations : ndarray of bool, shape (n,)
        infos : dict
            Arrays by name, each with a mask ``_name`` of who has it.

        Raises
        ------
        InvalidInputError
            If the actions have another shape or leave the box.
        """
        batch = self.batch
        batch.idle[:] = self._ended
        batch.step(actions)
        rewards, terminations, truncations = batch.rewards.copy(), batch.terminated.copy(), batch.truncated.copy()
        ended = terminations | truncations
        if self.autoreset_mode is AutoresetMode.SAME_STEP:
            observations, infos = self._same_step(ended)
        else:
            observations, infos = self._next_step(ended)
        return observations, rewards, terminations, truncations, infos

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Return a frame, shape (height, width, 3), of each of the first ``rendered_envs`` sub-environments."""
        if self.render_mode is None:
            gymnasium.logger.warn("render() without a render_mode: pass render_mode='rgb_array' to gymnasium.make_vec")
            return None
        task, fleet = self.task, self.batch.fleet
        if not self._renderers:
            self._renderers = [Renderer(task.shown_path, task.vehicle) for _ in range(self._rendered)]
        frames = []
        for index, renderer in enumerate(self._renderers):
            state = fleet.get_state(index)
            command = task.commanded(state, self.batch.measures[index].tolist())
            ground = fleet.ground(index)
            frames.append(renderer.draw(state, label=fleet.backend.name, ground=ground, command=command))
        return tuple(frame for frame in frames if frame is not None)

    def close_extras(self, **kwargs: Any) -> None:
        """Let go of what draws frames."""
        self._renderers.clear()

    def _next_step(self, ended: _Flags) -> tuple[Observation, VectorInfo]:
        batch, resets = self.batch, self._ended
        self._ended = ended
        if not resets.any():
            return batch.observations.copy(), self._step_info(self._all)
        infos = self._step_info(~resets)
        self._restart(resets)
        return batch.observations.copy(), merged(infos, reset_info(batch, resets))

    def _same_step(self, ended: _Flags) -> tuple[Observation, VectorInfo]:
        batch = self.batch
        if not ended.any():
            return batch.observations.copy(), self._step_info(self._all)
        infos = self._step_info(~ended)
        final = self._step_info(ended)
        last = np.full(self.num_envs, None, dtype=object)
        for index in np.flatnonzero(ended).tolist():
            last[index] = batch.observations[index].copy()
        self._restart(ended)
        infos = merged(infos, reset_info(batch, ended))
        infos |= {"final_obs": last, "_final_obs": ended.copy(), "final_info": final, "_final_info": ended.copy()}
        return batch.observations.copy(), infos

    def _step_info(self, stepped: _Flags) -> VectorInfo:
        return batch_info(self.batch, stepped, track_forces=self._track_forces)

    def _restart(self, mask: _Flags) -> None:
        for index in np.flatnonzero(mask).tolist():
            self.batch.restart(index)


class PathTrackingVectorEnv(TrackedVehicleVectorEnv[TrackingConfig, PathEpisode]):
    """``grouser/PathTracking-v0`` for many vehicles; see :class:`PathTrackingEnv` and :class:`TrackedVehicleVectorEnv`.

    Parameters
    ----------
    num_envs, threads, autoreset_mode, render_mode, rendered_envs, track_forces
        As of :class:`TrackedVehicleVectorEnv`.
    backend, vehicle, terrain, path, backend_options, reward, **settings
        As of :class:`PathTrackingEnv`.
    """

    def __init__(
        self,
        num_envs: int = 1,
        backend: str | ForceBackend = "native",
        vehicle: str | os.PathLike[str] | TrackedVehicle = "m113",
        terrain: str | os.PathLike[str] | Ground = "asphalt",
        path: str | os.PathLike[str] | Path = "iso-3888-1",
        *,
        threads: int = 1,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        backend_options: Mapping[str, Any] | None = None,
        reward: RewardFunction | None = None,
        render_mode: Literal["rgb_array"] | None = None,
        rendered_envs: int | None = None,
        track_forces: bool = False,
        **settings: Any,
    ) -> None:
        super().__init__(
            PathTask(vehicle, terrain, tracking_config(settings), path),
            backend,
            num_envs,
            threads=threads,
            autoreset_mode=autoreset_mode,
            backend_options=backend_options,
            reward=reward,
            render_mode=render_mode,
            rendered_envs=rendered_envs,
            track_forces=track_forces,
        )


class SpeedTrackingVectorEnv(TrackedVehicleVectorEnv[SpeedConfig, SpeedEpisode]):
    """``grouser/SpeedTracking-v0`` for many vehicles; see :class:`SpeedTrackingEnv` and :class:`TrackedVehicleVectorEnv`.

    Parameters
    ----------
    num_envs, threads, autoreset_mode, render_mode, rendered_envs, track_forces
        As of :class:`TrackedVehicleVectorEnv`.
    backend, vehicle, terrain, backend_options, reward, **settings
        As of :class:`SpeedTrackingEnv`.
    """

    def __init__(
        self,
        num_envs: int = 1,
        backend: str | ForceBackend = "native",
        vehicle: str | os.PathLike[str] | TrackedVehicle = "m113",
        terrain: str | os.PathLike[str] | Ground = "asphalt",
        *,
        threads: int = 1,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        backend_options: Mapping[str, Any] | None = None,
        reward: RewardFunction | None = None,
        render_mode: Literal["rgb_array"] | None = None,
        rendered_envs: int | None = None,
        track_forces: bool = False,
        **settings: Any,
    ) -> None:
        super().__init__(
            SpeedTask(vehicle, terrain, speed_config(settings)),
            backend,
            num_envs,
            threads=threads,
            autoreset_mode=autoreset_mode,
            backend_options=backend_options,
            reward=reward,
            render_mode=render_mode,
            rendered_envs=rendered_envs,
            track_forces=track_forces,
        )
