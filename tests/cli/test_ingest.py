"""From a logged drive to a dataset, and from two datasets to a surrogate."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from grouser.surrogate import Surrogate
from grouser.surrogate.offline.dataset import load_dataset, read_manifest


@pytest.fixture(scope="module")
def logs(call: Any, short_path: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("logs")
    files = [folder / f"at-{speed}.npz" for speed in (4, 5, 6)]
    for speed, file in zip((4, 5, 6), files, strict=True):
        call("drive", "--path", short_path, "--controller", "pure-pursuit", "--speed", speed, "--log", file)
    return files


@pytest.fixture(scope="module")
def visited(call: Any, logs: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ingested") / "visited"
    called = call("ingest", *logs, folder)
    assert read_manifest(folder).content_hash in called.out
    assert "3 visited runs" in called.out
    return folder


def test_the_rows_are_those_of_the_logs(visited: Path, logs: list[Path]) -> None:
    dataset = load_dataset(visited)
    np.testing.assert_array_equal(dataset.inputs, np.concatenate([np.load(file)["inputs"] for file in logs]))
    assert [record.excitation["origin"] for record in dataset.records] == [file.name for file in logs]
    assert {record.excitation["backend"] for record in dataset.records} == {"native"}


def test_train_joins_datasets_and_evaluate_knows(call: Any, dataset: Path, visited: Path, tmp_path: Path) -> None:
    file = tmp_path / "joined.safetensors"
    options = ["--hidden", "8", "--epochs", 1, "--space-filling-rows", 50]
    call("train", dataset, file, "--also", visited, *options)
    hashes = [read_manifest(folder).content_hash for folder in (dataset, visited)]
    assert Surrogate.load(file).dataset_hash == "+".join(hashes)
    assert Surrogate.load(file).recipe["space_filling_rows"] == 50
    assert "--split all" in call("evaluate", file, visited, code=2).err
    assert "training runs included" in " ".join(call("evaluate", file, visited, "--split", "all").out.split())


def test_files_that_are_no_logs_are_refused(call: Any, logs: list[Path], tmp_path: Path) -> None:
    text, other = tmp_path / "text.npz", tmp_path / "other.npz"
    text.write_text("no archive")
    np.savez(other, inputs=np.zeros((3, 10)))
    for file in (text, other):
        assert "is not a log of grouser drive --log" in call("ingest", file, tmp_path / "made", code=2).err
    assert "No such file" in call("ingest", tmp_path / "none.npz", tmp_path / "made", code=2).err
    assert "hold the same drive" in call("ingest", logs[0], logs[0], tmp_path / "made", code=2).err
    assert not (tmp_path / "made").exists()


def test_data_without_ray_names_the_extra(call: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    assert "pip install 'grouser[ray]'" in call("data", tmp_path / "made", "--engine", "ray", code=2).err
