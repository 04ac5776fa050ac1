"""Paths: their geometry, where a vehicle stands on them, the lanes of ISO 3888-1, and paths from files."""

from __future__ import annotations

import math
import os
import pickle
from pathlib import Path as FilePath

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.interpolate import CubicSpline
from scipy.special import gamma

from grouser.envs import Corridor, Lane, Path
from grouser.envs.path_file import path_from_csv
from grouser.envs.paths import circle, figure_eight, iso_3888_1, make_path, path_names, sine, straight
from grouser.terrain import ConfigurationError, InvalidInputError, TrackedVehicle

M113 = TrackedVehicle.preset("m113")
PATHS = {name: make_path(name, M113) for name in path_names()}
every_path = pytest.mark.parametrize("path", PATHS.values(), ids=PATHS.keys())


class TestGeometry:
    @every_path
    def test_starts_at_the_origin_and_is_sampled_evenly_at_about_a_tenth_of_a_meter(self, path: Path) -> None:
        assert (path.x[0], path.y[0]) == pytest.approx((0.0, 0.0), abs=1e-12)
        assert np.diff(path.arc_length) == pytest.approx(0.1, rel=1e-3)
        assert np.hypot(np.diff(path.x), np.diff(path.y)) == pytest.approx(0.1, rel=1e-3)

    @every_path
    def test_heading_and_curvature_are_the_derivatives_of_the_points(self, path: Path) -> None:
        s = np.linspace(0.5, path.length - 0.5, 3001)
        x, y, heading, curvature = path.sample(s)
        assert np.gradient(x, s)[1:-1] == pytest.approx(np.cos(heading)[1:-1], abs=1e-4)
        assert np.gradient(y, s)[1:-1] == pytest.approx(np.sin(heading)[1:-1], abs=1e-4)
        assert np.gradient(heading, s)[1:-1] == pytest.approx(curvature[1:-1], abs=2e-4)

    @every_path
    def test_arrays_cannot_be_written(self, path: Path) -> None:
        with pytest.raises(ValueError, match="read-only"):
            path.x[0] = 1.0

    @pytest.mark.parametrize("radius", [5.0, 15.0, 40.0])
    def test_circle(self, radius: float) -> None:
        path = circle(radius)
        assert path.length == pytest.approx(2 * math.pi * radius, rel=1e-9)
        assert path.curvature == pytest.approx(1 / radius, rel=1e-4)
        assert np.hypot(path.x, path.y - radius) == pytest.approx(radius, rel=1e-9)
        assert path.heading[-1] - path.heading[0] == pytest.approx(2 * math.pi)
        assert path.closed

    def test_straight(self) -> None:
        path = straight(50.0)
        assert path.length == pytest.approx(50.0)
        assert not path.curvature.any()
        assert not path.y.any()

    def test_sine_has_the_length_of_its_integral_and_the_curvature_of_its_crest(self) -> None:
        path = sine(3.0, 40.0, 160.0)
        wave = 2 * math.pi / 40.0
        length, _ = quad(lambda x: math.hypot(1.0, 3.0 * wave * math.cos(wave * x)), 0.0, 160.0, limit=200)
        assert path.length == pytest.approx(length, rel=1e-7)
        assert np.abs(path.curvature).max() == pytest.approx(3.0 * wave**2, rel=1e-3)
        assert (path.x[-1], path.y[-1]) == pytest.approx((160.0, 0.0), abs=1e-9)

    def test_figure_eight_is_the_lemniscate(self) -> None:
        path = figure_eight(15.0)
        half_width = 45.0
        assert path.length == pytest.approx(half_width * gamma(0.25) ** 2 / math.sqrt(2 * math.pi), rel=1e-6)
        assert np.abs(path.curvature).max() == pytest.approx(1 / 15.0, rel=1e-3)
        # Foci at ±a/√2 along the axis, turned by 45°: the product of the distances to them is a²/2.
        focus = half_width / 2
        product = np.hypot(path.x - focus, path.y - focus) * np.hypot(path.x + focus, path.y + focus)
        assert product == pytest.approx(half_width**2 / 2, rel=1e-6)

    def test_figure_eight_starts_along_x_turns_left_and_crosses_itself_at_a_right_angle(self) -> None:
        path = figure_eight()
        assert path.heading[0] == pytest.approx(0.0, abs=1e-9)
        assert path.curvature_at(10.0) > 0 > path.curvature_at(path.length - 10.0)
        assert path.point_at(path.length / 2) == pytest.approx((0.0, 0.0), abs=1e-4)
        assert path.heading_at(path.length / 2) == pytest.approx(1.5 * math.pi, abs=1e-4)
        assert path.heading[-1] == pytest.approx(path.heading[0], abs=1e-9)

    @pytest.mark.parametrize("closed", [False, True])
    def test_passes_through_its_points_as_a_cubic_spline_does(self, closed: bool) -> None:
        points = np.array([[0.0, 0.0], [10.0, 2.0], [18.0, 9.0], [12.0, 20.0], [-3.0, 14.0]])
        path = Path.from_points("points", points, closed=closed, spacing=0.05)
        knots = np.vstack([points, points[:1]]) if closed else points
        chord = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(knots, axis=0).T))])
        spline = CubicSpline(chord, knots, bc_type="periodic" if closed else "natural")
        for x, y in spline(np.linspace(0.1, chord[-1] - 0.1, 57)):
            assert path.project(x, y).cross_track == pytest.approx(0.0, abs=1e-5)

    @pytest.mark.parametrize("make", [circle, figure_eight, straight])
    @pytest.mark.parametrize("value", [0.0, -1.0, math.nan])
    def test_an_impossible_size_is_refused(self, make: object, value: float) -> None:
        with pytest.raises(InvalidInputError, match=r"must lie in .*got"):
            make(value)  # type: ignore[operator]

    def test_survives_a_pickle(self) -> None:
        path = PATHS["iso-3888-1"]
        copy = pickle.loads(pickle.dumps(path))
        assert copy.project(30.0, 1.0) == path.project(30.0, 1.0)
        assert copy.corridor == path.corridor


