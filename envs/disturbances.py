"""Noise on observations and delay of actions, for any number of environments side by side.

Environment i, begun with a seed, draws what a single one begun with it draws, whatever stands beside it.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from gymnasium.spaces import Box, Dict
from numpy.typing import ArrayLike, NDArray

from ..terrain import ConfigurationError, InvalidInputError

#: A delay in whole control periods, or the lowest and highest that one is drawn from for each episode.
Delay = int | tuple[int, int]

Rows = NDArray[np.intp]

# Branches of a seed, apart from each other and from the environment's own draws.
_NOISE_BRANCH: Final = 1
_DELAY_BRANCH: Final = 2
# Rows of noise that are drawn at a time, the same numbers as one by one.
_DRAWN_ROWS: Final = 32
_LONGEST_DELAY: Final = 1000


def branch(seed: int | None, key: int) -> np.random.Generator:
    """Return a generator of its own for a seed, or one that nothing determines."""
    return np.random.default_rng(None if seed is None else np.random.SeedSequence(seed, spawn_key=(key,)))


class GaussianNoise:
    """Noise on observations, clipped to their space.

    Parameters
    ----------
    standard_deviation : array_like
        Of every component, or one for all, in the observation's own scale, not negative.
    space : gymnasium.Space
        Of one observation: a float32 ``Box`` of one axis.
    count : int
        Number of environments.

    Raises
    ------
    ConfigurationError
        If the space is another.
    InvalidInputError
        If the standard deviations have another shape or are impossible.
    """

    def __init__(self, standard_deviation: ArrayLike, space: Any, count: int) -> None:
        if isinstance(space, Dict) and "achieved_goal" in space.spaces:
            raise ConfigurationError(
                "noise is not for goal-conditioned tasks: their rewards are those of the goals that are observed, so that "
                "noise on a goal would change what is earned, and without it the pose would be seen exactly"
            )
        if not isinstance(space, Box) or space.dtype != np.float32 or len(space.shape) != 1:
            raise ConfigurationError(f"noise goes on observations from a float32 Box of one axis, got {space}")
        try:
            deviation = np.asarray(standard_deviation, dtype=np.float64)
            fits = deviation.shape in ((), space.shape) and bool(np.all((deviation >= 0) & np.isfinite(deviation)))
        except (TypeError, ValueError):
            fits = False
        if not fits:
            raise InvalidInputError(
                f"standard deviations are one number or {space.shape[0]}, none negative, got {standard_deviation!r}"
            )
        self._deviation: Final = np.broadcast_to(deviation, space.shape).astype(np.float32)
        self._low: Final = space.low
        self._high: Final = space.high
        self._generators = [branch(None, _NOISE_BRANCH) for _ in range(count)]
        self._drawn = np.zeros((count, _DRAWN_ROWS, space.shape[0]), np.float32)
        self._used = np.full(count, _DRAWN_ROWS)

    def seed(self, row: int, seed: int) -> None:
        """Begin the draws of an environment anew."""
        self._generators[row] = branch(seed, _NOISE_BRANCH)
        self._used[row] = _DRAWN_ROWS

    def add(self, observations: NDArray[np.float32], rows: Rows) -> NDArray[np.float32]:
        """Return observations of some environments, shape (len(rows), k), with noise."""
        for row in rows[self._used[rows] == _DRAWN_ROWS].tolist():
            self._generators[row].standard_normal(out=self._drawn[row], dtype=np.float32)
            self._used[row] = 0
        noisy = observations + self._deviation * self._drawn[rows, self._used[rows]]
        self._used[rows] += 1
        clipped: NDArray[np.float32] = np.clip(noisy, self._low, self._high)
        return clipped


class DelayLine:
    """Actions that arrive some control periods late.

    Until an episode's first action arrives, the zero action is applied.

    Parameters
    ----------
    delay : int or pair of int
        In control periods, from 0 to 1000; a pair is the lowest and highest of a draw for each episode.
    space : gymnasium.Space
        Of one action: a ``Box`` that holds 0.
    count : int
        Number of environments.

    Attributes
    ----------
    delays : ndarray of int, shape (n,)
        Of the running episodes.

    Raises
    ------
    ConfigurationError
        If the space is another.
    InvalidInputError
        If the delay is impossible.
    """

    def __init__(self, delay: Delay, space: Any, count: int) -> None:
        if not isinstance(space, Box) or not space.contains(np.zeros(space.shape, space.dtype)):
            raise ConfigurationError(f"a delay is for actions from a Box that holds 0, got {space}")
        self._lowest, self._highest = _delay_range(delay)
        self._space: Final = space
        self._generators = [branch(None, _DELAY_BRANCH) for _ in range(count)]
        self._line = np.zeros((count, self._highest + 1, *space.shape), space.dtype)
        self._now = 0
        self.delays: Final[NDArray[np.int64]] = np.full(count, self._lowest, np.int64)

    def seed(self, row: int, seed: int) -> None:
        """Begin the draws of an environment anew."""
        self._generators[row] = branch(seed, _DELAY_BRANCH)

    def begin(self, rows: Rows) -> None:
        """Begin an episode of some environments: forget their actions, and draw their delays."""
        self._line[rows] = 0
        if self._lowest == self._highest:
            return
        for row in rows.tolist():
            self.delays[row] = self._generators[row].integers(self._lowest, self._highest + 1)

    def shift(self, actions: ArrayLike) -> NDArray[Any]:
        """Take the actions of all environments, shape (n, k), and return those that arrive now.

        Raises
        ------
        InvalidInputError
            If the shape is another, or an action is not in its space.
        """
        given = np.asarray(actions)
        inside = given.shape == (len(self.delays), *self._space.shape) and given.dtype.kind in "fiu"
        if not inside or not np.all((given >= self._space.low) & (given <= self._space.high)):
            raise InvalidInputError(
                f"actions are of shape {(len(self.delays), *self._space.shape)} in {self._space}, got {actions!r}"
            )
        length = self._highest + 1
        self._now = (self._now + 1) % length
        self._line[:, self._now] = given
        arriving: NDArray[Any] = self._line[np.arange(len(given)), (self._now - self.delays) % length]
        return arriving


def _delay_range(delay: Any) -> tuple[int, int]:
    pair = (delay, delay) if isinstance(delay, int | np.integer) else delay
    try:
        low, high = pair
        whole = all(isinstance(each, int | np.integer) and not isinstance(each, bool) for each in (low, high))
    except (TypeError, ValueError):
        whole = False
    if not whole or not 0 <= low <= high <= _LONGEST_DELAY:
        raise InvalidInputError(
            f"a delay is a number of control periods from 0 to {_LONGEST_DELAY}, or a pair of them, low <= high, "
            f"got {delay!r}"
        )
    return int(low), int(high)
