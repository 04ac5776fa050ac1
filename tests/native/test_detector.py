"""The compiled detector says what the Python one says, of any row."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from grouser.native import Detector
from grouser.surrogate import BoxMahalanobisDetector, Surrogate
from grouser.terrain import FloatArray, Mode, TrackedVehicle, interface

M113 = TrackedVehicle.preset("m113")
MODES: tuple[Mode, ...] = ("rigid", "soil")


def compiled(detector: BoxMahalanobisDetector) -> Detector:
    return Detector(
        columns=len(detector.center),
        low=detector.low,
        high=detector.high,
        center=detector.center,
        whitening=detector.whitening,
        threshold=detector.threshold,
    )


SHIPPED = {mode: Surrogate.resolve(M113, mode, None).detector for mode in MODES}
COMPILED = {mode: compiled(detector) for mode, detector in SHIPPED.items()}


def assert_same(mode: Mode, row: FloatArray) -> None:
    with np.errstate(all="ignore"):
        expected = SHIPPED[mode].detect(row)
    score, reason, worst = COMPILED[mode].detect(row)
    assert reason == expected.reason
    if not math.isfinite(expected.score):
        np.testing.assert_equal(score, expected.score)
    else:
        assert score == pytest.approx(expected.score, rel=1e-12)
    assert interface(mode).names[worst] == expected.worst_column


@pytest.mark.parametrize("mode", MODES)
@given(data=st.data())
def test_any_row_gets_the_same_score_and_reason(mode: Mode, data: st.DataObject) -> None:
    size = interface(mode).size
    assert_same(mode, data.draw(arrays(np.float64, size, elements=st.floats(width=64))))


@pytest.mark.parametrize("mode", MODES)
@given(data=st.data())
def test_rows_in_and_around_the_box_get_the_same_score_and_reason(mode: Mode, data: st.DataObject) -> None:
    detector = SHIPPED[mode]
    share = data.draw(arrays(np.float64, interface(mode).size, elements=st.floats(-0.02, 1.02)))
    assert_same(mode, detector.low + share * (detector.high - detector.low))


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e308, -1e308, 1e200])
def test_every_column_can_be_the_worst(mode: Mode, value: float) -> None:
    for column in range(interface(mode).size):
        row = SHIPPED[mode].center.copy()
        row[column] = value
        assert_same(mode, row)


@pytest.mark.parametrize("mode", MODES)
def test_the_bounds_belong_to_the_box_and_rounding_to_float32_leaves_nothing_outside(mode: Mode) -> None:
    for bound in (SHIPPED[mode].low, SHIPPED[mode].high):
        for column in range(interface(mode).size):
            row = SHIPPED[mode].center.copy()
            row[column] = np.float32(bound[column])
            assert COMPILED[mode].detect(row)[1] != "box"


def test_a_distance_that_overflows_within_the_box_is_out_of_distribution() -> None:
    size = 10
    wide = BoxMahalanobisDetector(
        "rigid", np.full(size, -1e300), np.full(size, 1e300), np.zeros(size), 1e10 * np.eye(size), 1.0
    )
    row = np.full(size, 1e299)
    score, reason, _ = compiled(wide).detect(row)
    assert (score, reason) == (math.inf, "distance")
    with np.errstate(all="ignore"):
        assert wide.detect(row).score == score


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"columns": 0}, "columns"),
        ({"columns": 12}, "columns"),
        ({"threshold": 0.0}, "threshold"),
        ({"threshold": math.nan}, "threshold"),
        ({"low": np.zeros(9)}, "low"),
        ({"high": np.zeros(10, np.float32)}, "high"),
        ({"center": np.zeros(20)[::2]}, "center"),
        ({"whitening": np.eye(9)}, "whitening"),
    ],
)
def test_impossible_numbers_are_refused_by_name(changes: dict[str, object], named: str) -> None:
    good: dict[str, object] = {
        "columns": 10,
        "low": np.zeros(10),
        "high": np.ones(10),
        "center": np.zeros(10),
        "whitening": np.eye(10),
        "threshold": 1.0,
    }
    with pytest.raises(ValueError, match=named):
        Detector(**{**good, **changes})  # type: ignore[arg-type]


def test_a_row_of_another_size_is_refused() -> None:
    with pytest.raises(ValueError, match="row"):
        COMPILED["rigid"].detect(np.zeros(11))
