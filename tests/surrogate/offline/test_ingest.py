"""Drives as runs of a dataset: labelled apart, with the teacher's forces, or refused; and datasets that are joined."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from grouser.envs import BeltCommand, InterfaceLog, Simulator, VehicleState, rollout
from grouser.surrogate.offline import TrainingConfig, split_runs
from grouser.surrogate.offline.dataset import Dataset, load_dataset
from grouser.surrogate.offline.ingest import VISITED, OriginLog, ingest_logs
from grouser.surrogate.offline.joining import join_datasets
from grouser.surrogate.offline.training import train_surrogate
from grouser.terrain import (
    ArtifactError,
    ConfigurationError,
    Ground,
    InvalidInputError,
    Patch,
    PhysicsBackend,
    Rectangle,
    RigidTerrain,
    SlopedGround,
    TrackedVehicle,
    named,
    paint_field,
)

M113 = TrackedVehicle.preset("m113")


class Steady:
    """Belts that never change."""

    def __init__(self, left: float, right: float) -> None:
        self._command = BeltCommand(left, right)

    def reset(self) -> None:
        pass

    def command(self, state: VehicleState) -> BeltCommand:
        return self._command


def drive(
    right: float = 4.0, ground: Ground | None = None, ticks: int = 30, backend: Any = "physics", **options: Any
) -> InterfaceLog:
    simulator = Simulator(M113, backend, ground or named("asphalt"), state=VehicleState.rolling(3.0), **options)
    return rollout(simulator, Steady(3.0, right), ticks * simulator.tick, control_period=simulator.tick)


def drives(count: int = 3, **options: Any) -> list[OriginLog]:
    return [OriginLog(f"drive {i}", drive(4.0 + i / 10, ticks=30 + i, **options)) for i in range(count)]


def test_a_drive_becomes_a_labelled_run(tmp_path: Path) -> None:
    logs = drives()
    manifest = ingest_logs(logs, tmp_path / "visited")
    dataset = load_dataset(tmp_path / "visited")
    assert dataset.manifest == manifest
    assert (manifest.runs, manifest.samples_per_run, manifest.tick, manifest.integrator) == (3, 32, 0.01, "implicit")
    assert dataset.vehicle == M113
    for entry, record in zip(logs, dataset.records, strict=True):
        rows = dataset.run_index == record.run
        assert record.maneuver == VISITED
        assert record.samples == len(entry.log) == rows.sum()
        assert record.excitation == {"origin": entry.origin, "backend": "physics"}
        assert [record.terrain[name] for name in ("mu", "fr", "k")] == named("asphalt").parameters.tolist()
        np.testing.assert_array_equal(dataset.inputs[rows], entry.log.inputs)
        np.testing.assert_array_equal(dataset.forces[rows], entry.log.forces)
    assert sorted(path.name for path in (tmp_path / "visited").iterdir()) == [
        "dataset.json",
        "runs.parquet",
        "samples.parquet",
    ]


def test_the_same_drives_give_the_same_bits(tmp_path: Path) -> None:
    assert ingest_logs(drives(), tmp_path / "a") == ingest_logs(drives(), tmp_path / "b")
    for name in ("dataset.json", "runs.parquet", "samples.parquet"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_whoever_drove_the_forces_are_the_teachers(tmp_path: Path) -> None:
    logs = drives(backend="native")
    ingest_logs(logs, tmp_path)
    dataset = load_dataset(tmp_path)
    np.testing.assert_array_equal(dataset.inputs, np.concatenate([entry.log.inputs for entry in logs]))
    np.testing.assert_array_equal(dataset.forces, PhysicsBackend(M113, "rigid").forces(dataset.inputs))
    assert np.any(dataset.forces != np.concatenate([entry.log.forces for entry in logs]))
    assert dataset.manifest.backend["backend"] == "physics"
    artifact = logs[0].log.meta["backend"]["artifact"]
    assert all(record.excitation["artifact"] == artifact for record in dataset.records)


def test_another_teacher_is_asked(tmp_path: Path) -> None:
    assert ingest_logs(drives(), tmp_path, teacher="exact").backend["backend"] == "exact"


def changed(**changes: Any) -> OriginLog:
    return OriginLog("odd", replace(drive(5.0), **changes))


def two_grounds() -> Ground:
    ice = [Patch(named("ice"), Rectangle(x_min=0.5))]
    return paint_field(named("asphalt"), extent=(-20, 20, -20, 20), patches=ice, outside="extend")


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda: OriginLog("odd", drive(ground=SlopedGround(named("asphalt"), grade=0.1))), "slope"),
        (lambda: OriginLog("odd", drive(ground=two_grounds())), "changing ground"),
        (lambda: changed(right_theta=np.tile((0.5, 0.03, 0.02), (30, 1))), "under each track"),
        (lambda: OriginLog("odd", drive(ground=RigidTerrain(1.5))), "ranges"),
        (lambda: OriginLog("odd", drive(tick=0.02)), "tick"),
        (lambda: OriginLog("odd", drive(integrator="sdirk2")), "integrator"),
        (lambda: OriginLog("odd", drive(ground=named("lete-sand"))), "mode"),
        (lambda: changed(meta={}), "does not name"),
        (lambda: changed(inputs=np.full((30, 10), np.nan)), "finite"),
        (lambda: OriginLog("odd", drive(4.1, ticks=31)), "same drive"),
    ],
)
def test_what_does_not_fit_is_refused_and_leaves_nothing(
    make: Callable[[], OriginLog], reason: str, tmp_path: Path
) -> None:
    with pytest.raises((InvalidInputError, ConfigurationError, ArtifactError), match=reason) as refusal:
        ingest_logs([*drives(2), make()], tmp_path / "visited")
    assert "odd" in str(refusal.value)
    assert not (tmp_path / "visited").exists()


def test_nothing_and_a_folder_that_holds_a_dataset_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="no logs"):
        ingest_logs([], tmp_path)
    ingest_logs(drives(1), tmp_path)
    with pytest.raises(ConfigurationError, match="holds a dataset"):
        ingest_logs(drives(2), tmp_path)


# --- joined


@pytest.fixture
def visited(tmp_path: Path) -> Dataset:
    ingest_logs(drives(), tmp_path / "visited")
    return load_dataset(tmp_path / "visited")


def test_runs_are_numbered_on(rigid: Dataset, visited: Dataset) -> None:
    joined = join_datasets([rigid, visited])
    assert [record.run for record in joined.records] == list(range(21))
    assert joined.manifest.runs == 21
    assert joined.manifest.content_hash == f"{rigid.manifest.content_hash}+{visited.manifest.content_hash}"
    back = joined.select(range(18, 21))
    np.testing.assert_array_equal(back.inputs, visited.inputs)
    np.testing.assert_array_equal(back.forces, visited.forces)
    np.testing.assert_array_equal(joined.select(range(18)).inputs, rigid.inputs)
    assert join_datasets([rigid]) is rigid


def test_each_side_of_the_split_has_a_visited_run(rigid: Dataset, visited: Dataset) -> None:
    split = split_runs(join_datasets([rigid, visited]).records)
    for side in (split.train, split.validation, split.test):
        assert len(set(side) & {18, 19, 20}) == 1


def test_too_few_visited_runs_cannot_be_split(rigid: Dataset, tmp_path: Path) -> None:
    ingest_logs(drives(2), tmp_path)
    with pytest.raises(InvalidInputError, match="'visited' has 2 runs"):
        split_runs(join_datasets([rigid, load_dataset(tmp_path)]).records)


def test_a_joined_dataset_trains(
    rigid: Dataset, visited: Dataset, training_config: Callable[..., TrainingConfig], tmp_path: Path
) -> None:
    joined = join_datasets([rigid, visited])
    result = train_surrogate(joined, training_config(epochs=2), tmp_path / "joined.safetensors")
    assert result.surrogate.dataset_hash == joined.manifest.content_hash


def test_datasets_of_different_blocks_are_not_joined(
    rigid: Dataset, datasets: dict[str, Dataset], visited: Dataset
) -> None:
    def with_manifest(**changes: Any) -> Dataset:
        return replace(visited, manifest=replace(visited.manifest, **changes))

    heavier = replace(M113, mass=12000.0)
    teacher = PhysicsBackend(M113, "rigid", cells=(2, 1)).describe()
    for other, reason in (
        (datasets["soil"], "one mode"),
        (with_manifest(ranges="paper"), "one ranges"),
        (with_manifest(vehicle=heavier.to_dict()), "one vehicle"),
        (with_manifest(backend=teacher), "one teacher"),
    ):
        with pytest.raises(ConfigurationError, match=reason):
            join_datasets([rigid, other])
    with pytest.raises(InvalidInputError, match="twice"):
        join_datasets([rigid, rigid])
    with pytest.raises(InvalidInputError, match="no datasets"):
        join_datasets([])