class TestPointsAlongAPath:
    @every_path
    def test_one_point_and_many_agree(self, path: Path) -> None:
        s = np.linspace(-30.0, path.length + 30.0, 401)
        x, y, heading, curvature = path.sample(s)
        for i in range(len(s)):
            assert path.point_at(s[i]) == pytest.approx((x[i], y[i]), abs=1e-12)
            assert path.heading_at(s[i]) == pytest.approx(heading[i], abs=1e-12)
            assert path.curvature_at(s[i]) == pytest.approx(curvature[i], abs=1e-12)

    def test_samples_keep_the_shape_of_the_arc_lengths(self) -> None:
        assert all(values.shape == (2, 3) for values in straight().sample(np.ones((2, 3))))
        assert all(values.shape == () for values in circle().sample(1.0))

    def test_an_open_path_goes_on_straight_past_both_ends(self) -> None:
        path = sine()
        heading = math.atan(3.0 * 2 * math.pi / 40.0)
        end = np.array(path.point_at(path.length))
        assert path.point_at(path.length + 7.0) == pytest.approx(
            end + 7.0 * np.array([math.cos(heading), math.sin(heading)]), abs=1e-4
        )
        assert path.point_at(-2.0) == pytest.approx((-2.0 * math.cos(heading), -2.0 * math.sin(heading)), abs=1e-4)
        assert path.curvature_at(path.length + 7.0) == 0.0

    def test_a_closed_path_wraps_with_its_heading_unwrapped(self) -> None:
        path = circle(10.0)
        for laps in (-2, 1, 3):
            s = 5.0 + laps * path.length
            assert path.point_at(s) == pytest.approx(path.point_at(5.0))
            assert path.heading_at(s) == pytest.approx(path.heading_at(5.0) + laps * 2 * math.pi)


