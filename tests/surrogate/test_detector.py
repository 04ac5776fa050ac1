import math
import pickle
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from grouser.surrogate import BoxMahalanobisDetector, Normalizer, conformal_threshold, run_scores
from grouser.terrain import (
    MODES,
    FloatArray,
    InvalidInputError,
    Mode,
    ParameterRanges,
    TrackedVehicle,
    interface,
    named,
    parameter_ranges,
    terrain_names,
)

Rows = Callable[..., tuple[Any, Any]]


@pytest.fixture(params=MODES)
def mode(request: pytest.FixtureRequest) -> Mode:
    return interface(request.param).mode


def _fitted(driving_rows: Rows, vehicle: TrackedVehicle, mode: Mode, **options: Any) -> BoxMahalanobisDetector:
    x, runs = driving_rows(vehicle, mode, runs=60)
    return BoxMahalanobisDetector.fit(x, runs, Normalizer.fit(x), parameter_ranges("wide", mode), vehicle, **options)


@pytest.fixture
def detector(driving_rows: Rows, m113: TrackedVehicle, mode: Mode) -> BoxMahalanobisDetector:
    return _fitted(driving_rows, m113, mode)


@pytest.fixture
def nominal(driving_rows: Rows, m113: TrackedVehicle, mode: Mode) -> FloatArray:
    rows: FloatArray = driving_rows(m113, mode, runs=20, seed=99)[0]
    return rows


def _calm_row(detector: BoxMahalanobisDetector) -> FloatArray:
    row = detector.center.copy()
    assert detector.detect(row).score == 0.0
    return row


def test_fresh_runs_of_the_same_kind_are_in_distribution(detector: BoxMahalanobisDetector, nominal: FloatArray) -> None:
    score = detector.score(nominal)
    assert score.shape == (len(nominal),)
    assert (score > 1).mean() < 0.01


def test_one_row_scores_as_it_does_among_many(detector: BoxMahalanobisDetector, nominal: FloatArray) -> None:
    rows = nominal[::50].copy()
    rows[1, 0], rows[2, 5], rows[3, 7], rows[4, 4] = np.nan, 1e3, -1.0, 1e300
    rows[5, 0] *= -1
    scores = [detector.detect(row).score for row in rows]
    np.testing.assert_allclose(detector.score(rows), scores, rtol=1e-12)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_every_column_that_is_not_finite_is_named(detector: BoxMahalanobisDetector, bad: float) -> None:
    for column, name in enumerate(interface(detector.mode).names):
        row = _calm_row(detector)
        row[column] = bad
        detection = detector.detect(row)
        assert (detection.reason, detection.worst_column, detection.score) == ("finite", name, math.inf)
        assert detector.score(row[None])[0] == math.inf


def test_every_terrain_parameter_outside_its_range_is_flagged(detector: BoxMahalanobisDetector) -> None:
    table, ranges = interface(detector.mode), parameter_ranges("wide", detector.mode)
    for name, low, high in zip(table.parameter_names, ranges.low, ranges.high, strict=True):
        for value in (low - 0.01 * (high - low), high + 0.01 * (high - low)):
            row = _calm_row(detector)
            row[table.index(name)] = value
            detection = detector.detect(row)
            assert (detection.reason, detection.worst_column) == ("box", name)
            assert detection.score > 1


def test_every_motion_column_outside_its_envelope_is_flagged(detector: BoxMahalanobisDetector) -> None:
    for column in range(7):
        for edge, way in ((detector.low, -1.0), (detector.high, 1.0)):
            row = _calm_row(detector)
            row[column] = edge[column] + way * 0.01
            detection = detector.detect(row)
            assert detection.reason == "box"
            assert detection.worst_column == interface(detector.mode).names[column]


def test_an_impossible_belt_speed_is_flagged(detector: BoxMahalanobisDetector, nominal: FloatArray) -> None:
    row = nominal[0].copy()
    row[interface(detector.mode).index("v_left")] = 10.5
    detection = detector.detect(row)
    assert (detection.reason, detection.worst_column) == ("box", "v_left")


def test_the_box_score_is_one_and_the_relative_excess(detector: BoxMahalanobisDetector) -> None:
    detector = replace(detector, threshold=1e6)
    row = _calm_row(detector)
    row[5] = 12.5
    assert detector.detect(row).score == pytest.approx(1 + 2.5 / 10, rel=1e-12)


def test_broken_correlations_inside_the_box_are_flagged(detector: BoxMahalanobisDetector, nominal: FloatArray) -> None:
    shuffled = nominal.copy()
    generator = np.random.default_rng(0)
    for column in range(nominal.shape[1]):
        shuffled[:, column] = generator.permutation(shuffled[:, column])
    assert (shuffled >= detector.low).all()
    assert (shuffled <= detector.high).all()
    good, bad = detector.score(nominal), detector.score(shuffled)
    ranks = np.searchsorted(np.sort(good), bad) / len(good)
    assert ranks.mean() > 0.99
    worst = detector.detect(shuffled[bad.argmax()])
    assert worst.reason == "distance"
    assert worst.worst_column in interface(detector.mode).names[:7]


