"""Same seed, same bits; a truthful log; interruptions that cost nothing but time."""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyarrow import parquet

from grouser.envs import INTEGRATORS
from grouser.surrogate.offline import generate
from grouser.surrogate.offline.dataset import Dataset, load_dataset
from grouser.surrogate.offline.generate import DataConfig, generate_dataset, simulate_run
from grouser.surrogate.offline.manifest import Manifest
from grouser.terrain import (
    ArtifactError,
    ConfigurationError,
    InvalidInputError,
    PhysicsBackend,
    SimulationDivergedError,
    TrackedVehicle,
    parameter_ranges,
)

Config = Callable[..., DataConfig]
FILES = ["dataset.json", "runs.parquet", "samples.parquet"]
M113 = TrackedVehicle.preset("m113")


class Interrupted(Exception):
    """Stands for Ctrl-C, a full disk, a power cut."""


def interrupt_after(count: int) -> Callable[[int, int], None]:
    def progress(done: int, runs: int) -> None:
        if done >= count:
            raise Interrupted

    return progress


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def finish(config: DataConfig, folder: Path, expected: Manifest) -> None:
    """Go on with a dataset, and see that it ends as if nothing had happened."""
    assert generate_dataset(config, folder) == expected
    assert load_dataset(folder).manifest == expected
    assert names(folder) == FILES


# --- same seed, same bits


def test_two_workers_write_the_same_bits_as_one(data_config: Config, folders: dict[str, Path], tmp_path: Path) -> None:
    for mode, folder in folders.items():
        generate_dataset(data_config(mode=mode), tmp_path / mode, workers=2)
        assert names(tmp_path / mode) == FILES
        for name in FILES:
            assert (tmp_path / mode / name).read_bytes() == (folder / name).read_bytes(), name


def test_again_is_the_same_and_another_seed_is_not(data_config: Config, rigid: Dataset, tmp_path: Path) -> None:
    assert generate_dataset(data_config(), tmp_path / "again") == rigid.manifest
    assert generate_dataset(data_config(seed=4), tmp_path / "other").content_hash != rigid.manifest.content_hash


def test_a_run_depends_on_the_seed_and_its_index_alone(data_config: Config, dataset: Dataset) -> None:
    mode = dataset.manifest.mode
    backend = PhysicsBackend(M113, mode)
    for index in (13, 2):
        run = simulate_run(data_config(mode=mode, runs=100), backend, index)
        assert run.record == dataset.records[index]
        np.testing.assert_array_equal(run.inputs, dataset.inputs[dataset.run_index == index])
        np.testing.assert_array_equal(run.forces, dataset.forces[dataset.run_index == index])


def test_the_transient_is_driven_but_not_logged(data_config: Config) -> None:
    backend = PhysicsBackend(M113, "rigid")
    whole = simulate_run(data_config(transient=0.0, samples_per_run=90), backend, 0)
    cut = simulate_run(data_config(transient=0.5, samples_per_run=40), backend, 0)
    np.testing.assert_array_equal(cut.inputs, whole.inputs[50:])
    np.testing.assert_array_equal(cut.forces, whole.forces[50:])


def test_the_ranges_are_those_that_were_asked_for(data_config: Config) -> None:
    backend, ranges = PhysicsBackend(M113, "rigid"), parameter_ranges("paper", "rigid")
    config = data_config(ranges="paper", samples_per_run=1, transient=0.0)
    terrains = [simulate_run(config, backend, run).record.terrain for run in range(40)]
    theta = np.array([[terrain[name] for name in backend.interface.parameter_names] for terrain in terrains])
    assert np.all(theta >= ranges.low)
    assert np.all(theta <= ranges.high)
    assert np.all(np.ptp(theta, axis=0) > 0.7 * np.subtract(ranges.high, ranges.low))


# --- the log is truthful


