"""Foreign and damaged files, full disks and killed workers: a clear error, nothing lost, and the same call goes on."""

import errno
import json
import os
import shutil
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pytest
from pyarrow import parquet

from grouser.surrogate.offline.dataset import Dataset, load_dataset
from grouser.surrogate.offline.generate import DataConfig, generate_dataset
from grouser.surrogate.offline.training import train_surrogate
from grouser.surrogate.offline.training_config import TrainingConfig
from grouser.terrain import ArtifactError, InvalidInputError, WorkerLostError

Config = Callable[..., DataConfig]


class Interrupted(Exception):
    """Stands for Ctrl-C."""


def part(folder: Path, run: int) -> Path:
    return folder / "parts" / f"run-{run:06d}.parquet"


def unfinished(config: DataConfig, folder: Path, count: int) -> Path:
    """Drive some runs of a dataset."""

    def progress(done: int, runs: int) -> None:
        if done >= count:
            raise Interrupted

    with pytest.raises(Interrupted):
        generate_dataset(config, folder, progress=progress)
    return folder


# --- runs of another dataset, and damaged ones


@pytest.mark.parametrize(
    "change",
    [{"vehicle": "marder"}, {"mode": "soil"}, {"ranges": "paper"}, {"seed": 4}, {"integrator": "sdirk2"}],
    ids=str,
)
def test_a_run_of_another_dataset_is_named(
    data_config: Config, rigid: Dataset, tmp_path: Path, change: dict[str, Any]
) -> None:
    folder = unfinished(data_config(), tmp_path / "mixed", 3)
    other = unfinished(data_config(**change), tmp_path / "other", 2)
    shutil.copy(part(other, 1), part(folder, 1))
    with pytest.raises(ArtifactError, match=r"run-000001\.parquet is a run of another dataset.*remove it"):
        generate_dataset(data_config(), folder)
    assert len(list(folder.rglob("run-*.parquet"))) == 18
    part(folder, 1).unlink()
    assert generate_dataset(data_config(), folder) == rigid.manifest


def test_a_run_in_anothers_place_is_named(data_config: Config, tmp_path: Path) -> None:
    folder = unfinished(data_config(), tmp_path, 8)
    shutil.copy(part(folder, 0), part(folder, 6))
    with pytest.raises(ArtifactError, match=r"run-000006\.parquet holds run 0, not run 6"):
        generate_dataset(data_config(), folder)


@pytest.mark.parametrize("metadata", [{"run": "{"}, {"run": "[]"}, {"run": '{"run": 2}'}])
def test_a_run_without_a_whole_record_is_named(data_config: Config, tmp_path: Path, metadata: dict[str, str]) -> None:
    folder = unfinished(data_config(), tmp_path, 3)
    parquet.write_table(parquet.read_table(part(folder, 2)).replace_schema_metadata(metadata), part(folder, 2))
    with pytest.raises(ArtifactError, match=r"run-000002\.parquet"):
        generate_dataset(data_config(), folder)


def test_a_truncated_run_is_named(data_config: Config, tmp_path: Path) -> None:
    folder = unfinished(data_config(), tmp_path, 3)
    part(folder, 2).write_bytes(part(folder, 2).read_bytes()[:-50])
    with pytest.raises(ArtifactError, match=r"run-000002\.parquet is missing or not a whole Parquet file"):
        generate_dataset(data_config(), folder)


@pytest.mark.parametrize("name", ["samples.parquet", "runs.parquet", "dataset.json"])
def test_whatever_bytes_are_damaged_the_error_is_grousers(folders: dict[str, Path], tmp_path: Path, name: str) -> None:
    folder = Path(shutil.copytree(folders["rigid"], tmp_path / "copy"))
    content = (folder / name).read_bytes()
    generator = np.random.default_rng(0)
    for _ in range(60):
        damaged = bytearray(content)
        for at in generator.integers(0, len(damaged), 4):
            damaged[at] = generator.integers(0, 256)
        (folder / name).write_bytes(damaged)
        try:
            load_dataset(folder)
        except ArtifactError:
            continue


@pytest.mark.parametrize(
    "change",
    [{"samples_per_run": "40"}, {"runs": True}, {"tick": "fast"}, {"tick": 0}, {"vehicle": 3}, {"backend": "physics"}],
    ids=str,
)
def test_a_manifest_of_other_types_is_refused_as_such(
    folders: dict[str, Path], tmp_path: Path, change: dict[str, Any]
) -> None:
    folder = Path(shutil.copytree(folders["rigid"], tmp_path / "copy"))
    content = json.loads((folder / "dataset.json").read_text(encoding="utf-8"))
    (folder / "dataset.json").write_text(json.dumps(content | change), encoding="utf-8")
    with pytest.raises(ArtifactError, match="not a dataset manifest"):
        load_dataset(folder)


