"""One recipe, one artifact: what is learned from, what is kept, and that an interruption changes no bit of it."""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from grouser.surrogate import NUMPY_NETWORK, DenseNetwork, Normalizer, Surrogate, random_network
from grouser.surrogate.offline.dataset import Dataset
from grouser.surrogate.offline.metrics import force_metrics, metrics_to_dict
from grouser.surrogate.offline.preparation import whitening, with_symmetries
from grouser.surrogate.offline.split import split_runs
from grouser.surrogate.offline.training import EpochReport, TrainingResult, train_surrogate
from grouser.surrogate.offline.training_config import TrainingConfig
from grouser.terrain import (
    ArtifactError,
    FloatArray,
    InvalidInputError,
    PhysicsBackend,
    TrackedVehicle,
    make_backend,
    parameter_ranges,
)

Config = Callable[..., TrainingConfig]
Trained = tuple[TrainingResult, Path]
M113 = TrackedVehicle.preset("m113")


class Interrupted(Exception):
    """Stands for Ctrl-C."""


def interrupt_at(epoch: int) -> Callable[[EpochReport], None]:
    def report(entry: EpochReport) -> None:
        if entry.epoch == epoch:
            raise Interrupted

    return report


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def rebuilt(dataset: Dataset, **changes: Any) -> Dataset:
    return Dataset(
        **{
            name: changes.get(name, getattr(dataset, name))
            for name in ("manifest", "records", "inputs", "forces", "run_index")
        }
    )


def weighted_huber(predicted: FloatArray, truth: FloatArray, weights: tuple[float, ...], delta: float) -> float:
    """Mean over rows of the weighted sum over outputs, in normalized units."""
    error = np.abs(predicted - truth)
    element = np.where(error <= delta, error**2 / 2, delta * (error - delta / 2))
    return float((element * weights).sum(axis=1).mean())


def validation_loss(result: TrainingResult, dataset: Dataset, config: TrainingConfig) -> float:
    """The artifact's own loss on the validation runs, in float64."""
    surrogate, side = result.surrogate, dataset.select(result.split.validation)
    z = surrogate.network.forward(NUMPY_NETWORK, surrogate.input_normalizer.normalize(side.inputs))
    return weighted_huber(
        z, surrogate.output_normalizer.normalize(side.forces), config.output_weights, config.huber_delta
    )


# --- same seed, same bits


def test_two_trainings_give_the_same_bytes(
    rigid: Dataset, trained: Trained, training_config: Config, tmp_path: Path
) -> None:
    again = train_surrogate(rigid, training_config(), tmp_path / "again.safetensors", threads=1)
    assert (tmp_path / "again.safetensors").read_bytes() == trained[1].read_bytes()
    assert again.history == trained[0].history
    assert again.split == trained[0].split


def test_what_was_drawn_before_does_not_matter(
    rigid: Dataset, trained: Trained, training_config: Config, tmp_path: Path
) -> None:
    torch.manual_seed(1234)
    torch.rand(17)
    train_surrogate(rigid, training_config(), tmp_path / "again.safetensors")
    assert (tmp_path / "again.safetensors").read_bytes() == trained[1].read_bytes()


def test_another_seed_gives_another_network(
    rigid: Dataset, trained: Trained, training_config: Config, tmp_path: Path
) -> None:
    other = train_surrogate(rigid, training_config(seed=1), tmp_path / "other.safetensors")
    assert other.split != trained[0].split
    assert other.surrogate.content_hash != trained[0].surrogate.content_hash


