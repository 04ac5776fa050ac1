"""How far a belt point has moved over the ground, by integrating its velocity: no closed form of a path."""

import cmath
import math
from collections.abc import Sequence

from numpy.polynomial.legendre import leggauss

_NODES = [(float((1 + node) / 2), float(weight / 2)) for node, weight in zip(*leggauss(20), strict=True)]


def walked_distance(x: float, y: float, motion: Sequence[float], belt: float, time: float) -> float:
    """Distance between where a belt point touched down and where it is now, at (x, y) in body axes of this moment.

    The point's velocity over the ground in world axes, integrated over the time since: the vehicle turned and moved on
    with a constant body velocity (Vx, Vy) and yaw rate, the point backwards along it with the belt. Twenty Gauss nodes
    integrate half a turn of it to round-off.
    """
    vx, vy, omega = motion
    time = min(time, math.pi / abs(omega)) if omega else time
    moved = 0j
    for node, weight in _NODES:
        ago = node * time
        ahead = x + belt * ago
        in_body = complex(vx - omega * y - belt, vy + omega * ahead)
        moved += weight * cmath.exp(-1j * omega * ago) * in_body
    return abs(moved) * time
