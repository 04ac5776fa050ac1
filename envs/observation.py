"""What a policy sees and how its actions become belt commands, apart from any environment.

The environment and a policy that drives a bare simulator share these functions, so that both see the same numbers.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..terrain import FloatArray, Ground, InvalidInputError, Mode, TrackedVehicle, parameter_ranges
from .driveline import twist_belts
from .path import Path, Projection
from .state import BeltCommand, VehicleState
from .task_config import TaskConfig
from .tracking_config import TrackingConfig

Observation = NDArray[np.float32]

#: How far a task shows what is to come, in s: of a path, at the reference speed.
LOOK_AHEAD_TIMES: Final = (0.4, 0.8, 1.2, 1.6, 2.0)
#: Bound of every part of the observation; only a diverging vehicle comes near it, and is clipped there.
OBSERVATION_BOUND: Final = 10.0


def reference_speed(vehicle: TrackedVehicle, config: TrackingConfig) -> float:
    """Return the speed at which progress earns most, in m/s."""
    return vehicle.training_speed / 2 if config.reference_speed is None else config.reference_speed


def observation_size(mode: Mode, config: TaskConfig) -> int:
    """Return the length of an observation."""
    return 9 + 2 * len(LOOK_AHEAD_TIMES) + terrain_size(mode, config)


def observe(
    state: VehicleState,
    foot: Projection,
    previous_action: FloatArray,
    *,
    vehicle: TrackedVehicle,
    path: Path,
    config: TrackingConfig,
    ground: Ground,
) -> Observation:
    """Return the observation; parts and scales as in :class:`~grouser.envs.PathTrackingEnv`.

    Parameters
    ----------
    state : VehicleState
        Of the vehicle.
    foot : Projection
        The vehicle's on the path.
    previous_action : ndarray, shape (2,)
        In [-1, 1].
    vehicle, path, config, ground
        Of the task; the ground is looked at only with ``observe_terrain``.

    Returns
    -------
    ndarray, shape (19,), or longer by the terrain parameters
    """
    shown = path_sight(state, foot, vehicle=vehicle, path=path, config=config)
    theta = ground.parameters_at(state.x, state.y) if config.observe_terrain else None
    return compose_observation(
        state, shown, previous_action, vehicle=vehicle, config=config, mode=ground.mode, theta=theta
    )


def path_sight(
    state: VehicleState, foot: Projection, *, vehicle: TrackedVehicle, path: Path, config: TrackingConfig
) -> FloatArray:
    """Return what an observation shows of the path, shape (12,): cross-track and heading error, look-ahead points."""
    speed, pose = reference_speed(vehicle, config), (state.x, state.y, state.heading)
    return look_along(path, pose, foot, speed=speed, width=config.maximum_cross_track)


def look_along(
    path: Path, pose: tuple[float, float, float], foot: Projection, *, speed: float, width: float
) -> FloatArray:
    """Return cross-track error, heading error and look-ahead points in the body frame, shape (12,), scaled.

    Parameters
    ----------
    path : Path
        What is looked along.
    pose : tuple of float
        x, y in m and heading in rad of the vehicle.
    foot : Projection
        The vehicle's on the path.
    speed : float
        At which :data:`LOOK_AHEAD_TIMES` are distances, in m/s; the last of them is the scale of the points.
    width : float
        Scale of the cross-track error in m.
    """
    ahead = speed * np.array(LOOK_AHEAD_TIMES)
    x, y, _, _ = path.sample(foot.arc_length + ahead)
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    dx, dy = x - pose[0], y - pose[1]
    points = np.stack([cosine * dx + sine * dy, cosine * dy - sine * dx], axis=1) / ahead[-1]
    heading_error = math.remainder(pose[2] - foot.heading, 2 * math.pi)
    return np.concatenate([[foot.cross_track / width, heading_error / math.pi], points.ravel()])


def compose_observation(
    state: VehicleState,
    shown: FloatArray,
    previous_action: FloatArray,
    *,
    vehicle: TrackedVehicle,
    config: TaskConfig,
    mode: Mode,
    theta: FloatArray | None,
) -> Observation:
    """Return motion, what the task shows, previous action and terrain as one observation.

    Parameters
    ----------
    state : VehicleState
        Of the vehicle.
    shown : ndarray, shape (12,)
        The task's own part, scaled.
    previous_action : ndarray, shape (2,)
        In [-1, 1].
    vehicle, config, mode
        Of the task.
    theta : ndarray, shape (p,), or None
        Terrain parameters, where they are observed.
    """
    motion = [
        state.vx / vehicle.training_speed,
        state.vy / vehicle.training_speed,
        state.yaw_rate / config.yaw_rate_scale,
        state.v_left / vehicle.training_speed,
        state.v_right / vehicle.training_speed,
    ]
    parts = [np.array(motion), shown, previous_action]
    if theta is not None:
        parts.append(terrain_sight(mode, theta))
    clipped = np.clip(np.concatenate(parts), -OBSERVATION_BOUND, OBSERVATION_BOUND)
    return np.asarray(clipped, dtype=np.float32)


def terrain_size(mode: Mode, config: TaskConfig) -> int:
    """Return how many numbers of an observation show the terrain."""
    return len(parameter_ranges("wide", mode).low) if config.observe_terrain else 0


def terrain_sight(mode: Mode, theta: FloatArray) -> FloatArray:
    """Return terrain parameters θ as an observation shows them: -1 to 1 over the ``wide`` ranges."""
    ranges = parameter_ranges("wide", mode)
    low, high = np.array(ranges.low), np.array(ranges.high)
    scaled: FloatArray = 2 * (theta - low) / (high - low) - 1
    return scaled


def check_action(action: ArrayLike) -> FloatArray:
    """Return an action in float64, shape (2,).

    Raises
    ------
    InvalidInputError
        If it is not two numbers in [-1, 1].
    """
    checked = np.asarray(action, dtype=np.float64)
    if checked.shape != (2,) or not np.all(np.abs(checked) <= 1.0):
        raise InvalidInputError(f"an action is two numbers in [-1, 1], got {action!r}")
    return checked


def belt_command(
    action: FloatArray, vehicle: TrackedVehicle, config: TaskConfig, *, top_speed: float | None = None
) -> BeltCommand:
    """Return the belt-speed command in m/s that an action in [-1, 1]² stands for; twists saturate at the belts.

    Parameters
    ----------
    action : ndarray, shape (2,)
        In [-1, 1].
    vehicle, config
        Of the task.
    top_speed : float, optional
        Belt speed of a full action in m/s; the vehicle's training speed by default.
    """
    limit = vehicle.training_speed if top_speed is None else top_speed
    if config.action_mode == "belts":
        return BeltCommand(limit * float(action[0]), limit * float(action[1]))
    yaw_rate = config.yaw_rate_scale * float(action[1])
    return twist_belts(limit * float(action[0]), yaw_rate, tread=vehicle.tread, limit=limit)
