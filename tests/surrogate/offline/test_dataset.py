"""What is on disk, and that whatever was done to it afterwards is seen."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pytest
from pyarrow import parquet

from grouser.surrogate.offline.dataset import Dataset, hash_dataset, load_dataset, read_manifest, write_dataset
from grouser.surrogate.offline.generate import DataConfig
from grouser.surrogate.offline.maneuvers import MANEUVERS
from grouser.surrogate.offline.manifest import Manifest
from grouser.surrogate.offline.run_file import Run, read_run, write_run
from grouser.terrain import OUTPUT_NAMES, ArtifactError, TrackedVehicle, interface, parameter_ranges

RUNS, SAMPLES = 18, 40


def runs_of(dataset: Dataset) -> list[Run]:
    return [
        Run(record, dataset.inputs[dataset.run_index == record.run], dataset.forces[dataset.run_index == record.run])
        for record in dataset.records
    ]


def edit_manifest(folder: Path, change: Callable[[dict[str, Any]], object]) -> None:
    path = folder / "dataset.json"
    content = json.loads(path.read_text(encoding="utf-8"))
    change(content)
    path.write_text(json.dumps(content), encoding="utf-8")


def edit_samples(folder: Path, change: Callable[[list[Any]], list[Any]]) -> None:
    path = folder / "samples.parquet"
    source = parquet.ParquetFile(path)
    groups = change([source.read_row_group(i) for i in range(source.num_row_groups)])
    source.close()
    with parquet.ParquetWriter(path, groups[0].schema) as writer:
        for group in groups:
            writer.write_table(group, row_group_size=group.num_rows)


def edit_runs(folder: Path, change: Callable[[list[dict[str, Any]]], object]) -> None:
    path = folder / "runs.parquet"
    rows = parquet.read_table(path).to_pylist()
    change(rows)
    parquet.write_table(pyarrow.Table.from_pylist(rows), path)


def nudge(column: str, row: int = 7) -> Callable[[list[Any]], list[Any]]:
    """Move one sample of the third run by the least that float64 can."""

    def change(groups: list[Any]) -> list[Any]:
        values = np.array(groups[2].column(column)).copy()
        values[row] = np.nextafter(values[row], np.inf)
        groups[2] = groups[2].set_column(groups[2].column_names.index(column), column, pyarrow.array(values))
        return groups

    return change


@pytest.fixture
def copy(folders: dict[str, Path], tmp_path: Path) -> Path:
    """A copy of the rigid dataset to damage."""
    return Path(shutil.copytree(folders["rigid"], tmp_path / "copy"))


@pytest.mark.parametrize("mode", ["rigid", "soil"])
def test_files_and_nothing_else(folders: dict[str, Path], mode: str) -> None:
    assert sorted(path.name for path in folders[mode].iterdir()) == ["dataset.json", "runs.parquet", "samples.parquet"]


@pytest.mark.parametrize("mode", ["rigid", "soil"])
def test_one_row_group_a_run_with_the_interface_in_order(folders: dict[str, Path], mode: str) -> None:
    file = parquet.ParquetFile(folders[mode] / "samples.parquet")
    assert file.num_row_groups == RUNS
    expected = [*interface(mode).names, *OUTPUT_NAMES]
    assert [name for name in file.schema_arrow.names if name != "run"] == expected
    assert {file.schema_arrow.field(name).type for name in expected} == {pyarrow.float64()}
    for run in range(RUNS):
        group = file.read_row_group(run)
        assert group.num_rows == SAMPLES
        assert set(group.column("run").to_pylist()) == {run}


@pytest.mark.parametrize("mode", ["rigid", "soil"])
def test_the_run_table_says_where_and_how_each_run_was_driven(folders: dict[str, Path], mode: str) -> None:
    table = parquet.read_table(folders[mode] / "runs.parquet")
    assert {"run", "maneuver", "terrain", "excitation", "samples"} <= set(table.column_names)
    assert table.column("run").to_pylist() == list(range(RUNS))
    records = load_dataset(folders[mode]).records
    assert [record.maneuver for record in records] == [MANEUVERS[run % 6] for run in range(RUNS)]
    ranges = parameter_ranges("wide", mode)
    for record in records:
        assert set(record.terrain) == set(ranges.interface.parameter_names)
        theta = [record.terrain[name] for name in ranges.interface.parameter_names]
        assert np.all(np.less_equal(ranges.low, theta))
        assert np.all(np.less_equal(theta, ranges.high))
        assert record.excitation
        assert record.samples == SAMPLES
    assert len({tuple(record.terrain.values()) for record in records}) == RUNS


@pytest.mark.parametrize("mode", ["rigid", "soil"])
def test_the_manifest_names_the_recipe(folders: dict[str, Path], mode: str) -> None:
    content = json.loads((folders[mode] / "dataset.json").read_text(encoding="utf-8"))
    assert TrackedVehicle.from_dict(content["vehicle"]) == TrackedVehicle.preset("m113")
    assert (content["mode"], content["ranges"], content["integrator"]) == (mode, "wide", "implicit")
    assert (content["tick"], content["transient"], content["seed"]) == (0.01, 0.5, 3)
    assert (content["runs"], content["samples_per_run"], content["format_version"]) == (RUNS, SAMPLES, 1)
    assert content["backend"]["backend"] == "physics"
    assert content["backend"]["cells"] == [16, 4]
    assert len(content["content_hash"]) == 64
    assert int(content["content_hash"], 16)


def test_loaded_rows_are_the_written_ones(dataset: Dataset) -> None:
    assert dataset.inputs.shape == (RUNS * SAMPLES, dataset.interface.size)
    assert dataset.forces.shape == (RUNS * SAMPLES, 3)
    assert dataset.inputs.dtype == dataset.forces.dtype == np.float64
    np.testing.assert_array_equal(dataset.run_index, np.repeat(np.arange(RUNS), SAMPLES))
    assert dataset.vehicle == TrackedVehicle.preset("m113")
    assert hash_dataset(dataset.manifest, runs_of(dataset)) == dataset.manifest.content_hash
    for record in dataset.records:
        rows = dataset.inputs[dataset.run_index == record.run][:, 7:]
        theta = [record.terrain[name] for name in dataset.interface.parameter_names]
        np.testing.assert_array_equal(rows, np.tile(theta, (SAMPLES, 1)))


def test_select_keeps_some_runs_in_run_order(rigid: Dataset) -> None:
    some = rigid.select([11, 2, 2, 5])
    assert [record.run for record in some.records] == [2, 5, 11]
    np.testing.assert_array_equal(np.unique(some.run_index), [2, 5, 11])
    np.testing.assert_array_equal(some.inputs[:SAMPLES], rigid.inputs[rigid.run_index == 2])
    np.testing.assert_array_equal(some.forces[-SAMPLES:], rigid.forces[rigid.run_index == 11])
    assert some.manifest == rigid.manifest


def test_the_hash_sees_every_bit_and_the_order(rigid: Dataset) -> None:
    runs = runs_of(rigid)
    whole = hash_dataset(rigid.manifest, runs)
    inputs, forces = runs[3].inputs.copy(), runs[3].forces.copy()
    inputs[4, 5] = np.nextafter(inputs[4, 5], np.inf)
    forces[0, 2] = np.nextafter(forces[0, 2], np.inf)
    record = runs[3].record
    changed = [Run(record, inputs, runs[3].forces), Run(record, runs[3].inputs, forces)]
    hashes = {hash_dataset(rigid.manifest, [*runs[:3], run, *runs[4:]]) for run in changed}
    hashes |= {whole, hash_dataset(rigid.manifest, runs[::-1]), hash_dataset(rigid.manifest, runs[:-1])}
    assert len(hashes) == 5


def test_a_run_file_comes_back_as_it_was(dataset: Dataset, tmp_path: Path) -> None:
    run = runs_of(dataset)[4]
    write_run(tmp_path / "run.parquet", run)
    assert [path.name for path in tmp_path.iterdir()] == ["run.parquet"]
    again = read_run(tmp_path / "run.parquet", dataset.manifest.mode)
    assert again.record == run.record
    np.testing.assert_array_equal(again.inputs, run.inputs)
    np.testing.assert_array_equal(again.forces, run.forces)
    assert parquet.ParquetFile(tmp_path / "run.parquet").num_row_groups == 1


def test_run_files_assemble_to_the_same_dataset(dataset: Dataset, tmp_path: Path) -> None:
    paths = []
    for run in runs_of(dataset):
        paths.append(tmp_path / f"{run.record.run}.parquet")
        write_run(paths[-1], run)
    (tmp_path / "whole").mkdir()
    manifest = write_dataset(tmp_path / "whole", dataset.manifest, paths)
    assert manifest == dataset.manifest
    np.testing.assert_array_equal(load_dataset(tmp_path / "whole").forces, dataset.forces)


def test_a_file_without_a_record_is_no_run(folders: dict[str, Path], tmp_path: Path) -> None:
    with pytest.raises(ArtifactError, match="run record"):
        read_run(folders["rigid"] / "samples.parquet", "rigid")
    with pytest.raises(ArtifactError, match="missing"):
        read_run(tmp_path / "none.parquet", "rigid")


@pytest.mark.parametrize("column", ["vx", "k", "mz"])
def test_an_edited_sample_is_seen(copy: Path, column: str) -> None:
    load_dataset(copy)
    edit_samples(copy, nudge(column))
    with pytest.raises(ArtifactError, match="content hash"):
        load_dataset(copy)


def test_rewriting_the_same_samples_is_no_edit(copy: Path, rigid: Dataset) -> None:
    edit_samples(copy, lambda groups: groups)
    np.testing.assert_array_equal(load_dataset(copy).inputs, rigid.inputs)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        pytest.param(lambda groups: [groups[1], groups[0], *groups[2:]], "content hash", id="swapped"),
        pytest.param(lambda groups: groups[:-1], "row groups", id="dropped"),
        pytest.param(lambda groups: [*groups, groups[-1]], "row groups", id="repeated"),
        pytest.param(lambda groups: [groups[0].slice(1), *groups[1:]], "content hash", id="a sample less"),
        pytest.param(lambda groups: [g.drop_columns(["mz"]) for g in groups], "columns mz", id="a column less"),
    ],
)
def test_rearranged_samples_are_seen(copy: Path, change: Callable[[list[Any]], list[Any]], message: str) -> None:
    edit_samples(copy, change)
    with pytest.raises(ArtifactError, match=message):
        load_dataset(copy)


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(lambda rows: rows[3].update(maneuver="turn"), id="maneuver"),
        pytest.param(lambda rows: rows[3].update(terrain=rows[4]["terrain"]), id="terrain"),
        pytest.param(lambda rows: rows[3].update(excitation="{}"), id="excitation"),
        pytest.param(lambda rows: rows[3].update(terrain="{"), id="not JSON"),
        pytest.param(lambda rows: [row.pop("samples") for row in rows], id="a column less"),
        pytest.param(lambda rows: rows.pop(), id="a run less"),
    ],
)
def test_an_edited_run_table_is_seen(copy: Path, change: Callable[[list[dict[str, Any]]], object]) -> None:
    edit_runs(copy, change)
    with pytest.raises(ArtifactError):
        load_dataset(copy)


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(lambda m: m.update(content_hash="0" * 64), id="hash"),
        pytest.param(lambda m: m.update(runs=17), id="runs"),
        pytest.param(lambda m: m.update(samples_per_run=41), id="samples"),
        pytest.param(lambda m: m.update(seed=4), id="seed"),
        pytest.param(lambda m: m.update(tick=0.02), id="tick"),
        pytest.param(lambda m: m.update(transient=2.0), id="transient"),
        pytest.param(lambda m: m.update(integrator="euler"), id="integrator"),
        pytest.param(lambda m: m.update(ranges="paper"), id="ranges"),
        pytest.param(lambda m: m["vehicle"].update(mass=4500.0), id="vehicle"),
        pytest.param(lambda m: m["backend"].update(cells=[2, 1]), id="teacher"),
        pytest.param(lambda m: m.update(mode="soil"), id="mode"),
        pytest.param(lambda m: m.update(mode="ice"), id="unknown mode"),
        pytest.param(lambda m: m.pop("vehicle"), id="a key less"),
        pytest.param(lambda m: m.update(colour="red"), id="a key more"),
    ],
)
def test_an_edited_manifest_is_seen(copy: Path, change: Callable[[dict[str, Any]], object]) -> None:
    edit_manifest(copy, change)
    with pytest.raises(ArtifactError):
        load_dataset(copy)


@pytest.mark.parametrize("content", ["", "{", "[1]", "null", '"dataset"', "\x00"])
def test_a_manifest_that_is_none_is_refused(copy: Path, content: str) -> None:
    (copy / "dataset.json").write_text(content, encoding="utf-8")
    with pytest.raises(ArtifactError, match="not a dataset manifest"):
        read_manifest(copy)


def test_a_newer_format_is_named_as_such(copy: Path) -> None:
    edit_manifest(copy, lambda m: m.update(format_version=2))
    with pytest.raises(ArtifactError, match="format 2"):
        load_dataset(copy)


def test_a_newer_format_is_named_as_such_whatever_it_adds(copy: Path) -> None:
    edit_manifest(copy, lambda m: m.update(format_version=2, shards=4))
    with pytest.raises(ArtifactError, match="format 2"):
        load_dataset(copy)


@pytest.mark.parametrize("name", ["dataset.json", "runs.parquet", "samples.parquet"])
@pytest.mark.parametrize("damage", ["missing", "empty", "truncated"])
def test_a_missing_or_truncated_file_is_named(copy: Path, name: str, damage: str) -> None:
    path = copy / name
    content = path.read_bytes()
    path.unlink()
    if damage != "missing":
        path.write_bytes(content[: len(content) * 2 // 3] if damage == "truncated" else b"")
    with pytest.raises(ArtifactError, match=name):
        load_dataset(copy)


def test_damaged_bytes_within_the_samples_are_seen(copy: Path) -> None:
    path = copy / "samples.parquet"
    content = bytearray(path.read_bytes())
    for at in range(len(content) // 3, len(content) // 3 + 64):
        content[at] ^= 0xFF
    path.write_bytes(content)
    with pytest.raises(ArtifactError):
        load_dataset(copy)


def test_each_damage_has_its_own_message(folders: dict[str, Path], tmp_path: Path) -> None:
    def truncate(folder: Path) -> None:
        (folder / "samples.parquet").write_bytes((folder / "samples.parquet").read_bytes()[:-100])

    damages: list[Callable[[Path], object]] = [
        lambda folder: edit_samples(folder, nudge("vx")),
        truncate,
        lambda folder: (folder / "samples.parquet").unlink(),
        lambda folder: (folder / "runs.parquet").unlink(),
        lambda folder: (folder / "dataset.json").unlink(),
        lambda folder: edit_manifest(folder, lambda m: m.update(runs=17)),
        lambda folder: edit_manifest(folder, lambda m: m.update(format_version=2)),
        lambda folder: edit_manifest(folder, lambda m: m.update(colour="red")),
    ]
    messages = set()
    for index, damage in enumerate(damages):
        folder = Path(shutil.copytree(folders["rigid"], tmp_path / str(index)))
        damage(folder)
        with pytest.raises(ArtifactError) as caught:
            load_dataset(folder)
        messages.add(str(caught.value).replace(str(folder), ""))
    assert len(messages) == len(damages)


def test_a_folder_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ArtifactError, match="grouser data"):
        load_dataset(tmp_path / "nowhere")


def test_recipes_are_compared_without_hashes(
    rigid: Dataset, datasets: dict[str, Dataset], data_config: Callable[..., DataConfig]
) -> None:
    manifest = rigid.manifest
    bare = Manifest(**{**vars(manifest), "content_hash": ""})
    assert manifest.same_recipe(bare)
    assert bare.same_recipe(manifest)
    assert not manifest.same_recipe(datasets["soil"].manifest)
    assert not manifest.same_recipe(Manifest(**{**vars(manifest), "seed": data_config().seed + 1}))