class TestProjection:
    @given(
        name=st.sampled_from(sorted(PATHS)),
        share=st.floats(0.001, 0.999),
        offset=st.floats(-5.0, 5.0),
        guess=st.floats(-2.0, 2.0),
    )
    @settings(deadline=None, max_examples=300)
    def test_a_point_beside_the_path_projects_back(self, name: str, share: float, offset: float, guess: float) -> None:
        path = PATHS[name]
        s = share * path.length
        (x, y), heading = path.point_at(s), path.heading_at(s)
        foot = path.project(x - offset * math.sin(heading), y + offset * math.cos(heading), near=s + guess)
        assert foot.cross_track == pytest.approx(offset, abs=1e-6)
        assert foot.arc_length == pytest.approx(s, abs=1e-6)
        assert foot.heading == pytest.approx(heading, abs=1e-6)
        assert foot.curvature == pytest.approx(path.curvature_at(s), abs=1e-6)
        assert (foot.x, foot.y) == pytest.approx((x, y), abs=1e-6)

    def test_left_of_the_path_is_positive(self) -> None:
        assert straight().project(3.0, 0.5).cross_track == pytest.approx(0.5)
        assert circle(15.0).project(0.0, 1.0).cross_track == pytest.approx(1.0)

    def test_moves_continuously_with_the_point(self) -> None:
        path = circle(15.0)
        angle = np.linspace(0.3, 0.4, 2001)
        for radius in (10.0, 15.0, 20.0):
            feet = [path.project(radius * math.sin(a), 15.0 - radius * math.cos(a)) for a in angle]
            assert np.array([foot.arc_length for foot in feet]) == pytest.approx(15.0 * angle, abs=1e-5)
            assert np.array([foot.cross_track for foot in feet]) == pytest.approx(15.0 - radius, abs=1e-6)

    def test_past_the_ends_of_an_open_path_the_tangent_counts(self) -> None:
        path = straight(20.0)
        for near in (None, 19.0, 26.0):
            foot = path.project(27.0, -1.5, near)
            assert (foot.arc_length, foot.cross_track, foot.x, foot.y) == pytest.approx((27.0, -1.5, 27.0, 0.0))
        assert path.project(-4.0, 1.0).arc_length == pytest.approx(-4.0)

    def test_near_keeps_to_the_branch_where_the_path_crosses_itself(self) -> None:
        path = figure_eight()
        other = path.length / 2
        # Just beside the crossing, on the first branch but nearer to the second.
        x, y = 0.1, 0.4
        assert path.project(x, y).arc_length == pytest.approx(other, abs=1.0)
        assert path.project(x, y, near=0.5).arc_length == pytest.approx(x, abs=0.01)
        assert path.project(x, y, near=0.5).cross_track == pytest.approx(y, abs=0.01)
        assert path.project(x, y, near=other).cross_track == pytest.approx(x, abs=0.01)

    def test_arc_length_counts_on_over_the_laps_of_a_closed_path(self) -> None:
        path = circle(15.0)
        near = 0.0
        for s in np.arange(0.0, 2.5 * path.length, 0.7):
            foot = path.project(*path.point_at(s), near=near)
            assert foot.arc_length == pytest.approx(s, abs=1e-6)
            assert foot.heading == pytest.approx(s / 15.0, abs=1e-5)
            near = foot.arc_length

    def test_without_near_a_closed_path_answers_on_its_first_lap(self) -> None:
        path = circle(15.0)
        for s in (-0.04, 0.0, 0.04, path.length - 0.04, 30.0 + 3 * path.length):
            foot = path.project(*path.point_at(s))
            assert 0.0 <= foot.arc_length < path.length
            assert foot.heading == pytest.approx(path.heading_at(foot.arc_length), abs=1e-9)

    def test_a_number_that_is_not_finite_is_refused(self) -> None:
        with pytest.raises(InvalidInputError, match="finite"):
            straight().project(math.nan, 0.0)