def test_forces_recomputed_from_the_inputs_are_the_logged_ones(dataset: Dataset) -> None:
    backend = PhysicsBackend(dataset.vehicle, dataset.manifest.mode)
    np.testing.assert_array_equal(backend.forces(dataset.inputs), dataset.forces)


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("mode", ["rigid", "soil"])
def test_the_log_is_truthful_under_every_integrator(data_config: Config, mode: str, integrator: str) -> None:
    vehicle = TrackedVehicle.preset("ugv")
    backend = PhysicsBackend(vehicle, mode)  # type: ignore[arg-type]
    config = data_config(mode=mode, vehicle="ugv", integrator=integrator, transient=1.0)
    for run in range(6):
        log = simulate_run(config, backend, run)
        assert np.isfinite(log.forces).all()
        np.testing.assert_array_equal(backend.forces(log.inputs), log.forces)
        np.testing.assert_array_equal(log.inputs[1:, 3:5], log.forces[:-1, :2] / vehicle.mass)


def test_accelerations_are_the_previous_rows_forces_over_mass(dataset: Dataset) -> None:
    for record in dataset.records:
        rows = dataset.run_index == record.run
        inputs, forces = dataset.inputs[rows], dataset.forces[rows]
        np.testing.assert_array_equal(inputs[1:, 3], forces[:-1, 0] / M113.mass)
        np.testing.assert_array_equal(inputs[1:, 4], forces[:-1, 1] / M113.mass)


def test_logged_forces_are_the_ones_that_moved_the_vehicle(dataset: Dataset) -> None:
    step = dataset.manifest.tick
    for record in dataset.records:
        if record.divided_ticks:
            continue
        rows = dataset.run_index == record.run
        (vx, vy, omega), forces = dataset.inputs[rows, :3].T, dataset.forces[rows]
        moved = np.stack(
            [
                M113.mass * (np.diff(vx) / step - omega[1:] * vy[1:]),
                M113.mass * (np.diff(vy) / step + omega[1:] * vx[1:]),
                M113.yaw_inertia * np.diff(omega) / step,
            ],
            axis=1,
        )
        # Newton's residual of 1e-11 m/s over a tick of 10 ms moves 37 t m² by 4e-5 N m.
        np.testing.assert_allclose(moved, forces[1:], rtol=0, atol=1e-4)


def test_divided_ticks_are_counted(data_config: Config) -> None:
    """A tick of a quarter of a second is hard enough to be halved somewhere."""
    backend = PhysicsBackend(M113, "rigid")
    config = data_config(tick=0.25, transient=0.0, samples_per_run=60)
    log = [simulate_run(config, backend, run) for run in range(6)]
    assert all(0 <= run.record.divided_ticks <= 60 for run in log)
    for run in log:
        np.testing.assert_array_equal(backend.forces(run.inputs), run.forces)
        np.testing.assert_array_equal(run.inputs[1:, 3:5], run.forces[:-1, :2] / M113.mass)


# --- interruptions


def test_progress_counts_up_to_the_runs(data_config: Config, tmp_path: Path) -> None:
    seen: list[tuple[int, int]] = []
    generate_dataset(
        data_config(runs=4, samples_per_run=2, transient=0.0),
        tmp_path,
        progress=lambda done, runs: seen.append((done, runs)),
    )
    assert seen == [(done, 4) for done in range(5)]


# joblib says in a destructor how many tasks it gave up.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize("count", [0, 7, 18])
def test_an_interrupted_dataset_goes_on(
    data_config: Config, rigid: Dataset, tmp_path: Path, count: int, workers: int
) -> None:
    with pytest.raises(Interrupted):
        generate_dataset(data_config(), tmp_path, workers=workers, progress=interrupt_after(count))
    assert not set(FILES) & set(names(tmp_path))
    with pytest.raises(ArtifactError):
        load_dataset(tmp_path)
    finish(data_config(), tmp_path, rigid.manifest)


def test_finished_runs_are_not_driven_again(data_config: Config, rigid: Dataset, tmp_path: Path) -> None:
    with pytest.raises(Interrupted):
        generate_dataset(data_config(), tmp_path, progress=interrupt_after(10))
    seen: list[int] = []
    assert generate_dataset(data_config(), tmp_path, progress=lambda done, _: seen.append(done)) == rigid.manifest
    assert seen == list(range(10, 19))


