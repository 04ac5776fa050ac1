"""Judging predictions on unseen runs: in all, by maneuver, in the tail and at the worst run."""

from pathlib import Path

import numpy as np
import pytest

from grouser.surrogate.offline import DataConfig, Dataset, generate_dataset, load_dataset
from grouser.surrogate.offline.judgement import judge


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    folder: Path = tmp_path_factory.mktemp("data") / "runs"
    generate_dataset(DataConfig(runs=6, samples_per_run=60, transient=0.5), folder)
    return load_dataset(folder)


def test_a_perfect_prediction_explains_everything(runs: Dataset) -> None:
    judged = judge(runs.forces, runs)
    assert {metrics["r2"] for metrics in judged["test"].values()} == {1.0}
    assert judged["mz_tail_share"] == 0.0
    assert set(judged["maneuvers"]) == {record.maneuver for record in runs.records}
    assert judged["maneuvers"]["straight"]["mz"] is None  # no yaw moment to explain


def test_an_error_is_found_where_it_was_made(runs: Dataset) -> None:
    spoilt = runs.records[3]
    predicted = runs.forces.copy()
    rows = runs.run_index == spoilt.run
    predicted[rows, 2] += 500.0
    judged = judge(predicted, runs)
    assert judged["worst_run"]["run"] == spoilt.run
    assert judged["worst_run"]["mz_rmse"] == pytest.approx(500.0, rel=1e-12)
    spread = np.ptp(runs.forces[:, 2])
    assert judged["mz_tail_share"] == pytest.approx(500.0 / spread, rel=1e-12)
    assert judged["maneuvers"][spoilt.maneuver]["mz"] < 1.0
    untouched = {record.maneuver for record in runs.records} - {spoilt.maneuver, "straight"}
    assert {judged["maneuvers"][name]["mz"] for name in untouched} == {1.0}
