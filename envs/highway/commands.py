"""What a tracked vehicle takes for a command, and highway-env's acceleration and steering as belt speeds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ...terrain import InvalidInputError, TrackedVehicle
from ..driveline import twist_belts
from ..state import BeltCommand
from .kinematics import Kinematics

#: Belt speeds, or highway-env's dict of ``acceleration`` in m/s² and ``steering`` in rad.
Command = BeltCommand | Mapping[str, float]


def as_command(action: Any) -> Command:
    """Return an action as a command, once it is seen to be one.

    Raises
    ------
    InvalidInputError
        If it is none, or not finite.
    """
    if isinstance(action, BeltCommand):
        numbers: Sequence[float] = action
    elif isinstance(action, Mapping) and action.keys() == {"acceleration", "steering"}:
        numbers = [float(value) for value in action.values()]
    else:
        raise InvalidInputError(
            "a tracked vehicle takes a BeltCommand, or a dict of acceleration and steering as ContinuousAction and "
            f"DiscreteAction give it, got {action!r}"
        )
    if not all(map(math.isfinite, numbers)):
        raise InvalidInputError(f"a command must be finite, got {action!r}")
    command: Command = action
    return command


def bicycle_yaw_rate(speed: float, steering: float, length: float) -> float:
    """Return the yaw rate in rad/s of highway-env's kinematic bicycle: v sin β/(length/2), tan β = ½ tan δ.

    Parameters
    ----------
    speed : float
        v in m/s.
    steering : float
        δ in rad, of the front wheels.
    length : float
        In m, of the vehicle: highway-env puts the axles at its ends.
    """
    side_slip = math.atan(math.tan(steering) / 2)
    return speed * math.sin(side_slip) / (length / 2)


def accelerating_command(speed: float, acceleration: float, elapsed: float, time_constant: float) -> float:
    """Return the command under which a first-order lag changes its speed by ``acceleration * elapsed``.

    V + a Δt/(1 − exp(−Δt/T_d)); where the drive limits the rate of the belts, they change by less.

    Parameters
    ----------
    speed : float
        V in m/s, at the start.
    acceleration : float
        a in m/s².
    elapsed : float
        Δt in s.
    time_constant : float
        T_d in s.
    """
    return speed + acceleration * elapsed / -math.expm1(-elapsed / time_constant)


def bicycle_belts(
    state: Kinematics,
    action: Mapping[str, float],
    elapsed: float,
    *,
    vehicle: TrackedVehicle,
    length: float,
    speeds: tuple[float, float],
) -> BeltCommand:
    """Return the belts that ask for highway-env's acceleration and steering.

    Parameters
    ----------
    state : Kinematics
        Of the vehicle at the start.
    action : mapping
        ``acceleration`` in m/s² and ``steering`` in rad.
    elapsed : float
        Over which the speed is to change, in s.
    vehicle : TrackedVehicle
        The vehicle.
    length : float
        Of its footprint in m.
    speeds : tuple of float
        Least and largest speed in m/s.
    """
    mean = (state.v_left + state.v_right) / 2
    speed = accelerating_command(mean, float(action["acceleration"]), elapsed, vehicle.belt_time_constant)
    speed = min(speeds[1], max(speeds[0], speed))
    yaw_rate = bicycle_yaw_rate(mean, float(action["steering"]), length)
    return twist_belts(speed, yaw_rate, tread=vehicle.tread, limit=vehicle.maximum_speed)


def cruising_belts(state: Kinematics, steering: float, *, vehicle: TrackedVehicle, length: float) -> BeltCommand:
    """Return the belts that hold their mean speed at a steering angle in rad, ``length`` that of the footprint in m."""
    mean = (state.v_left + state.v_right) / 2
    yaw_rate = bicycle_yaw_rate(mean, steering, length)
    return twist_belts(mean, yaw_rate, tread=vehicle.tread, limit=vehicle.maximum_speed)