def test_belts_against_the_motion_are_flagged(detector: BoxMahalanobisDetector) -> None:
    row = _calm_row(detector)
    row[[0, 5, 6]] = 6.0, -6.0, -6.0
    assert detector.detect(row).reason == "distance"


def test_every_named_ground_lies_inside_the_wide_box(detector: BoxMahalanobisDetector) -> None:
    for name in terrain_names():
        terrain = named(name)
        if terrain.mode == detector.mode:
            row = np.concatenate([detector.center[:7], terrain.parameters])
            assert detector.detect(row).reason == "none", name


def test_the_edges_of_the_box_lie_inside_even_in_float32(detector: BoxMahalanobisDetector) -> None:
    detector = replace(detector, threshold=1e6)
    for edge in (detector.low, detector.high):
        assert detector.detect(edge).reason == "none"
        rounded = edge.astype(np.float32).astype(np.float64)
        assert detector.detect(rounded).reason == "none"
        assert (detector.score(rounded[None]) <= 1).all()


def test_the_score_does_not_tell_left_from_right(detector: BoxMahalanobisDetector, nominal: FloatArray) -> None:
    mirrored = interface(detector.mode).mirror(nominal)
    np.testing.assert_allclose(detector.score(mirrored), detector.score(nominal), rtol=1e-9)


def test_the_box_is_declared_from_vehicle_ranges_and_envelope(
    driving_rows: Rows, m113: TrackedVehicle, mode: Mode
) -> None:
    x, runs = driving_rows(m113, mode)
    ranges = parameter_ranges("wide", mode)
    fit = BoxMahalanobisDetector.fit(x, runs, Normalizer.fit(x), ranges, m113, calibration=(x, runs))
    envelope = 1.5 * abs(x).max(axis=0)[1:5]
    np.testing.assert_allclose(fit.high, [11.0, *envelope, 10.0, 10.0, *ranges.high])
    np.testing.assert_allclose(fit.low, [-11.0, *-envelope, -10.0, -10.0, *ranges.low])


def test_one_run_fits_a_finite_distance(driving_rows: Rows, m113: TrackedVehicle, mode: Mode) -> None:
    x, runs = driving_rows(m113, mode, runs=2)
    fit = BoxMahalanobisDetector.fit(x, runs, Normalizer.fit(x), parameter_ranges("wide", mode), m113)
    assert np.linalg.cond(fit.whitening * Normalizer.fit(x).scale) < 1e4
    assert (fit.calibration_runs, fit.rank_attained) == (1, False)


def test_a_range_without_width_is_held_to_its_value(driving_rows: Rows, m113: TrackedVehicle) -> None:
    x, runs = driving_rows(m113, "rigid")
    x[:, 7:] = 0.5, 0.0, 0.02
    ranges = ParameterRanges("rigid", (0.5, 0.0, 0.02), (0.5, 0.0, 0.02))
    fit = BoxMahalanobisDetector.fit(x, runs, Normalizer.fit(x), ranges, m113)
    row = _calm_row(fit)
    row[7] = 0.51
    assert fit.detect(row).reason == "box"


def test_the_threshold_is_the_conformal_rank_of_run_scores(
    driving_rows: Rows, m113: TrackedVehicle, mode: Mode
) -> None:
    x, runs = driving_rows(m113, mode)
    calibration = driving_rows(m113, mode, runs=39, seed=5)
    ranges = parameter_ranges("wide", mode)
    fit = BoxMahalanobisDetector.fit(x, runs, Normalizer.fit(x), ranges, m113, 0.1, calibration=calibration)
    distance = fit.distance(calibration[0]).reshape(39, 100)
    # 100 samples a run: the one with a single sample above it; 40 · 0.9: the 36th of 39.
    expected = np.sort(np.sort(distance, axis=1)[:, -2])[35]
    assert fit.threshold == expected
    assert (fit.alpha, fit.calibration_runs, fit.rank_attained) == (0.1, 39, True)
    flagged = (distance > fit.threshold).mean(axis=1)
    assert (flagged > 0.01).sum() == 3


def test_calibrated_keeps_everything_but_the_threshold(detector: BoxMahalanobisDetector, nominal: FloatArray) -> None:
    again = detector.calibrated(nominal, np.repeat(np.arange(20), 100), 0.2)
    np.testing.assert_array_equal(again.whitening, detector.whitening)
    assert (again.alpha, again.calibration_runs) == (0.2, 20)


