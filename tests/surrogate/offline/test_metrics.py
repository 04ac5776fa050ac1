"""Errors against their closed forms, and where R² has no meaning."""

import json
import math

import numpy as np
import pytest

from grouser.surrogate.offline.manifest import RunRecord
from grouser.surrogate.offline.metrics import force_metrics, metrics_to_dict, output_metrics, worst_runs
from grouser.terrain import OUTPUT_NAMES, InvalidInputError


def test_a_worked_example() -> None:
    metrics = output_metrics(np.array([1.0, 2.0, 3.0, 8.0]), np.array([1.0, 2.0, 3.0, 4.0]))
    assert metrics.rmse == pytest.approx(2.0)
    assert metrics.mae == pytest.approx(1.0)
    assert metrics.bias == pytest.approx(1.0)
    assert metrics.max_abs == 4.0
    # Σ error² = 16; Σ (truth − 2.5)² = 5.
    assert metrics.r2 == pytest.approx(1 - 16 / 5)
    # 95 % of the way from the first to the fourth: 0.85 of the way from 0 to 4.
    assert metrics.p95_abs == pytest.approx(3.4)


def test_textbook_definitions() -> None:
    generator = np.random.default_rng(0)
    truth, predicted = generator.normal(3, 2e4, 500), generator.normal(0, 2e4, 500)
    metrics = output_metrics(predicted, truth)
    errors = [p - t for p, t in zip(predicted.tolist(), truth.tolist(), strict=True)]
    mean = math.fsum(truth) / 500
    assert metrics.rmse == pytest.approx(math.sqrt(math.fsum(e * e for e in errors) / 500), rel=1e-12)
    assert metrics.mae == pytest.approx(math.fsum(map(abs, errors)) / 500, rel=1e-12)
    assert metrics.bias == pytest.approx(math.fsum(errors) / 500, rel=1e-9)
    r2 = 1 - math.fsum(e * e for e in errors) / math.fsum((t - mean) ** 2 for t in truth.tolist())
    assert metrics.r2 == pytest.approx(r2, rel=1e-12)
    assert metrics.max_abs == max(map(abs, errors))


def test_a_perfect_prediction_and_the_mean() -> None:
    truth = np.array([-2.0, 0.0, 5.0])
    assert output_metrics(truth, truth).r2 == 1.0
    assert output_metrics(np.full(3, 1.0), truth).r2 == pytest.approx(0.0)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e6])
def test_r2_has_no_scale(scale: float) -> None:
    generator = np.random.default_rng(1)
    truth, predicted = generator.normal(size=(2, 50))
    assert output_metrics(scale * predicted, scale * truth).r2 == pytest.approx(output_metrics(predicted, truth).r2)


@pytest.mark.parametrize(
    "truth",
    [
        pytest.param(np.zeros(20), id="zero"),
        pytest.param(np.full(20, 7e3), id="constant"),
        pytest.param(7e3 + 1e-9 * np.random.default_rng(0).normal(size=20), id="constant but for rounding"),
    ],
)
def test_a_constant_output_has_no_r2_but_errors(truth: np.ndarray) -> None:
    metrics = output_metrics(truth + 2.0, truth)
    assert metrics.r2 is None
    assert metrics.rmse == pytest.approx(2.0)
    assert json.dumps(metrics_to_dict({"qy": metrics}), allow_nan=False)


@pytest.mark.parametrize(
    "shapes", [((3,), (4,)), ((0,), (0,)), ((3, 1), (3, 1)), ((1,), (3,)), ((), ())], ids=lambda shapes: str(shapes)
)
def test_shapes_that_do_not_compare_are_refused(shapes: tuple[tuple[int, ...], tuple[int, ...]]) -> None:
    with pytest.raises(InvalidInputError):
        output_metrics(np.zeros(shapes[0]), np.zeros(shapes[1]))


def test_forces_are_compared_output_by_output() -> None:
    truth = np.random.default_rng(2).normal(size=(30, 3))
    predicted = truth + np.array([1.0, 2.0, 3.0])
    metrics = force_metrics(predicted, truth)
    assert tuple(metrics) == OUTPUT_NAMES
    assert [metrics[name].bias for name in OUTPUT_NAMES] == pytest.approx([1.0, 2.0, 3.0])
    assert metrics["qy"] == output_metrics(predicted[:, 1], truth[:, 1])


def test_worst_runs_come_worst_first() -> None:
    records = tuple(RunRecord(run, "turn" if run else "pivot", {}, {}, 4, 0) for run in range(5))
    run_index = np.repeat(np.arange(5), 4)
    truth = np.zeros((20, 3))
    predicted = np.zeros((20, 3))
    predicted[:, 2] = np.repeat([1.0, 5.0, 3.0, 5.0, 0.0], 4)
    predicted[4, 2] = 5.0
    predicted[:, :2] = 1e6 * run_index[:, None]  # only the yaw moment counts
    worst = worst_runs(predicted, truth, run_index, records, count=4)
    assert [error.run for error in worst] == [1, 3, 2, 0]  # of equals the first
    assert [error.mz_rmse for error in worst] == pytest.approx([5.0, 5.0, 3.0, 1.0])
    assert worst[3].maneuver == "pivot"
    assert worst[0].mz_max_abs == worst[0].mz_p95_abs == 5.0
    assert len(worst_runs(predicted, truth, run_index, records)) == 3
    assert len(worst_runs(predicted, truth, run_index, records, count=50)) == 5


def test_what_counts_as_noise_has_no_r2() -> None:
    truth = 1e-9 * np.sin(np.arange(50.0))
    predicted = np.full(50, 0.5)
    assert output_metrics(predicted, truth).r2 is not None
    assert output_metrics(predicted, truth, noise=1e-3).r2 is None
    assert output_metrics(predicted, truth, noise=1e-3).rmse == pytest.approx(0.5)
