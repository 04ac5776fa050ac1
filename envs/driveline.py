"""Which belts a motion asks for, and how they follow: a rate-limited first-order lag, integrated exactly."""

from __future__ import annotations

import math

from ..terrain import InvalidInputError, TrackedVehicle
from .state import BeltCommand


def advance_belt(speed: float, command: float, elapsed: float, *, time_constant: float, acceleration: float) -> float:
    """Return the belt speed after ``elapsed`` s under a constant command.

    dV/dt = clip((u − V)/T_d, ±a): while the gap exceeds a·T_d the belt ramps, then it closes in exponentially.

    Parameters
    ----------
    speed, command : float
        V and u in m/s.
    elapsed : float
        In s.
    time_constant : float
        T_d in s.
    acceleration : float
        a in m/s².

    Examples
    --------
    >>> advance_belt(0.0, 10.0, 0.5, time_constant=0.2, acceleration=4.0)
    2.0
    """
    gap = command - speed
    direction = math.copysign(1.0, gap)
    linear_gap = acceleration * time_constant
    ramp_time = (abs(gap) - linear_gap) / acceleration
    if ramp_time >= elapsed:
        return speed + direction * acceleration * elapsed
    if ramp_time > 0:
        return command - direction * linear_gap * math.exp(-(elapsed - ramp_time) / time_constant)
    return command - gap * math.exp(-elapsed / time_constant)


def advance_belts(
    vehicle: TrackedVehicle, belts: tuple[float, float], command: BeltCommand, elapsed: float
) -> tuple[float, float]:
    """Return both belt speeds in m/s after ``elapsed`` s."""
    left, right = (
        advance_belt(
            speed,
            target,
            elapsed,
            time_constant=vehicle.belt_time_constant,
            acceleration=vehicle.belt_acceleration,
        )
        for speed, target in zip(belts, command, strict=True)
    )
    return left, right


def twist_belts(speed: float, yaw_rate: float, *, tread: float, limit: float) -> BeltCommand:
    """Return the belts that roll at a speed and yaw rate without slip, each cut to ±``limit``.

    Parameters
    ----------
    speed, yaw_rate : float
        In m/s and rad/s.
    tread : float
        B in m.
    limit : float
        In m/s.

    Examples
    --------
    >>> twist_belts(2.0, 0.5, tread=2.0, limit=10.0)
    BeltCommand(left=1.5, right=2.5)
    """
    half_difference = yaw_rate * tread / 2
    left, right = (min(limit, max(-limit, belt)) for belt in (speed - half_difference, speed + half_difference))
    return BeltCommand(left, right)


def check_command(vehicle: TrackedVehicle, command: BeltCommand) -> BeltCommand:
    """Return the command as plain floats, once it is seen to be two finite speeds that the drive can reach.

    Raises
    ------
    InvalidInputError
        If it is not.
    """
    limit = vehicle.maximum_speed
    try:
        left, right = map(float, command)
        reachable = abs(left) <= limit and abs(right) <= limit
    except (TypeError, ValueError):
        reachable = False
    if not reachable:
        raise InvalidInputError(
            f"a belt command is two speeds in [{-limit:g}, {limit:g}] m/s ({vehicle.name}), got {command!r}"
        )
    return BeltCommand(left, right)
