"""What counts as noticed, and drives that are equal where the forces are."""

import numpy as np
import pytest

from benchmarks.precision.loop import (
    CROSS_TRACK,
    DIVIDED,
    FINISHED,
    MARGIN,
    POLICY,
    POSITION,
    POSITION_FROM_FLOAT32,
    contenders,
    drive,
    judged,
    paired,
)
from grouser.surrogate import Surrogate

STARTS = 5


def drives(positions: list[float], errors: list[float], finished: float = 1.0) -> dict[str, list[float]]:
    return {
        POSITION: positions,
        CROSS_TRACK: errors,
        POSITION_FROM_FLOAT32: positions,
        FINISHED: [finished] * STARTS,
        DIVIDED: [0.0] * STARTS,
    }


def study(positions: np.ndarray, errors: np.ndarray, finished: float = 1.0) -> dict[str, object]:
    """Judge a contender against a float32 that is 2 mm from physics in every drive."""
    return judged(
        {
            "physics": drives([0.0] * STARTS, [0.01] * STARTS),
            "float32": drives([0.002] * STARTS, [0.01] * STARTS),
            "other": drives(positions.tolist(), errors.tolist(), finished),
        }
    )["other"]


SPREAD = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
SAME = np.full(STARTS, 0.01)


def test_float32_does_not_deviate_from_itself() -> None:
    found = study(np.full(STARTS, 0.002), SAME)
    assert not found["noticed"]
    assert not found["beyond chance"]


def test_a_growth_within_its_interval_is_chance() -> None:
    found = study(0.003 + 0.002 * SPREAD, SAME)
    assert not found["beyond chance"]


def test_a_growth_beyond_chance_and_below_the_margin_is_not_noticed() -> None:
    found = study(0.002 + 0.5 * MARGIN + 1e-6 * SPREAD, SAME)
    assert found["beyond chance"]
    assert not found["noticed"]


@pytest.mark.parametrize("sign", [1, -1])
def test_cross_track_rmse_counts_as_much_as_position_and_either_way(sign: int) -> None:
    assert study(np.full(STARTS, 0.002), SAME + sign * 2 * MARGIN + 1e-5 * SPREAD)["noticed"]


def test_a_lost_drive_is_noticed() -> None:
    assert study(np.full(STARTS, 0.002), SAME, finished=0.0)["noticed"]


def test_the_interval_is_students() -> None:
    # 2.776 is the 97.5 % quantile of t with four degrees of freedom.
    found = paired(np.array([1.0, 2.0, 3.0, 4.0, 5.0]))
    assert found.mean == 3.0
    assert found.half_interval == pytest.approx(2.776 * np.sqrt(2.5) / np.sqrt(5), rel=1e-3)


@pytest.mark.slow
def test_drives_with_rounded_weights_keep_the_path(monkeypatch: pytest.MonkeyPatch) -> None:
    weights = {name: make for name, make in contenders().items() if "activations" not in name}
    monkeypatch.setattr("benchmarks.precision.loop.contenders", lambda: weights)
    driven = drive(Surrogate.load("m113-rigid"), POLICY, 2)
    assert list(driven) == ["physics", *weights]
    assert driven["float32"][POSITION_FROM_FLOAT32] == [0.0, 0.0]
    found = judged(driven)
    assert all(each["finished"] == 1.0 and each["from physics"][POSITION] < 0.01 for each in found.values())