class TestDoubleLaneChange:
    """ISO 3888-1:2018, Table 1, for an M113 of w = 2.159 + 0.38 = 2.539 m overall width."""

    path = iso_3888_1(2.539)
    corridor = path.corridor or Corridor(())

    def test_lane_widths(self) -> None:
        assert [lane.width for lane in self.corridor.lanes] == pytest.approx([3.0429, 3.2968, 3.5507, 3.5507])

    def test_sections_follow_a_run_in_of_ten_meters(self) -> None:
        edges = [edge for lane in self.corridor.lanes for edge in (lane.start, lane.end)]
        assert edges == pytest.approx([10, 25, 55, 80, 105, 120, 120, 135])
        assert self.path.x[-1] == pytest.approx(145.0)

    def test_right_hand_boundaries_are_offset_by_three_and_a_half_meters_and_back(self) -> None:
        first = self.corridor.lanes[0].right
        assert [lane.right - first for lane in self.corridor.lanes] == pytest.approx([0.0, 3.5, 0.0, 0.0])

    def test_centrelines(self) -> None:
        centers = [lane.center for lane in self.corridor.lanes]
        assert centers == pytest.approx([0.0, 3.5 + 0.05 * 2.539, 0.1 * 2.539, 0.1 * 2.539], abs=1e-12)

    def test_reference_runs_along_the_lane_centres(self) -> None:
        for lane in self.corridor.lanes:
            inside = (self.path.x > lane.start) & (self.path.x < lane.end)
            assert self.path.y[inside] == pytest.approx(lane.center, abs=1e-4)

    def test_curvature_is_continuous_and_stays_within_that_of_the_smoothstep(self) -> None:
        # Largest second derivative of a quintic smoothstep of height h over length l: 10/√3 · h/l².
        bound = 10 / math.sqrt(3) * (3.5 - 0.05 * 2.539) / 25.0**2
        assert np.abs(self.path.curvature).max() == pytest.approx(bound, rel=0.02)
        # Its steepest curvature gradient is 60 h/l³ per meter.
        assert np.abs(np.diff(self.path.curvature)).max() < 0.1 * 60 * 3.63 / 25.0**3 * 1.1

    def test_lanes_widen_with_the_vehicle(self) -> None:
        path = make_path("iso-3888-1", TrackedVehicle.preset("marder"))
        assert path.corridor is not None
        assert path.corridor.lanes[0].width == pytest.approx(1.1 * 3.2 + 0.25)

    def test_a_vehicle_on_the_reference_stays_in_its_lanes(self) -> None:
        x, y, heading, _ = self.path.sample(self.path.arc_length)
        assert self.corridor.violations(x, y, heading, M113.contact_length, M113.overall_width).max() == 0.0


class TestCorridor:
    corridor = Corridor((Lane(0.0, 10.0, -1.0, 1.0), Lane(20.0, 30.0, 1.0, 4.0)))

    @pytest.mark.parametrize(
        ("x", "y", "heading", "expected"),
        [
            (5.0, 0.0, 0.0, 0.0),
            (5.0, 0.3, 0.0, 0.05),
            (5.0, -0.75, 0.0, 0.5),
            (15.0, 9.0, 0.0, 0.0),
            (25.0, 0.5, 0.0, 1.25),
            (25.0, 2.5, math.pi / 2, 0.0),
            (5.0, 0.0, math.pi / 2, 0.25),
            # Only the rear corners are still in the lane.
            (10.5, 0.5, 0.0, 0.25),
        ],
    )
    def test_largest_excess_of_a_corner(self, x: float, y: float, heading: float, expected: float) -> None:
        assert self.corridor.violation(x, y, heading, 2.5, 1.5) == pytest.approx(expected, abs=1e-12)

    def test_many_poses_at_once(self) -> None:
        many = self.corridor.violations([5.0, 15.0], [-0.75, 9.0], [0.0, 0.0], 2.0, 1.5)
        assert many == pytest.approx([0.5, 0.0])

    @pytest.mark.parametrize(
        "lanes",
        [
            (Lane(1.0, 1.0, 0.0, 1.0),),
            (Lane(0.0, 1.0, 1.0, 0.0),),
            (Lane(0.0, math.inf, 0.0, 1.0),),
            (Lane(0.0, 5.0, 0.0, 1.0), Lane(4.0, 9.0, 0.0, 1.0)),
        ],
    )
    def test_impossible_lanes_are_refused(self, lanes: tuple[Lane, ...]) -> None:
        with pytest.raises(InvalidInputError, match="lane"):
            Corridor(lanes)


