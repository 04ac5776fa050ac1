"""The wrappers of :mod:`.wrappers` for vector environments: each sub-environment as if it were wrapped alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from numpy.typing import ArrayLike, NDArray

from ..terrain import ConfigurationError
from .disturbances import Delay, DelayLine, GaussianNoise, Rows
from .observation import Observation
from .vector_arguments import sub_seeds

_Flags = NDArray[np.bool_]
_Step = tuple[Observation, NDArray[np.float64], _Flags, _Flags, dict[str, Any]]
_Wrapper = VectorWrapper[Observation, ArrayLike, Observation, ArrayLike, NDArray[Any]]


class _Disturbed(_Wrapper, RecordConstructorArgs):
    """What both wrappers share: who is begun by a reset, and by a step."""

    def __init__(self, env: VectorEnv[Observation, ArrayLike, NDArray[Any]], **arguments: Any) -> None:
        RecordConstructorArgs.__init__(self, **arguments)
        VectorWrapper.__init__(self, env)
        mode = env.metadata.get("autoreset_mode")
        if not isinstance(mode, AutoresetMode):
            raise ConfigurationError(f"the vector environment's metadata must name its autoreset_mode, got {mode!r}")
        self._mode = mode
        self._ended: _Flags = np.zeros(env.num_envs, np.bool_)

    def _begun_by_reset(self, options: dict[str, Any] | None) -> Rows:
        """Return who begins an episode in a reset."""
        mask = (options or {}).get("reset_mask")
        begun = np.ones(self.num_envs, np.bool_) if mask is None else np.array(mask)
        self._ended = self._ended & ~begun
        return np.flatnonzero(begun)

    def _begun_by_step(self, ended: _Flags) -> Rows:
        """Return who begins an episode in a step, given who ends one."""
        before, self._ended = self._ended, ended
        if self._mode is AutoresetMode.SAME_STEP:
            return np.flatnonzero(ended)
        return np.flatnonzero(before if self._mode is AutoresetMode.NEXT_STEP else np.zeros_like(before))


class VectorObservationNoise(_Disturbed):
    """:class:`ObservationNoise` for vector environments, in every autoreset mode.

    An episode's last observation, in ``infos["final_obs"]``, has its noise as the others have.

    Parameters
    ----------
    env : gymnasium.vector.VectorEnv
        With float32 ``Box`` observations of one axis.
    standard_deviation : array_like
        As of :class:`ObservationNoise`.

    Raises
    ------
    ConfigurationError
        If the observation space is another.
    InvalidInputError
        If the standard deviations have another shape or are impossible.
    """

    def __init__(self, env: VectorEnv[Observation, ArrayLike, NDArray[Any]], standard_deviation: ArrayLike) -> None:
        super().__init__(env, standard_deviation=standard_deviation)
        self._noise = GaussianNoise(standard_deviation, env.single_observation_space, env.num_envs)
        self._everyone = np.arange(env.num_envs)
        self._shown = np.zeros(env.observation_space.shape or (), np.float32)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode in every sub-environment, or where ``options["reset_mask"]`` holds."""
        begun = self._begun_by_reset(options)
        seeds = sub_seeds(seed, self.num_envs)
        observations, infos = self.env.reset(seed=seed, options=options)  # type: ignore[arg-type]
        for row in begun.tolist():
            if (own := seeds[row]) is not None:
                self._noise.seed(row, own)
        self._shown[begun] = self._noise.add(observations[begun], begun)
        return self._shown.copy(), infos

    def step(self, actions: ArrayLike) -> _Step:
        """Step, and observe with noise."""
        observations, rewards, terminations, truncations, infos = self.env.step(actions)
        begun = self._begun_by_step(terminations | truncations)
        if self._mode is AutoresetMode.SAME_STEP and len(begun):
            last = infos["final_obs"].copy()
            for row, noisy in zip(begun, self._noise.add(np.stack(last[begun]), begun), strict=True):
                last[row] = noisy
            infos = infos | {"final_obs": last}
        self._shown = self._noise.add(observations, self._everyone)
        return self._shown.copy(), rewards, terminations, truncations, infos


class VectorActionDelay(_Disturbed):
    """:class:`ActionDelay` for vector environments, in every autoreset mode.

    Parameters
    ----------
    env : gymnasium.vector.VectorEnv
        With ``Box`` actions that hold 0.
    delay : int or pair of int
        As of :class:`ActionDelay`.

    Raises
    ------
    ConfigurationError
        If the action space is another.
    InvalidInputError
        If the delay is impossible.
    """

    def __init__(self, env: VectorEnv[Observation, ArrayLike, NDArray[Any]], delay: Delay) -> None:
        super().__init__(env, delay=delay)
        self._line = DelayLine(delay, env.single_action_space, env.num_envs)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode in every sub-environment, or where ``options["reset_mask"]`` holds."""
        begun = self._begun_by_reset(options)
        seeds = sub_seeds(seed, self.num_envs)
        observations, infos = self.env.reset(seed=seed, options=options)  # type: ignore[arg-type]
        for row in begun.tolist():
            if (own := seeds[row]) is not None:
                self._line.seed(row, own)
        return observations, infos | self._begin(begun)

    def step(self, actions: ArrayLike) -> _Step:
        """Step with the actions that arrive now."""
        arriving = self._line.shift(actions)
        observations, rewards, terminations, truncations, infos = self.env.step(arriving)
        begun = self._begun_by_step(terminations | truncations)
        if len(begun):
            infos = infos | self._begin(begun)
        return observations, rewards, terminations, truncations, infos

    def _begin(self, begun: Rows) -> dict[str, Any]:
        self._line.begin(begun)
        mask = np.zeros(self.num_envs, np.bool_)
        mask[begun] = True
        return {"action_delay": np.where(mask, self._line.delays, 0), "_action_delay": mask}
