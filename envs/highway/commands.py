"""From speed and yaw rate, and from highway-env's acceleration and steering, to belt commands."""

from __future__ import annotations

import math

from ..state import BeltCommand


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