def test_samples_that_are_not_numbers_are_refused(folders: dict[str, Path], tmp_path: Path) -> None:
    folder = Path(shutil.copytree(folders["rigid"], tmp_path / "copy"))
    table = parquet.read_table(folder / "samples.parquet")
    words = pyarrow.array(["fast"] * table.num_rows)
    table = table.set_column(table.column_names.index("vx"), "vx", words)
    parquet.write_table(table, folder / "samples.parquet", row_group_size=40)
    with pytest.raises(ArtifactError, match="not numbers"):
        load_dataset(folder)


def test_a_run_table_without_runs_is_refused(folders: dict[str, Path], tmp_path: Path) -> None:
    folder = Path(shutil.copytree(folders["rigid"], tmp_path / "copy"))
    for name in ("samples.parquet", "runs.parquet"):
        table = parquet.read_table(folder / name).slice(0, 0)
        with parquet.ParquetWriter(folder / name, table.schema):
            pass
    with pytest.raises(ArtifactError, match=r"0 in runs\.parquet"):
        load_dataset(folder)


def test_a_maneuver_with_two_runs_cannot_be_trained_on(data_config: Config, tmp_path: Path) -> None:
    generate_dataset(data_config(runs=17, samples_per_run=2, transient=0.0), tmp_path / "small")
    with pytest.raises(InvalidInputError, match="'prbs' has 2 runs; train, validation and test need one each"):
        train_surrogate(load_dataset(tmp_path / "small"), TrainingConfig(), tmp_path / "x.safetensors")
    assert not (tmp_path / "x.safetensors").exists()


# --- a full disk


def full_disk() -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize("which", ["fourth run", "samples", "run table", "manifest"])
def test_a_full_disk_loses_nothing(
    data_config: Config, rigid: Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, which: str
) -> None:
    wanted = {"fourth run": "run-000003", "samples": "samples", "run table": "runs.parquet", "manifest": "dataset.json"}
    whole_table, whole_bytes, writer = parquet.write_table, Path.write_bytes, parquet.ParquetWriter.write_table

    def write_table(table: Any, where: Any, *arguments: Any, **options: Any) -> None:
        whole_table(table, where, *arguments, **options)
        if wanted[which] in Path(where).name:
            full_disk()

    def write_bytes(path: Path, data: bytes) -> int:
        if wanted[which] in path.name:
            full_disk()
        return whole_bytes(path, data)

    def write_group(self: Any, *arguments: Any, **options: Any) -> None:
        writer(self, *arguments, **options)
        if wanted[which] == "samples" and "samples" in str(self.where):
            full_disk()

    with monkeypatch.context() as patch:
        patch.setattr(parquet, "write_table", write_table)
        patch.setattr(Path, "write_bytes", write_bytes)
        patch.setattr(parquet.ParquetWriter, "write_table", write_group)
        with pytest.raises(OSError, match="No space left"):
            generate_dataset(data_config(), tmp_path)
    assert not list(tmp_path.rglob("*.part"))
    assert len(list(tmp_path.rglob("run-*.parquet"))) == (3 if which == "fourth run" else 18)
    seen: list[int] = []
    assert generate_dataset(data_config(), tmp_path, progress=lambda done, _: seen.append(done)) == rigid.manifest
    assert seen[0] == (3 if which == "fourth run" else 18)


# --- a killed worker


# joblib warns of the worker that it lost, and in a destructor of the tasks that it gave up.
@pytest.mark.filterwarnings("ignore::UserWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
def test_killed_workers_leave_a_dataset_that_goes_on(data_config: Config, rigid: Dataset, tmp_path: Path) -> None:
    from joblib.externals.loky import reusable_executor

    def kill_at_four(done: int, runs: int) -> None:
        if done == 4:
            for worker in list(reusable_executor._executor._processes):
                os.kill(worker, signal.SIGKILL)

    with pytest.raises(WorkerLostError, match="finished runs are kept, and the same command goes on"):
        generate_dataset(data_config(), tmp_path, workers=2, progress=kill_at_four)
    assert len(list(tmp_path.rglob("run-*.parquet"))) >= 4
    seen: list[int] = []
    again = generate_dataset(data_config(), tmp_path, workers=2, progress=lambda done, _: seen.append(done))
    assert again == rigid.manifest
    assert seen[0] >= 4
