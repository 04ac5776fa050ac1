"""Parts of an observation that the scenes share, and its bounds."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from ...terrain import FloatArray
from ..observation import OBSERVATION_BOUND
from .kinematics import Kinematics


def motion_parts(
    state: Kinematics, previous_action: FloatArray, *, top_speed: float, yaw_rate_scale: float
) -> list[float]:
    """Return velocity, yaw rate, belts and previous action.

    Parameters
    ----------
    state : Kinematics
        Of the vehicle.
    previous_action : ndarray, shape (2,)
        In [-1, 1].
    top_speed, yaw_rate_scale : float
        What speeds in m/s and the yaw rate in rad/s are measured in.
    """
    return [
        state.vx / top_speed,
        state.vy / top_speed,
        state.yaw_rate / yaw_rate_scale,
        state.v_left / top_speed,
        state.v_right / top_speed,
        *previous_action.tolist(),
    ]


def bounded(parts: list[float]) -> NDArray[np.float32]:
    """Return an observation, cut to its bound."""
    cut: NDArray[np.float32] = np.clip(np.array(parts), -OBSERVATION_BOUND, OBSERVATION_BOUND).astype(np.float32)
    return cut


def observation_box(size: int) -> gymnasium.Space[NDArray[np.float32]]:
    """Return the space of observations of a size."""
    box: Any = Box(-OBSERVATION_BOUND, OBSERVATION_BOUND, (size,), np.float32)
    space: gymnasium.Space[NDArray[np.float32]] = box
    return space