@pytest.mark.parametrize(
    ("count", "alpha", "rank", "attained"),
    [(45, 0.05, 44, True), (19, 0.05, 19, True), (18, 0.05, 18, False), (59, 0.05, 57, True), (9, 0.1, 9, True),
     (99, 0.01, 99, True), (1, 0.5, 1, True), (1, 0.05, 1, False)],
)  # fmt: skip
def test_conformal_ranks(count: int, alpha: float, rank: int, attained: bool) -> None:
    scores = np.random.default_rng(0).permutation(np.arange(1.0, count + 1))
    assert conformal_threshold(scores, alpha) == (float(rank), attained)


@pytest.mark.parametrize("alpha", [0.0, 1.0, -0.1, math.nan])
def test_alpha_must_lie_between_0_and_1(alpha: float) -> None:
    with pytest.raises(InvalidInputError, match=r"alpha must lie in \(0, 1\)"):
        conformal_threshold(np.ones(3), alpha)


@pytest.mark.parametrize("scores", [[], [1.0, math.nan], [[1.0]]])
def test_conformal_threshold_refuses_bad_scores(scores: list[Any]) -> None:
    with pytest.raises(InvalidInputError, match="finite run scores"):
        conformal_threshold(np.array(scores), 0.05)


def test_a_run_beyond_its_score_has_more_than_one_percent_flagged() -> None:
    generator = np.random.default_rng(0)
    for count in (1, 7, 99, 100, 101, 3801):
        distance = generator.normal(size=count)
        score = run_scores(distance, np.zeros(count, dtype=int))[0]
        assert (distance > score).mean() <= 0.01
        below = np.nextafter(score, -np.inf)
        assert (distance > below).sum() >= 1


def test_pickling_keeps_the_scores(detector: BoxMahalanobisDetector, nominal: FloatArray) -> None:
    again = pickle.loads(pickle.dumps(detector))
    np.testing.assert_array_equal(again.score(nominal), detector.score(nominal))
    assert again.detect(nominal[0]) == detector.detect(nominal[0])


def test_huge_finite_rows_are_flagged_without_a_warning(detector: BoxMahalanobisDetector) -> None:
    row = np.full(len(detector.center), 1e308)
    assert detector.detect(row).reason == "box"
    assert detector.score(row[None])[0] > 1


@pytest.mark.parametrize("shape", [(9,), (12,), (1, 10), ()])
def test_detect_takes_one_row(driving_rows: Rows, m113: TrackedVehicle, shape: tuple[int, ...]) -> None:
    with pytest.raises(InvalidInputError, match=r"a row of shape \(10,\)"):
        _fitted(driving_rows, m113, "rigid").detect(np.zeros(shape))


def test_score_takes_rows_of_its_mode(driving_rows: Rows, m113: TrackedVehicle) -> None:
    with pytest.raises(InvalidInputError, match="rows of 10 columns"):
        _fitted(driving_rows, m113, "rigid").score(np.zeros((4, 11)))


def test_fit_refuses_values_that_are_not_finite(driving_rows: Rows, m113: TrackedVehicle) -> None:
    x, runs = driving_rows(m113, "rigid")
    normalizer = Normalizer.fit(x)
    x[3, 2] = np.nan
    with pytest.raises(InvalidInputError, match="yaw_rate"):
        BoxMahalanobisDetector.fit(x, runs, normalizer, parameter_ranges("wide", "rigid"), m113)


def test_fit_needs_a_run_for_each_row(driving_rows: Rows, m113: TrackedVehicle) -> None:
    x, runs = driving_rows(m113, "rigid")
    with pytest.raises(InvalidInputError, match="run index for each"):
        BoxMahalanobisDetector.fit(x, runs[:-1], Normalizer.fit(x), parameter_ranges("wide", "rigid"), m113)


def test_fit_needs_two_runs(driving_rows: Rows, m113: TrackedVehicle) -> None:
    x, runs = driving_rows(m113, "rigid", runs=1)
    with pytest.raises(InvalidInputError, match="at least 2 runs"):
        BoxMahalanobisDetector.fit(x, runs, Normalizer.fit(x), parameter_ranges("wide", "rigid"), m113)


def test_fit_needs_a_normalizer_of_the_interface(driving_rows: Rows, m113: TrackedVehicle) -> None:
    x, runs = driving_rows(m113, "rigid")
    with pytest.raises(InvalidInputError, match="9 columns, the interface 10"):
        BoxMahalanobisDetector.fit(x, runs, Normalizer.fit(x[:, :9]), parameter_ranges("wide", "rigid"), m113)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"low": np.zeros(9)}, "low is finite, of shape"),
        ({"center": np.full(10, np.nan)}, "center is finite"),
        ({"whitening": np.zeros((10, 9))}, "whitening is finite"),
        ({"low": np.full(10, 1e9)}, "nowhere exceed"),
        ({"threshold": 0.0}, "threshold must be positive"),
        ({"threshold": math.nan}, "threshold must be positive"),
    ],
)
def test_impossible_detectors(driving_rows: Rows, m113: TrackedVehicle, change: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        replace(_fitted(driving_rows, m113, "rigid"), **change)
