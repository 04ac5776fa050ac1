"""A test that says quickly that two rectangles do not meet, before highway-env's own says how they do."""

from __future__ import annotations

import math
from typing import NamedTuple


class Box(NamedTuple):
    """A rectangle.

    Parameters
    ----------
    x, y : float
        Centre in m.
    heading : float
        Of its length, in rad.
    length, width : float
        In m.
    """

    x: float
    y: float
    heading: float
    length: float
    width: float


def certainly_apart(one: Box, other: Box, reach: float) -> bool:
    """Whether two rectangles stay apart while they move by up to ``reach`` m towards one another.

    They do where they are apart along a side of either (the separating axis theorem); every other answer is False.
    """
    dx, dy = other.x - one.x, other.y - one.y
    turn = other.heading - one.heading
    cosine, sine = abs(math.cos(turn)), abs(math.sin(turn))
    for box, across in ((one, other), (other, one)):
        c, s = math.cos(box.heading), math.sin(box.heading)
        along_gap = abs(c * dx + s * dy) - (box.length + across.length * cosine + across.width * sine) / 2
        aside_gap = abs(c * dy - s * dx) - (box.width + across.length * sine + across.width * cosine) / 2
        if max(along_gap, aside_gap) > reach:
            return True
    return False
