"""The lane along a path: an inverse pair of coordinates, a curvature, and a file form that loses nothing."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from highway_env.road.lane import lane_from_config
from hypothesis import given
from hypothesis import strategies as st

from grouser.envs import Path, make_path
from grouser.envs.highway import SplineLane
from grouser.terrain import InvalidInputError, TrackedVehicle

WINDING = Path.from_points("winding", [(0, 0), (20, 4), (40, -6), (60, 8), (80, 8)], spacing=0.25)
LANE = SplineLane(WINDING, 6.0)


@given(st.floats(0.0, WINDING.length), st.floats(-3.0, 3.0))
def test_local_coordinates_invert_position(longitudinal: float, lateral: float) -> None:
    found = LANE.local_coordinates(LANE.position(longitudinal, lateral))
    assert found == pytest.approx((longitudinal, lateral), abs=1e-4)


@given(st.floats(1.0, WINDING.length - 1.0))
def test_heading_is_the_direction_of_the_centreline_and_curvature_its_slope(station: float) -> None:
    behind, ahead = LANE.position(station - 1e-3, 0.0), LANE.position(station + 1e-3, 0.0)
    direction = math.atan2(*(ahead - behind)[::-1])
    assert math.remainder(direction - LANE.heading_at(station), 2 * math.pi) == pytest.approx(0.0, abs=2e-4)
    stations = np.linspace(station - 1.0, station + 1.0, 201)
    turn = np.trapezoid([LANE.curvature_at(each) for each in stations], stations)
    assert LANE.heading_at(station + 1.0) - LANE.heading_at(station - 1.0) == pytest.approx(turn, abs=1e-3)


def test_curvature_has_no_jumps() -> None:
    stations = np.linspace(0.0, LANE.length, 4000)
    curvature = np.array([LANE.curvature_at(station) for station in stations])
    assert np.abs(np.diff(curvature)).max() < 0.02 * np.abs(curvature).max()


def test_is_the_controllers_path() -> None:
    foot = WINDING.project(30.0, 1.0)
    assert LANE.local_coordinates(np.array([30.0, 1.0])) == (foot.arc_length, foot.cross_track)
    assert LANE.length == WINDING.length


def test_width_and_road() -> None:
    assert LANE.width_at(10.0) == 6.0
    assert LANE.on_lane(LANE.position(10.0, 2.9))
    assert not LANE.on_lane(LANE.position(10.0, 3.1))


@pytest.mark.parametrize(
    "path", [WINDING, make_path("figure-eight", TrackedVehicle.preset("m113"))], ids=["open", "closed"]
)
def test_read_back_it_is_the_same_to_the_bit(path: Path) -> None:
    lane = SplineLane(path, 5.0, speed_limit=None, priority=2)
    written = json.loads(json.dumps(lane.to_config()))
    for read in (SplineLane.from_config(written["config"]), lane_from_config(written)):
        assert isinstance(read, SplineLane)
        assert read.to_config() == lane.to_config()
        assert read.local_coordinates([3.0, 1.0]) == lane.local_coordinates([3.0, 1.0])


def test_fields_that_are_no_path_are_refused() -> None:
    with pytest.raises(InvalidInputError, match="arc_length"):
        SplineLane({"x": [0.0, 1.0]})
    with pytest.raises(InvalidInputError, match="lane width"):
        SplineLane(WINDING, 0.0)
