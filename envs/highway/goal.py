"""Goals of a parked vehicle, how far it is from one, and what that earns: functions of one pair or of many alike."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...terrain import FloatArray, InvalidInputError

#: Parts of a goal, as highway-env's parking-v0 has them: position and velocity in the plane, direction of the heading.
GOAL_NAMES: Final = ("x", "y", "vx", "vy", "cos_h", "sin_h")
#: What each part of a goal is measured in: m, m/s, 1.
GOAL_SCALES: Final = (5.0, 5.0, 5.0, 5.0, 1.0, 1.0)
_SCALES: Final = np.array(GOAL_SCALES)


class GoalErrors(NamedTuple):
    """Distance in m, angle in rad and difference of the velocities in m/s, each of shape (n,)."""

    position: FloatArray
    heading: FloatArray
    speed: FloatArray


class Tolerance(NamedTuple):
    """What still counts as parked, in m, rad and m/s."""

    position: float
    heading: float
    speed: float


def make_goal(x: float, y: float, vx: float, vy: float, heading: float, bound: float) -> NDArray[np.float32]:
    """Return a goal, shape (6,), cut to ±``bound``; velocity in the plane's axes."""
    numbers = np.array([x, y, vx, vy, math.cos(heading), math.sin(heading)])
    goal: NDArray[np.float32] = np.clip(numbers / _SCALES, -bound, bound).astype(np.float32)
    return goal


def as_goals(goals: ArrayLike) -> FloatArray:
    """Return goals in float64, shape (n, 6).

    Raises
    ------
    InvalidInputError
        If the shape is neither (6,) nor (n, 6).
    """
    array = np.asarray(goals, dtype=np.float64)
    if array.ndim not in (1, 2) or array.shape[-1] != len(GOAL_NAMES):
        raise InvalidInputError(f"goals have shape ({len(GOAL_NAMES)},) or (n, {len(GOAL_NAMES)}), got {array.shape}")
    return array.reshape(-1, len(GOAL_NAMES))


def goal_errors(achieved: FloatArray, desired: FloatArray) -> GoalErrors:
    """Return how far achieved goals are from desired ones, both (n, 6)."""
    offset = (achieved - desired) * _SCALES
    dot = achieved[:, 4] * desired[:, 4] + achieved[:, 5] * desired[:, 5]
    cross = achieved[:, 4] * desired[:, 5] - achieved[:, 5] * desired[:, 4]
    return GoalErrors(
        np.hypot(offset[:, 0], offset[:, 1]), np.arctan2(np.abs(cross), dot), np.hypot(offset[:, 2], offset[:, 3])
    )


def within(errors: GoalErrors, tolerance: Tolerance) -> NDArray[np.bool_]:
    """Return which of them count as parked, shape (n,)."""
    inside: NDArray[np.bool_] = (
        (errors.position <= tolerance.position)
        & (errors.heading <= tolerance.heading)
        & (errors.speed <= tolerance.speed)
    )
    return inside


def goal_reward(achieved: FloatArray, desired: FloatArray, weights: tuple[float, ...], exponent: float) -> FloatArray:
    """Return −(Σ w_i |achieved_i − desired_i|)^p of goals (n, 6), shape (n,): parking-v0's weighted norm.

    The sum is taken part by part, so that a pair has the same bits alone and among others.
    """
    gaps = np.abs(achieved - desired)
    total = np.zeros(len(gaps))
    for part, weight in enumerate(weights):
        total += weight * gaps[:, part]
    reward: FloatArray = -np.power(total, exponent)
    return reward