def test_another_process_gives_the_same_bytes(folders: dict[str, Path], trained: Trained, tmp_path: Path) -> None:
    script = (
        "import sys\nfrom pathlib import Path\n"
        "from grouser.surrogate.offline.dataset import load_dataset\n"
        "from grouser.surrogate.offline.training_config import TrainingConfig\n"
        "from grouser.surrogate.offline.training import train_surrogate\n"
        "config = TrainingConfig(**__import__('json').loads(sys.argv[3]))\n"
        "train_surrogate(load_dataset(Path(sys.argv[1])), config, Path(sys.argv[2]))\n"
    )
    config = {name: trained[0].surrogate.recipe[name] for name in asdict(TrainingConfig())}
    output = tmp_path / "again.safetensors"
    subprocess.run(
        [sys.executable, "-P", "-c", script, str(folders["rigid"]), str(output), json.dumps(config)],
        check=True,
        env={**os.environ, "PYTHONHASHSEED": "7", "OPENBLAS_NUM_THREADS": "2"},
    )
    loaded, expected = Surrogate.load(output), Surrogate.load(trained[1])
    assert loaded.network.packed() == expected.network.packed()
    assert output.read_bytes() == trained[1].read_bytes()


# --- interruptions

#: Every draw and every counter at work: a rate that is too high, so that epochs improve and do not.
ROUGH = {
    "dropout": 0.2,
    "learning_rate": 0.2,
    "learning_rate_decay": 0.9,
    "plateau_patience": 1,
    "weight_decay": 1e-4,
    "epochs": 6,
    "perturbed_copies": 0,
}


@pytest.fixture(scope="module")
def rough(rigid: Dataset, training_config: Config, tmp_path_factory: pytest.TempPathFactory) -> Trained:
    path = tmp_path_factory.mktemp("rough") / "rough.safetensors"
    result = train_surrogate(rigid, training_config(**ROUGH), path)
    assert {entry.improved for entry in result.history} == {True, False}
    return result, path


@pytest.mark.parametrize("epochs", [[1], [3], [6], [1, 2, 3, 4, 5, 6]], ids=str)
def test_an_interrupted_training_ends_at_the_same_bytes(
    rigid: Dataset, rough: Trained, training_config: Config, tmp_path: Path, epochs: list[int]
) -> None:
    output = tmp_path / "net.safetensors"
    for epoch in epochs:
        with pytest.raises(Interrupted):
            train_surrogate(rigid, training_config(**ROUGH), output, report=interrupt_at(epoch))
        assert names(tmp_path) == ["net.checkpoint"]
    rest = train_surrogate(rigid, training_config(**ROUGH), output)
    assert output.read_bytes() == rough[1].read_bytes()
    assert names(tmp_path) == ["net.safetensors"]
    assert rest.history == rough[0].history[epochs[-1] :]


