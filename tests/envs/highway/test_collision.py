"""The quick answer "apart" against highway-env's own test of two polygons."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from highway_env import utils
from highway_env.vehicle.objects import Obstacle
from hypothesis import given
from hypothesis import strategies as st

from grouser.envs.highway.collision import Box, certainly_apart

lengths = st.floats(0.5, 12.0)
places = st.floats(-10.0, 10.0)
boxes = st.builds(Box, places, places, st.floats(-7.0, 7.0), lengths, lengths)


def polygon(box: Box) -> Any:
    obstacle = Obstacle(None, [box.x, box.y], box.heading)
    obstacle.LENGTH, obstacle.WIDTH = box.length, box.width
    return obstacle.polygon()


@given(boxes, boxes, st.floats(0.0, 2 * math.pi), st.floats(0.0, 3.0))
def test_apart_means_neither_now_nor_soon(one: Box, other: Box, direction: float, reach: float) -> None:
    moved = reach * np.array([math.cos(direction), math.sin(direction)])
    if certainly_apart(one, other, reach + 1e-9):
        meeting, will_meet, _ = utils.are_polygons_intersecting(polygon(one), polygon(other), moved, np.zeros(2))
        assert not meeting
        assert not will_meet


@given(boxes, boxes)
def test_without_motion_it_is_the_whole_truth(one: Box, other: Box) -> None:
    meeting, _, _ = utils.are_polygons_intersecting(polygon(one), polygon(other), np.zeros(2), np.zeros(2))
    if not meeting:
        assert certainly_apart(one, other, -1e-9)


def test_is_symmetric() -> None:
    one, other = Box(0.0, 0.0, 0.3, 5.0, 2.0), Box(4.0, 2.5, -1.0, 3.0, 1.0)
    for reach in np.linspace(0.0, 3.0, 31):
        assert certainly_apart(one, other, reach) == certainly_apart(other, one, reach)
