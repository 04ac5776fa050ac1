"""The smallest study, from rows to picture."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.precision.accuracy import logged_rows
from benchmarks.precision.formats import FORMATS
from grouser.surrogate.offline import DataConfig, generate_dataset, load_dataset, split_runs
from grouser.terrain import OUTPUT_NAMES

ARTIFACT = "m113-soil-paper-recipe"


def test_rows_are_those_of_the_datasets_test_runs(tmp_path: Path) -> None:
    config = DataConfig(runs=18, samples_per_run=20)
    generate_dataset(config, tmp_path / "data")
    dataset = load_dataset(tmp_path / "data")
    test = dataset.select(split_runs(dataset.records).test)
    rows = logged_rows(config)
    np.testing.assert_array_equal(rows.inputs, test.inputs)
    np.testing.assert_array_equal(rows.forces, test.forces)


@pytest.mark.slow
def test_the_study_writes_its_results_and_its_picture(root: Path, tmp_path: Path) -> None:
    sizes = ["--runs", "18", "--samples", "20", "--rounds", "1", "--network", "64x64"]
    places = ["--output", str(tmp_path), "--kept", str(tmp_path / "kept")]
    script = str(root / "benchmarks" / "precision_study.py")
    done = subprocess.run(
        [sys.executable, "-P", script, "--artifact", ARTIFACT, *sizes, *places],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )
    assert done.returncode == 0, done.stderr
    results = json.loads((tmp_path / "results" / "precision.json").read_text(encoding="utf-8"))
    assert results["command"].startswith("python -P benchmarks/precision_study.py")
    assert set(results["accuracy"][ARTIFACT]) == set(FORMATS)
    for found in results["accuracy"][ARTIFACT].values():
        assert set(found["nrmse"]) == set(found["largest deviation"]) == set(OUTPUT_NAMES)
    assert max(results["accuracy"][ARTIFACT]["float32"]["largest deviation"].values()) == 0.0
    assert set(results["speed"]["ns"]) == {"64x64", f"128x4, {ARTIFACT}"}
    assert (tmp_path / "figures" / "precision.png").stat().st_size > 0