def test_interrupted_by_a_failing_write_it_ends_at_the_same_bytes(
    rigid: Dataset, rough: Trained, training_config: Config, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls, whole = [0], Path.write_bytes

    def failing(path: Path, data: bytes) -> int:
        calls[0] += 1
        if calls[0] == 3:
            whole(path, data[:200])
            raise OSError(28, "No space left on device")
        return whole(path, data)

    output = tmp_path / "net.safetensors"
    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", failing)
        with pytest.raises(OSError, match="No space"):
            train_surrogate(rigid, training_config(**ROUGH), output)
    train_surrogate(rigid, training_config(**ROUGH), output)
    assert output.read_bytes() == rough[1].read_bytes()
    assert names(tmp_path) == ["net.safetensors"]


def test_interrupted_before_the_artifact_it_ends_at_the_same_bytes(
    rigid: Dataset, rough: Trained, training_config: Config, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, output = Path.write_bytes, tmp_path / "net.safetensors"

    def failing(path: Path, data: bytes) -> int:
        if "checkpoint" in path.name:
            return whole(path, data)
        whole(path, data[: len(data) // 2])
        raise Interrupted

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", failing)
        with pytest.raises(Interrupted):
            train_surrogate(rigid, training_config(**ROUGH), output)
    assert names(tmp_path) == ["net.checkpoint"]
    seen: list[EpochReport] = []
    train_surrogate(rigid, training_config(**ROUGH), output, report=seen.append)
    assert not seen  # nothing is trained again
    assert output.read_bytes() == rough[1].read_bytes()
    assert names(tmp_path) == ["net.safetensors"]


def test_the_checkpoint_of_another_recipe_or_dataset_is_refused(
    rigid: Dataset, datasets: dict[str, Dataset], training_config: Config, tmp_path: Path
) -> None:
    config, output = training_config(perturbed_copies=0), tmp_path / "net.safetensors"
    with pytest.raises(Interrupted):
        train_surrogate(rigid, config, output, report=interrupt_at(1))
    before = (tmp_path / "net.checkpoint").read_bytes()
    manifest = replace(rigid.manifest, content_hash="0" * 64)
    for dataset, other in [
        (rigid, replace(config, learning_rate=1e-3)),
        (rigid, replace(config, hidden=(8, 9))),
        (rigid, replace(config, epochs=config.epochs + 1)),
        (rigid, replace(config, seed=1)),
        (rebuilt(rigid, manifest=manifest), config),
        (datasets["soil"], config),
    ]:
        with pytest.raises(ArtifactError, match="another dataset or recipe"):
            train_surrogate(dataset, other, output)
    assert names(tmp_path) == ["net.checkpoint"]
    assert (tmp_path / "net.checkpoint").read_bytes() == before


def test_a_corrupted_checkpoint_is_refused(rigid: Dataset, training_config: Config, tmp_path: Path) -> None:
    config, output = training_config(perturbed_copies=0), tmp_path / "net.safetensors"
    checkpoint = tmp_path / "net.checkpoint"
    with pytest.raises(Interrupted):
        train_surrogate(rigid, config, output, report=interrupt_at(1))
    checkpoint.write_bytes(checkpoint.read_bytes()[:-5])
    with pytest.raises(ArtifactError, match="remove it to start anew"):
        train_surrogate(rigid, config, output)
    checkpoint.unlink()
    train_surrogate(rigid, config, output)
    assert names(tmp_path) == ["net.safetensors"]


# --- what is learned from


def test_without_additions_the_normalizers_are_those_of_the_training_rows(
    dataset: Dataset, training_config: Config, tmp_path: Path
) -> None:
    config = training_config(perturbed_copies=0, symmetries=False, epochs=1)
    result = train_surrogate(dataset, config, tmp_path / "net.safetensors")
    train = dataset.select(result.split.train)
    for found, rows in (
        (result.surrogate.input_normalizer, train.inputs),
        (result.surrogate.output_normalizer, train.forces),
    ):
        np.testing.assert_allclose(found.mean, rows.mean(axis=0), rtol=1e-12)
        np.testing.assert_allclose(found.scale, rows.std(axis=0), rtol=1e-12)


def test_validation_and_test_runs_leave_no_trace_in_the_normalizers(
    rigid: Dataset, trained: Trained, training_config: Config, tmp_path: Path
) -> None:
    held_out = ~np.isin(rigid.run_index, trained[0].split.train)
    inputs, forces = rigid.inputs.copy(), rigid.forces.copy()
    inputs[held_out, :7] *= 3.0
    forces[held_out] *= -5.0
    other = train_surrogate(
        rebuilt(rigid, inputs=inputs, forces=forces), training_config(), tmp_path / "net.safetensors"
    ).surrogate
    mine = trained[0].surrogate
    for found, expected in (
        (other.input_normalizer, mine.input_normalizer),
        (other.output_normalizer, mine.output_normalizer),
    ):
        np.testing.assert_array_equal(found.mean, expected.mean)
        np.testing.assert_array_equal(found.scale, expected.scale)


def test_test_runs_leave_no_trace_in_the_network(
    rigid: Dataset, trained: Trained, training_config: Config, tmp_path: Path
) -> None:
    held_out = np.isin(rigid.run_index, trained[0].split.test)
    forces = np.where(held_out[:, None], -rigid.forces, rigid.forces)
    other = train_surrogate(rebuilt(rigid, forces=forces), training_config(), tmp_path / "net.safetensors").surrogate
    assert other.network.packed() == trained[0].surrogate.network.packed()
    assert other.metrics != trained[0].surrogate.metrics


def test_the_split_is_that_of_the_seed(rigid: Dataset, trained: Trained, training_config: Config) -> None:
    assert trained[0].split == split_runs(rigid.records, seed=training_config().seed)


def test_too_few_runs_are_refused(rigid: Dataset, training_config: Config, tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="runs"):
        train_surrogate(rigid.select(range(12)), training_config(), tmp_path / "net.safetensors")
    assert names(tmp_path) == []


@pytest.mark.parametrize("offset", [0.0, 0.3])
def test_symmetric_rows_carry_symmetric_forces(dataset: Dataset, offset: float) -> None:
    vehicle = replace(M113, cg_offset=offset)
    block = PhysicsBackend(vehicle, dataset.manifest.mode)
    manifest = replace(dataset.manifest, vehicle=vehicle.to_dict())
    forces = block.forces(dataset.inputs)
    other = rebuilt(dataset, manifest=manifest, forces=forces)
    joined, joined_forces = with_symmetries(other, other.inputs, other.forces)
    times = 2 if offset else 4  # fore and aft differ where the CG is not centred
    assert len(joined) == len(joined_forces) == times * len(dataset.inputs)
    np.testing.assert_array_equal(joined[: len(forces)], dataset.inputs)
    np.testing.assert_array_equal(joined_forces[: len(forces)], forces)
    # Round-off of 640 cell forces of at most W/640 and their arms of at most 1.8 m.
    assert np.all(np.abs(block.forces(joined) - joined_forces) <= 1e-12 * M113.weight * np.array([1.0, 1.0, 2.0]))


def test_symmetries_are_optional(rigid: Dataset, trained: Trained, training_config: Config, tmp_path: Path) -> None:
    symmetric = trained[0].surrogate
    # Mirror images cancel what changes its sign in both symmetries.
    for name in ("vy", "yaw_rate", "ay"):
        assert abs(symmetric.input_normalizer.mean[rigid.interface.index(name)]) < 1e-12
    plain = train_surrogate(rigid, training_config(symmetries=False, epochs=1), tmp_path / "net.safetensors").surrogate
    assert np.all(np.abs(plain.input_normalizer.mean) > 1e-12)


# --- the loss, and when to stop


@pytest.mark.parametrize("whiten", [True, False])
@pytest.mark.parametrize("huber_delta", [1.0, 0.1])
def test_the_artifact_is_the_network_of_the_best_epoch_and_the_loss_is_weighted_huber(
    rigid: Dataset, training_config: Config, tmp_path: Path, whiten: bool, huber_delta: float
) -> None:
    config = training_config(**ROUGH | {"dropout": 0.0, "whiten": whiten, "huber_delta": huber_delta})
    result = train_surrogate(rigid, config, tmp_path / "net.safetensors")
    best = min(entry.validation_loss for entry in result.history)
    assert best < result.history[-1].validation_loss or result.history[-1].improved
    # The first layer is folded back from whitened coordinates in float32.
    assert validation_loss(result, rigid, config) == pytest.approx(best, rel=1e-4)


def test_weights_default_to_three_for_the_yaw_moment() -> None:
    assert TrainingConfig().output_weights == (1.0, 1.0, 3.0)


def test_an_output_of_no_weight_is_not_learned(rigid: Dataset, training_config: Config, tmp_path: Path) -> None:
    config = training_config(output_weights=(1.0, 0.0, 2.0))
    network = train_surrogate(rigid, config, tmp_path / "net.safetensors").surrogate.network
    start = random_network(network.widths, "silu", np.random.default_rng(config.seed))
    np.testing.assert_array_equal(network.weights[-1][:, 1], start.weights[-1][:, 1])
    assert network.biases[-1][1] == 0
    assert np.all(network.biases[-1][[0, 2]] != 0)


def test_the_weights_shift_the_balance(rigid: Dataset, training_config: Config, tmp_path: Path) -> None:
    errors = {}
    for name, weights in {"force": (1.0, 1.0, 0.01), "moment": (0.01, 0.01, 3.0)}.items():
        config = training_config(output_weights=weights, epochs=8, perturbed_copies=0)
        result = train_surrogate(rigid, config, tmp_path / f"{name}.safetensors")
        train = rigid.select(result.split.train)
        error = result.surrogate.reference_forces(train.inputs) - train.forces
        errors[name] = np.sqrt(np.mean(error**2, axis=0)) / train.forces.std(axis=0)
    assert errors["moment"][2] < errors["force"][2]
    assert errors["force"][0] < errors["moment"][0]


def test_a_small_network_learns_its_training_rows(rigid: Dataset, training_config: Config, tmp_path: Path) -> None:
    config = training_config(hidden=(16, 16), epochs=30, perturbed_copies=0)
    result = train_surrogate(rigid, config, tmp_path / "net.safetensors")
    train = rigid.select(result.split.train)
    metrics = force_metrics(result.surrogate.reference_forces(train.inputs), train.forces)
    assert all(values.r2 is not None and values.r2 > 0.8 for values in metrics.values()), metrics


def test_it_stops_early_once_nothing_improves(rigid: Dataset, training_config: Config, tmp_path: Path) -> None:
    config = training_config(learning_rate=0.5, epochs=60, patience=3, plateau_patience=50, perturbed_copies=0)
    history = train_surrogate(rigid, config, tmp_path / "net.safetensors").history
    improved = [entry.epoch for entry in history if entry.improved]
    assert len(history) < 60
    assert history[-1].epoch == improved[-1] + 3
    assert max(np.diff(improved), default=1) <= 3
    assert [entry.epoch for entry in history] == list(range(1, len(history) + 1))


def test_the_rate_follows_plateau_and_decay(rough: Trained, training_config: Config) -> None:
    config, history = training_config(**ROUGH), rough[0].history
    assert history[0].learning_rate == config.learning_rate
    assert {entry.epochs for entry in history} == {6}
    best = np.inf
    for entry, following in pairwise(history):
        assert entry.improved == (entry.validation_loss < best)
        best = min(best, entry.validation_loss)
        fall = 1.0 if entry.improved else config.plateau_factor
        assert following.learning_rate == pytest.approx(entry.learning_rate * config.learning_rate_decay * fall)


def test_every_epoch_is_reported_once(
    rigid: Dataset, trained: Trained, training_config: Config, tmp_path: Path
) -> None:
    seen: list[EpochReport] = []
    result = train_surrogate(rigid, training_config(), tmp_path / "net.safetensors", report=seen.append)
    assert tuple(seen) == result.history == trained[0].history


def test_a_training_that_diverges_at_once_says_so(rigid: Dataset, training_config: Config, tmp_path: Path) -> None:
    config = training_config(learning_rate=1e30, activation="relu", perturbed_copies=0)
    with pytest.raises(ArtifactError, match="learning_rate"):
        train_surrogate(rigid, config, tmp_path / "net.safetensors")
    assert names(tmp_path) == []


# --- whitening


def test_whitening_gives_unit_covariance() -> None:
    generator = np.random.default_rng(0)
    z = generator.normal(size=(4000, 5)) @ generator.normal(size=(5, 5))
    z[:, 1] = z[:, 0] + 1e-2 * z[:, 1]  # a belt that nearly follows the body
    matrix = whitening(z)
    np.testing.assert_allclose(np.cov(z @ matrix, rowvar=False), np.eye(5), atol=1e-8)
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-10 * np.abs(matrix).max())


def test_flat_directions_stay() -> None:
    z = np.random.default_rng(0).normal(size=(500, 4))
    z[:, 3] = 0.0
    z[:, 2] = z[:, 1]
    matrix = whitening(z)
    flat = np.array([[0.0, 0.0, 0.0, 1.0], [0.0, 1.0, -1.0, 0.0]])
    np.testing.assert_allclose(flat @ matrix, flat, atol=1e-9)
    np.testing.assert_allclose(np.cov((z @ matrix)[:, 0]), 1.0, rtol=1e-9)


def test_whitening_folds_back_into_the_first_layer(rigid: Dataset) -> None:
    z = Normalizer.fit(rigid.inputs).normalize(rigid.inputs)
    matrix = whitening(z)
    network = random_network((10, 8, 3), "silu", np.random.default_rng(0))
    first, *others = network.weights
    folded = DenseNetwork("silu", ((matrix @ first).astype(np.float32), *others), network.biases)
    expected = network.forward(NUMPY_NETWORK, z @ matrix)
    np.testing.assert_allclose(folded.forward(NUMPY_NETWORK, z), expected, atol=1e-5 * np.abs(expected).max())


def test_whitening_changes_the_training_but_not_the_coordinates_of_the_artifact(
    rigid: Dataset, trained: Trained, training_config: Config, tmp_path: Path
) -> None:
    plain = train_surrogate(rigid, training_config(whiten=False), tmp_path / "net.safetensors").surrogate
    mine = trained[0].surrogate
    np.testing.assert_array_equal(plain.input_normalizer.mean, mine.input_normalizer.mean)
    assert plain.network.packed() != mine.network.packed()


# --- the artifact


def test_only_the_artifact_is_left(trained: Trained) -> None:
    assert names(trained[1].parent) == ["small.safetensors"]


def test_the_artifact_says_where_it_comes_from(trained: Trained, rigid: Dataset, training_config: Config) -> None:
    result, path = trained
    loaded = Surrogate.load(path)
    assert loaded.content_hash == result.surrogate.content_hash
    assert (loaded.vehicle, loaded.mode, loaded.range_name) == (M113, "rigid", "wide")
    assert loaded.ranges == parameter_ranges("wide", "rigid")
    assert loaded.dataset_hash == rigid.manifest.content_hash
    recipe = json.loads(json.dumps(asdict(training_config())))
    assert {name: loaded.recipe[name] for name in recipe} == recipe
    assert loaded.recipe["split"] == result.split.to_dict()
    assert loaded.recipe["teacher"] == rigid.manifest.backend
    assert loaded.network.widths == (10, 8, 8, 3)
    assert loaded.network.activation == "silu"


def test_its_metrics_are_those_of_the_test_runs(trained: Trained, rigid: Dataset) -> None:
    loaded = Surrogate.load(trained[1])
    test = rigid.select(trained[0].split.test)
    metrics = metrics_to_dict(force_metrics(loaded.reference_forces(test.inputs), test.forces))
    assert loaded.metrics["test"] == metrics


def test_its_detector_knows_the_training_rows_and_is_calibrated_on_validation_runs(
    trained: Trained, rigid: Dataset
) -> None:
    loaded, split = Surrogate.load(trained[1]), trained[0].split
    assert loaded.detector.mode == "rigid"
    assert loaded.detector.calibration_runs == len(split.validation)
    assert loaded.detector.low[7:] == pytest.approx(loaded.ranges.low)
    assert loaded.detector.high[7:] == pytest.approx(loaded.ranges.high)
    rows = rigid.select(split.train).inputs
    inside = np.mean([loaded.detector.detect(row).score <= 1 for row in rows[::7]])
    assert inside > 0.8
    far = rows[0].copy()
    far[0] = 500.0
    assert loaded.detector.detect(far).score > 1


def test_backends_take_it(trained: Trained, rigid: Dataset) -> None:
    expected = trained[0].surrogate.reference_forces(rigid.inputs)
    backend = make_backend("torch", mode="rigid", vehicle="m113", artifact=trained[1])
    assert np.all(np.abs(backend.forces(rigid.inputs) - expected) <= 1e-5 * rigid.forces.std(axis=0))


def test_a_soil_surrogate_is_one_of_soil(datasets: dict[str, Dataset], training_config: Config, tmp_path: Path) -> None:
    train_surrogate(datasets["soil"], training_config(activation="tanh"), tmp_path / "net.safetensors")
    loaded = Surrogate.load(tmp_path / "net.safetensors")
    assert (loaded.mode, loaded.network.activation) == ("soil", "tanh")
    assert loaded.network.widths[0] == 11


@pytest.mark.parametrize("activation", ["relu", "silu", "tanh"])
def test_dropout_is_trained_with_and_dropped(
    rigid: Dataset, training_config: Config, tmp_path: Path, activation: str
) -> None:
    changes = {"activation": activation, "perturbed_copies": 0, "epochs": 2}
    dry = train_surrogate(rigid, training_config(**changes), tmp_path / "dry.safetensors").surrogate
    config = training_config(**changes, dropout=0.5)
    result = train_surrogate(rigid, config, tmp_path / "wet.safetensors")
    loaded = Surrogate.load(tmp_path / "wet.safetensors")
    assert loaded.network.widths == dry.network.widths
    assert loaded.network.activation == activation
    assert loaded.network.packed() != dry.network.packed()
    # Validation, too, goes without dropout.
    best = min(entry.validation_loss for entry in result.history)
    assert validation_loss(result, rigid, config) == pytest.approx(best, rel=1e-4)


@pytest.mark.parametrize("name", ["net.pt", "net", "net.checkpoint"])
def test_an_artifact_of_another_name_is_refused_before_the_training(
    rigid: Dataset, training_config: Config, tmp_path: Path, name: str
) -> None:
    with pytest.raises(ArtifactError, match=r"\.safetensors"):
        train_surrogate(rigid, training_config(), tmp_path / name, report=interrupt_at(1))
    assert names(tmp_path) == []


# --- threads


@pytest.fixture
def two_threads() -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    yield
    torch.set_num_threads(before)


@pytest.mark.usefixtures("two_threads")
def test_torchs_threads_are_given_back(rigid: Dataset, training_config: Config, tmp_path: Path) -> None:
    seen: list[int] = []

    def report(entry: EpochReport) -> None:
        seen.append(torch.get_num_threads())
        if entry.epoch == 3:
            raise Interrupted

    config = training_config(perturbed_copies=0)
    with pytest.raises(Interrupted):
        train_surrogate(rigid, config, tmp_path / "net.safetensors", report=report)
    assert torch.get_num_threads() == 2
    train_surrogate(rigid, config, tmp_path / "net.safetensors", report=report)
    assert torch.get_num_threads() == 2
    assert seen == [1, 1, 1, 1]


def test_several_threads_train_as_well(
    rigid: Dataset, trained: Trained, training_config: Config, tmp_path: Path
) -> None:
    result = train_surrogate(rigid, training_config(), tmp_path / "net.safetensors", threads=2)
    losses, expected = ([entry.validation_loss for entry in r.history] for r in (result, trained[0]))
    assert losses == pytest.approx(expected, rel=1e-2)


@pytest.mark.parametrize("threads", [0, -1])
def test_no_threads_are_refused(rigid: Dataset, training_config: Config, tmp_path: Path, threads: int) -> None:
    with pytest.raises(InvalidInputError, match="threads"):
        train_surrogate(rigid, training_config(), tmp_path / "net.safetensors", threads=threads)


# --- what cannot be asked for


@pytest.mark.parametrize(
    "change",
    [
        {"hidden": ()},
        {"hidden": (8, 0)},
        {"activation": "gelu"},
        {"dropout": 1.0},
        {"dropout": -0.1},
        {"dropout": float("nan")},
        {"weight_decay": -1e-6},
        {"weight_decay": float("nan")},
        {"weight_decay": float("inf")},
        {"output_weights": (1.0, 1.0)},
        {"output_weights": (1.0, 1.0, -3.0)},
        {"output_weights": (1.0, 1.0, float("nan"))},
        {"output_weights": (0.0, 0.0, 0.0)},
        {"huber_delta": 0.0},
        {"huber_delta": float("nan")},
        {"learning_rate": 0.0},
        {"learning_rate": float("nan")},
        {"learning_rate": float("inf")},
        {"learning_rate_decay": 0.0},
        {"learning_rate_decay": 1.1},
        {"batch_size": 0},
        {"epochs": 0},
        {"patience": 0},
        {"plateau_patience": 0},
        {"plateau_factor": 0.0},
        {"plateau_factor": 1.0},
        {"perturbed_copies": -1},
        {"seed": -1},
    ],
    ids=str,
)
def test_impossible_recipes_are_refused(change: dict[str, Any]) -> None:
    with pytest.raises(InvalidInputError):
        TrainingConfig(**change)


def test_an_unknown_activation_comes_with_the_known() -> None:
    with pytest.raises(InvalidInputError, match="relu, silu, tanh"):
        TrainingConfig(activation="gelu")  # type: ignore[arg-type]
