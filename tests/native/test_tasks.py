"""Paths and profiles in C, against their Python forms; what the compiled tasks refuse."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grouser.envs import MotionProfile, Path, make_path
from grouser.envs.path_task import PathTask
from grouser.envs.tracking_config import TrackingConfig
from grouser.native import Speed, Tracking
from grouser.terrain import TrackedVehicle

M113 = TrackedVehicle.preset("m113")
NAMES = ("straight", "circle", "sine", "figure-eight", "iso-3888-1")
PATHS = {name: make_path(name, M113) for name in NAMES}
TASKS = {name: PathTask(M113, "asphalt", TrackingConfig(), path).rules() for name, path in PATHS.items()}
AHEAD = np.array([0.4, 0.8, 1.2, 1.6, 2.0])

names = st.sampled_from(NAMES)
shares = st.floats(-1.5, 2.5)
offsets = st.floats(-4.0, 4.0)


class TestPath:
    @given(names, shares)
    def test_points_along_it(self, name: str, share: float) -> None:
        path = PATHS[name]
        s = share * path.length
        x, y, heading, curvature = TASKS[name].at(s)
        assert (x, y) == path.point_at(s)
        assert (heading, curvature) == (path.heading_at(s), path.curvature_at(s))
        sampled = [float(values) for values in path.sample(s)]
        assert (x, y, heading, curvature) == pytest.approx(sampled, rel=1e-12, abs=1e-12)

    @given(names, shares, offsets, offsets)
    def test_the_foot_near_a_former_one(self, name: str, share: float, along: float, aside: float) -> None:
        path = PATHS[name]
        near = share * path.length
        x, y = path.point_at(near + along)
        heading = path.heading_at(near + along)
        x, y = x - aside * math.sin(heading), y + aside * math.cos(heading)
        assert TASKS[name].project(x, y, near, 5.0) == tuple(path.project(x, y, near))

    @given(names, st.floats(-1e4, 1e4), st.floats(-1e4, 1e4), st.floats(-1e4, 1e4), st.floats(0.01, 1e3))
    def test_the_foot_of_far_positions(self, name: str, x: float, y: float, near: float, window: float) -> None:
        expected = PATHS[name].project(x, y, near, window=window)
        assert TASKS[name].project(x, y, near, window) == pytest.approx(tuple(expected), rel=1e-9, abs=1e-9)

    def test_a_path_of_two_points(self) -> None:
        path = Path("short", *np.array([[0.0, 1.0], [0.0, 0.0], [0.0, 1.0], [0.0, 0.0], [0.0, 0.0]]))
        task = PathTask(M113, "asphalt", TrackingConfig(), path).rules()
        assert task.project(0.5, 0.25, 0.0, 5.0) == tuple(path.project(0.5, 0.25, 0.0))


class TestProfile:
    @given(
        st.lists(st.tuples(st.floats(-5, 5), st.floats(-1, 1)), min_size=1, max_size=6),
        st.floats(0.5, 5.0),
        st.floats(0.1, 1.0),
        st.floats(0.0, 40.0),
    )
    def test_is_that_of_python(
        self, knots: list[tuple[float, float]], segment: float, share: float, time: float
    ) -> None:
        table = np.array(knots)
        profile = MotionProfile(table[:, 0], table[:, 1], segment, share * segment)
        assert profile.knots().tolist() == table.tolist()
        speed = make_speed(knots=len(knots), segment_time=segment, ramp_time=share * segment)
        assert speed.reference(np.ascontiguousarray(table.ravel()), time) == profile.at(time)


def make_speed(**changes: Any) -> Speed:
    settings: dict[str, Any] = {
        "knots": 3,
        "segment_time": 2.0,
        "ramp_time": 1.0,
        "speed_weight": 1.0,
        "yaw_rate_weight": 1.0,
        "speed_tolerance": 0.5,
        "yaw_rate_tolerance": 0.1,
        "look_ahead": AHEAD,
    }
    return Speed(**settings | changes)


def make_tracking(**changes: Any) -> Tracking:
    path = PATHS["straight"]
    nodes = [path.x, path.y, path.heading, path.curvature, np.cos(path.heading), np.sin(path.heading)]
    settings: dict[str, Any] = {
        "nodes": np.column_stack(nodes),
        "length": path.length,
        "closed": False,
        "reference_speed": 5.0,
        "control_period": 0.1,
        "maximum_cross_track": 5.0,
        "progress_weight": 1.0,
        "cross_track_weight": 1.0,
        "look_ahead": AHEAD,
    }
    return Tracking(**settings | changes)


class TestRefusals:
    @pytest.mark.parametrize("change", [{"knots": 0}, {"ramp_time": 0.0}, {"speed_tolerance": math.nan}])
    def test_of_the_speed_task(self, change: dict[str, Any]) -> None:
        with pytest.raises(ValueError, match="positive"):
            make_speed(**change)

    def test_of_a_profile(self) -> None:
        with pytest.raises(ValueError, match="profile"):
            make_speed().reference(np.zeros(4), 0.0)
        with pytest.raises(ValueError, match="not negative"):
            make_speed().reference(np.zeros(6), math.nan)

    @pytest.mark.parametrize("change", [{"length": 0.0}, {"reference_speed": math.inf}, {"maximum_cross_track": -1.0}])
    def test_of_the_path_tracking_task(self, change: dict[str, Any]) -> None:
        with pytest.raises(ValueError, match="positive"):
            make_tracking(**change)

    @pytest.mark.parametrize("nodes", [np.zeros((1, 6)), np.full((3, 6), math.nan)])
    def test_of_nodes(self, nodes: Any) -> None:
        with pytest.raises(ValueError, match="at least 2 nodes, and finite"):
            make_tracking(nodes=nodes)

    def test_of_numbers_that_are_not_finite(self) -> None:
        with pytest.raises(ValueError, match="finite"):
            make_tracking().project(math.nan, 0.0, 0.0, 5.0)
        with pytest.raises(ValueError, match="finite"):
            make_tracking().at(math.inf)
        with pytest.raises(ValueError, match="look_ahead"):
            make_tracking(look_ahead=AHEAD[:3])