class TestFromPoints:
    @pytest.mark.parametrize(
        ("points", "message"),
        [
            ([[0, 0], [1, 0]], r"shape \(n, 2\) with n >= 3, got \(2, 2\)"),
            ([[0, 0, 0], [1, 0, 0], [2, 0, 0]], r"got \(3, 3\)"),
            ([[0, 0], [1, math.inf], [2, 0]], "must be finite"),
            ([[0, 0], [1, 0], [1, 0], [2, 0]], "points 1 and 2 coincide"),
            ([[0, 0], [10, 0], [0, 1e-3]], "turn back on itself"),
            ([[0, 0], [1e6, 0], [2e6, 1]], "points in m, or a larger spacing"),
        ],
    )
    def test_impossible_points_are_refused(self, points: list[list[float]], message: str) -> None:
        with pytest.raises(InvalidInputError, match=message):
            Path.from_points("bad", points)

    def test_a_closed_path_does_not_repeat_its_first_point(self) -> None:
        with pytest.raises(InvalidInputError, match="points 3 and 0 coincide"):
            Path.from_points("bad", [[0, 0], [5, 0], [5, 5], [0, 0]], closed=True)

    def test_arrays_that_do_not_fit_are_refused(self) -> None:
        line = np.arange(3.0)
        with pytest.raises(InvalidInputError, match=r"heading must have shape"):
            Path("bad", line, line, line, np.zeros(2), line)
        with pytest.raises(InvalidInputError, match="equal steps"):
            Path("bad", line, line, np.array([0.0, 1.0, 3.0]), line, line)