def test_runs_that_got_lost_are_driven_again(data_config: Config, rigid: Dataset, tmp_path: Path) -> None:
    with pytest.raises(Interrupted):
        generate_dataset(data_config(), tmp_path, progress=interrupt_after(18))
    kept = sorted(tmp_path.rglob("run-*.parquet"))
    assert len(kept) == 18
    for path in kept[3:9]:
        path.unlink()
    finish(data_config(), tmp_path, rigid.manifest)


def test_a_killed_process_leaves_a_dataset_that_goes_on(data_config: Config, rigid: Dataset, tmp_path: Path) -> None:
    script = (
        "import os, signal, sys\nfrom pathlib import Path\n"
        "from grouser.surrogate.offline.generate import DataConfig, generate_dataset\n"
        "def progress(done, runs):\n    if done == 5: os.kill(os.getpid(), signal.SIGKILL)\n"
        "config = DataConfig(runs=18, samples_per_run=40, transient=0.5, seed=3)\n"
        "generate_dataset(config, Path(sys.argv[1]), progress=progress)\n"
    )
    killed = subprocess.run([sys.executable, "-P", "-c", script, str(tmp_path / "data")], check=False)
    assert killed.returncode == -signal.SIGKILL
    assert "dataset.json" not in names(tmp_path / "data")
    finish(data_config(), tmp_path / "data", rigid.manifest)


