"""A commanded motion over time: speed and yaw rate, smooth from knot to knot."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..terrain import FloatArray, InvalidInputError
from ..terrain.parameters import require_in


@dataclass(frozen=True, eq=False)
class MotionProfile:
    """Speed and yaw rate that a vehicle is to keep.

    From each knot the reference rises or falls to the next over ``ramp_time``, along u²(3 − 2u), and stays there for
    the rest of ``segment_time``. The last knot holds for good.

    Parameters
    ----------
    speed : ndarray, shape (n,)
        At the knots, in m/s.
    yaw_rate : ndarray, shape (n,)
        At the knots, in rad/s.
    segment_time : float
        From knot to knot, in s.
    ramp_time : float
        In which the reference changes, in s, in (0, segment_time].

    Raises
    ------
    InvalidInputError
        If shapes differ, a number is not finite, or a time is impossible.

    Examples
    --------
    >>> MotionProfile(np.array([1.0, 3.0]), np.zeros(2), segment_time=4.0, ramp_time=2.0).at(1.0)
    (2.0, 0.0)
    """

    speed: FloatArray
    yaw_rate: FloatArray
    segment_time: float
    ramp_time: float

    def __post_init__(self) -> None:
        for name in ("speed", "yaw_rate"):
            values = np.array(getattr(self, name), dtype=np.float64)
            if values.ndim != 1 or len(values) < 1 or values.shape != np.shape(self.speed):
                raise InvalidInputError(
                    f"a motion profile's {name} must have shape (n,) like speed, got {values.shape}"
                )
            if not np.isfinite(values).all():
                raise InvalidInputError(f"a motion profile's {name} must be finite")
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        require_in("segment_time", self.segment_time, 0.0, 1e4, low_open=True)
        require_in("ramp_time", self.ramp_time, 0.0, self.segment_time, low_open=True)

    def at(self, time: float) -> tuple[float, float]:
        """Return speed in m/s and yaw rate in rad/s at a time in s, not negative."""
        knot, last = math.floor(time / self.segment_time), len(self.speed) - 1
        if knot >= last:
            return float(self.speed[last]), float(self.yaw_rate[last])
        u = min(1.0, (time - knot * self.segment_time) / self.ramp_time)
        rise = u * u * (3.0 - 2.0 * u)
        speed, yaw_rate = (
            float(values[knot] + rise * (values[knot + 1] - values[knot])) for values in (self.speed, self.yaw_rate)
        )
        return speed, yaw_rate

    def knots(self) -> FloatArray:
        """Return speed and yaw rate of every knot, shape (n, 2)."""
        return np.column_stack([self.speed, self.yaw_rate])
