"""The nearest obstacles as a vehicle sees them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, Final

import numpy as np

from ...terrain import FloatArray

#: Numbers that show one obstacle.
OBSTACLE_PARTS: Final = 3


def nearest_obstacles(
    obstacles: FloatArray, x: float, y: float, heading: float, *, count: int, scale: float
) -> list[float]:
    """Return the nearest obstacles in the body frame.

    Parameters
    ----------
    obstacles : ndarray, shape (n, 3)
        Position and radius in m.
    x, y, heading : float
        Of the vehicle, in m and rad.
    count : int
        How many are shown, nearest first.
    scale : float
        What stands for 1, in m.

    Returns
    -------
    list of float
        Forward and leftward distance of each one's centre and its radius, over the scale. Where there is none, or it is
        beyond the scale, (1, 0, 0): far ahead and of no size.
    """
    shown = [1.0, 0.0, 0.0] * count
    if not len(obstacles):
        return shown
    dx, dy = obstacles[:, 0] - x, obstacles[:, 1] - y
    distance = np.hypot(dx, dy)
    cosine, sine = math.cos(heading), math.sin(heading)
    for place, index in enumerate(np.argsort(distance, kind="stable")[:count].tolist()):
        if distance[index] > scale:
            break
        ahead, aside = cosine * dx[index] + sine * dy[index], cosine * dy[index] - sine * dx[index]
        radius = obstacles[index, 2]
        shown[OBSTACLE_PARTS * place : OBSTACLE_PARTS * (place + 1)] = [
            float(ahead) / scale,
            float(aside) / scale,
            float(radius) / scale,
        ]
    return shown


def obstacle_table(objects: Iterable[Any]) -> FloatArray:
    """Return position and radius in m of highway-env's objects, shape (n, 3)."""
    rows = [[*map(float, each.position), math.hypot(each.LENGTH, each.WIDTH) / 2] for each in objects]
    return np.array(rows).reshape(-1, 3)