def test_a_run_that_was_half_written_has_no_final_name(
    data_config: Config, rigid: Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, calls = parquet.write_table, [0]

    def failing(table: Any, where: Any, *args: Any, **kwargs: Any) -> None:
        calls[0] += 1
        whole(table, where, *args, **kwargs)
        if calls[0] == 4:
            Path(where).write_bytes(Path(where).read_bytes()[:1000])
            raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(parquet, "write_table", failing)
        with pytest.raises(OSError, match="No space"):
            generate_dataset(data_config(), tmp_path)
    for path in tmp_path.rglob("*.parquet"):
        parquet.read_table(path)
    finish(data_config(), tmp_path, rigid.manifest)


@pytest.mark.parametrize("name", FILES)
def test_an_interruption_while_assembling_leaves_no_dataset(
    data_config: Config, rigid: Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    rename = os.replace

    def failing(source: Any, target: Any) -> None:
        if Path(target).name == name:
            raise Interrupted
        rename(source, target)

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", failing)
        with pytest.raises(Interrupted):
            generate_dataset(data_config(), tmp_path)
    assert name not in names(tmp_path)
    with pytest.raises(ArtifactError, match=r"no dataset\.json"):
        load_dataset(tmp_path)
    finish(data_config(), tmp_path, rigid.manifest)


def test_an_interruption_while_tidying_up_is_made_good(
    data_config: Config, rigid: Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(*args: Any, **kwargs: Any) -> None:
        raise Interrupted

    with monkeypatch.context() as patch:
        patch.setattr(shutil, "rmtree", failing)
        with pytest.raises(Interrupted):
            generate_dataset(data_config(), tmp_path)
    finish(data_config(), tmp_path, rigid.manifest)


def test_a_run_that_diverges_leaves_the_others(
    data_config: Config, rigid: Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def diverging(config: DataConfig, backend: PhysicsBackend, run: int) -> Any:
        if run == 6:
            raise SimulationDivergedError("no tick was solved")
        return simulate_run(config, backend, run)

    with monkeypatch.context() as patch:
        patch.setattr(generate, "simulate_run", diverging)
        with pytest.raises(SimulationDivergedError):
            generate_dataset(data_config(), tmp_path)
    assert len(list(tmp_path.rglob("run-*.parquet"))) >= 6
    finish(data_config(), tmp_path, rigid.manifest)


# --- folders that hold something


def test_a_finished_dataset_is_returned_as_it_is(data_config: Config, rigid: Dataset, folders: dict[str, Path]) -> None:
    before = {name: (folders["rigid"] / name).stat().st_mtime_ns for name in FILES}
    assert generate_dataset(data_config(), folders["rigid"], progress=interrupt_after(1)) == rigid.manifest
    assert {name: (folders["rigid"] / name).stat().st_mtime_ns for name in FILES} == before


def test_a_finished_but_damaged_dataset_is_not_returned(
    data_config: Config, folders: dict[str, Path], tmp_path: Path
) -> None:
    copy = Path(shutil.copytree(folders["rigid"], tmp_path / "copy"))
    (copy / "samples.parquet").unlink()
    with pytest.raises(ArtifactError, match=r"samples\.parquet"):
        generate_dataset(data_config(), copy)


OTHERS: list[dict[str, Any]] = [
    {"seed": 4},
    {"runs": 19},
    {"samples_per_run": 41},
    {"mode": "soil"},
    {"vehicle": "ugv"},
    {"ranges": "paper"},
    {"integrator": "sdirk2"},
    {"transient": 0.4},
    {"tick": 0.02},
]


@pytest.mark.parametrize("change", OTHERS, ids=str)
def test_a_folder_that_holds_another_dataset_is_refused(
    data_config: Config, folders: dict[str, Path], change: dict[str, Any]
) -> None:
    before = {name: (folders["rigid"] / name).read_bytes() for name in FILES}
    with pytest.raises(ConfigurationError, match="another dataset"):
        generate_dataset(data_config(**change), folders["rigid"])
    assert names(folders["rigid"]) == FILES
    assert {name: (folders["rigid"] / name).read_bytes() for name in FILES} == before


def test_a_folder_that_holds_another_unfinished_dataset_is_refused(
    data_config: Config, rigid: Dataset, tmp_path: Path
) -> None:
    with pytest.raises(Interrupted):
        generate_dataset(data_config(), tmp_path, progress=interrupt_after(5))
    for change in OTHERS:
        with pytest.raises(ConfigurationError, match="unfinished"):
            generate_dataset(data_config(**change), tmp_path)
    finish(data_config(), tmp_path, rigid.manifest)


@pytest.mark.parametrize("content", ["", '{"mode": "rigid", "colour": 1}'])
def test_a_plan_that_cannot_be_read_is_refused_as_such(data_config: Config, tmp_path: Path, content: str) -> None:
    with pytest.raises(Interrupted):
        generate_dataset(data_config(), tmp_path, progress=interrupt_after(1))
    (plan,) = tmp_path.rglob("*.json")
    plan.write_text(content, encoding="utf-8")
    with pytest.raises((ArtifactError, ConfigurationError)):
        generate_dataset(data_config(), tmp_path)


# --- what cannot be asked for


@pytest.mark.parametrize("workers", [0, -1])
def test_no_workers_are_refused(data_config: Config, tmp_path: Path, workers: int) -> None:
    with pytest.raises(InvalidInputError, match="workers must be at least 1"):
        generate_dataset(data_config(), tmp_path / "data", workers=workers)


@pytest.mark.parametrize(
    "change",
    [
        {"runs": 0},
        {"runs": -3},
        {"samples_per_run": 0},
        {"transient": -0.1},
        {"transient": float("nan")},
        {"transient": float("inf")},
        {"tick": 0.0},
        {"tick": -0.01},
        {"tick": 1.5},
        {"tick": float("nan")},
        {"tick": float("inf")},
        {"seed": -1},
    ],
    ids=str,
)
def test_impossible_numbers_are_refused(change: dict[str, Any]) -> None:
    with pytest.raises(InvalidInputError):
        DataConfig(**change)


@pytest.mark.parametrize(
    ("change", "nearest"),
    [
        ({"mode": "rigit"}, "rigid"),
        ({"vehicle": "m13"}, "m113"),
        ({"ranges": "wied"}, "wide"),
        ({"integrator": "implizit"}, "implicit"),
    ],
    ids=str,
)
def test_unknown_names_come_with_the_nearest(change: dict[str, Any], nearest: str) -> None:
    with pytest.raises(ConfigurationError, match=nearest):
        DataConfig(**change)


def test_the_defaults_are_the_papers() -> None:
    config = DataConfig()
    assert (config.runs, config.samples_per_run, config.tick, config.transient) == (300, 3801, 0.01, 2.0)
    assert replace(config, seed=1).seed == 1
