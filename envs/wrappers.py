"""Wrappers for single environments: noise on what is observed, delay of what is commanded."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import ArrayLike, NDArray

from .disturbances import Delay, DelayLine, GaussianNoise
from .observation import Observation

_Action = NDArray[np.float32]
_Wrapper = gymnasium.Wrapper[Observation, _Action, Observation, _Action]
_ONE = np.zeros(1, np.intp)


class ObservationNoise(_Wrapper, RecordConstructorArgs):
    """Gaussian noise on observations, clipped to their space.

    It draws from a generator of its own, which ``reset(seed=...)`` begins anew: the environment's own draws stay.

    Parameters
    ----------
    env : gymnasium.Env
        With a float32 ``Box`` of one axis as observation space.
    standard_deviation : array_like
        Of every component, or one for all, in the observation's own scale, not negative.

    Raises
    ------
    ConfigurationError
        If the observation space is another.
    InvalidInputError
        If the standard deviations have another shape or are impossible.
    """

    def __init__(self, env: gymnasium.Env[Observation, _Action], standard_deviation: ArrayLike) -> None:
        RecordConstructorArgs.__init__(self, standard_deviation=standard_deviation)
        gymnasium.Wrapper.__init__(self, env)
        self._noise = GaussianNoise(standard_deviation, env.observation_space, 1)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode."""
        if seed is not None:
            self._noise.seed(0, seed)
        observation, info = self.env.reset(seed=seed, options=options)
        return self._noise.add(observation[None], _ONE)[0], info

    def step(self, action: _Action) -> tuple[Observation, Any, bool, bool, dict[str, Any]]:
        """Step, and observe with noise."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        return self._noise.add(observation[None], _ONE)[0], reward, terminated, truncated, info


class ActionDelay(_Wrapper, RecordConstructorArgs):
    """Actions that arrive whole control periods late.

    Until an episode's first action arrives, the zero action is applied. The previous action in a task's observation
    is the one that arrived. The ``info`` of a reset holds ``action_delay``.

    Parameters
    ----------
    env : gymnasium.Env
        With a ``Box`` that holds 0 as action space.
    delay : int or pair of int
        In control periods, from 0 to 1000; a pair is the lowest and highest of a draw for each episode, from a
        generator of its own, which ``reset(seed=...)`` begins anew.

    Raises
    ------
    ConfigurationError
        If the action space is another.
    InvalidInputError
        If the delay is impossible.
    """

    def __init__(self, env: gymnasium.Env[Observation, _Action], delay: Delay) -> None:
        RecordConstructorArgs.__init__(self, delay=delay)
        gymnasium.Wrapper.__init__(self, env)
        self._line = DelayLine(delay, env.action_space, 1)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode."""
        if seed is not None:
            self._line.seed(0, seed)
        observation, info = self.env.reset(seed=seed, options=options)
        self._line.begin(_ONE)
        return observation, info | {"action_delay": int(self._line.delays[0])}

    def step(self, action: _Action) -> tuple[Observation, Any, bool, bool, dict[str, Any]]:
        """Step with the action that arrives now."""
        return self.env.step(self._line.shift(np.asarray(action)[None])[0])