class TestCsv:
    @staticmethod
    def write(folder: FilePath, text: str) -> FilePath:
        file = folder / "track.csv"
        file.write_text(text, encoding="utf-8")
        return file

    @pytest.mark.parametrize("header", ["", "x,y\n", '"x [m]", "y [m]"\n', "\ufeffx,y\n"])
    def test_with_or_without_a_header(self, tmp_path: FilePath, header: str) -> None:
        path = path_from_csv(self.write(tmp_path, header + "0,0\n10,0\n\n20, 0\n"))
        assert path.name == "track"
        assert path.length == pytest.approx(20.0)
        assert not path.closed

    def test_closed_where_the_last_point_repeats_the_first(self, tmp_path: FilePath) -> None:
        angle = np.linspace(0.0, 2 * math.pi, 37)
        rows = "".join(f"{10 * math.cos(a):.9f},{10 * math.sin(a):.9f}\n" for a in angle)
        path = path_from_csv(self.write(tmp_path, rows))
        assert path.closed
        assert path.length == pytest.approx(20 * math.pi, rel=1e-4)

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("x,y\n0,0\n1,0,5\n2,0\n", r"track\.csv, line 3: expected two columns, x and y in m, got 3"),
            ("x,y,z\n0,0,0\n", r"track\.csv, line 1: expected two columns, x and y in m, got 3"),
            ("0;0\n1;0\n2;0\n", r"track\.csv, line 1: expected two columns, x and y in m, got 1"),
            ("0,0\n1,abc\n2,0\n", r"track\.csv, line 2: y must be a number in m, got 'abc'"),
            ("0,left\n1,0\n2,0\n", r"track\.csv, line 1: y must be a number in m, got 'left'"),
            ("x,y\nx,y\n2,0\n", r"track\.csv, line 2: x must be a number in m, got 'x'"),
            ("0,0\n1,0\n", r"track\.csv, line 2: expected at least 3 points, but the file ends here with 2"),
            ("0,0\n1,0\n0,0\n", r"track\.csv, line 2: expected at least 3 points, .* with 2 apart from the repeated"),
            ("", r"track\.csv, line 1: expected at least 3 points, but the file holds none"),
            ("x,y\n0,0\n1,nan\n2,0\n", r"track\.csv, line 3: y must be finite, got 'nan'"),
            ("0,0\n-inf,0\n2,0\n", r"track\.csv, line 2: x must be finite, got '-inf'"),
            ("0,0\n1,0\n\n1,0\n2,0\n", r"track\.csv, line 4: .* coincides with the one on line 2"),
            ("0,0\n9,0\n0,0.001\n", r"track\.csv: a path must not turn back on itself"),
        ],
    )
    def test_each_fault_has_its_own_message(self, tmp_path: FilePath, text: str, message: str) -> None:
        with pytest.raises(InvalidInputError, match=message):
            path_from_csv(self.write(tmp_path, text))

    def test_a_file_that_cannot_be_read(self, tmp_path: FilePath) -> None:
        with pytest.raises(InvalidInputError, match=r"cannot read the path file .*missing\.csv: No such file"):
            path_from_csv(tmp_path / "missing.csv")
        (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x81")
        with pytest.raises(InvalidInputError, match=r"binary\.csv is not a text file"):
            path_from_csv(tmp_path / "binary.csv")


class TestMakePath:
    def test_names(self) -> None:
        assert path_names() == ("circle", "figure-eight", "iso-3888-1", "sine", "straight")
        assert all(make_path(name, M113).name == name for name in path_names())

    def test_unknown_name_comes_with_the_nearest(self) -> None:
        with pytest.raises(ConfigurationError, match=r"unknown path 'figure8'; did you mean 'figure-eight'"):
            make_path("figure8", M113)

    @pytest.mark.parametrize("kind", [str, FilePath])
    def test_a_file(self, tmp_path: FilePath, kind: type[str | FilePath]) -> None:
        file = TestCsv.write(tmp_path, "0,0\n10,0\n20,0\n")
        target: str | os.PathLike[str] = kind(file)
        assert make_path(target, M113).length == pytest.approx(20.0)


def test_a_heading_puts_a_vehicle_at_a_crossing_on_the_branch_that_it_drives() -> None:
    path = figure_eight(15.0)
    x, y = path.point_at(0.0)
    start = path.heading_at(0.0)
    for lateral in (-0.3, -0.05, 0.05, 0.3):
        aside = (x - lateral * math.sin(start), y + lateral * math.cos(start))
        foot = path.project(*aside, heading=start)
        assert min(foot.arc_length, path.length - foot.arc_length) < 1.0
        assert foot.cross_track == pytest.approx(lateral, abs=1e-3)


def test_a_heading_across_every_branch_is_passed_over() -> None:
    path = straight(50.0)
    assert path.project(20.0, 1.0, heading=math.pi / 2).arc_length == pytest.approx(20.0)


def test_following_positions_gives_arc_lengths_and_errors() -> None:
    path = straight(50.0)
    arc_length, cross_track = path.follow([(0.0, 0.1), (1.0, 0.2), (2.0, -0.3)])
    assert arc_length == pytest.approx([0.0, 1.0, 2.0])
    assert cross_track == pytest.approx([0.1, 0.2, -0.3])
