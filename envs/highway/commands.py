"""From highway-env's acceleration and steering to speed and yaw rate."""

from __future__ import annotations

import math


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
