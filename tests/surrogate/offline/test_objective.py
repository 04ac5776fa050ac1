"""What each family is fitted to, and the schedule that it is fitted by."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from grouser.surrogate import DenseNetwork, Normalizer, Surrogate, random_network, torch_module
from grouser.surrogate.offline.dataset import Dataset
from grouser.surrogate.offline.objective import Objective, make_objective
from grouser.surrogate.offline.preparation import training_rows, whitening
from grouser.surrogate.offline.split import split_runs
from grouser.surrogate.offline.training import EpochReport, TrainingResult, train_surrogate
from grouser.surrogate.offline.training_config import TrainingConfig
from grouser.terrain import FloatArray, InvalidInputError, Mode, PhysicsBackend, TrackedVehicle, reference_forces

Config = Callable[..., TrainingConfig]
Make = Callable[..., Surrogate]
Rows = Callable[..., tuple[FloatArray, Any]]
Trained = tuple[TrainingResult, Path]


class Interrupted(Exception):
    """Stands for Ctrl-C."""


def available(surrogate: Surrogate, x: FloatArray) -> FloatArray:
    """Shear that the ground has to offer, by sliding sideways on it for good: the block's own, shape (n, 1)."""
    sliding = x.copy()
    sliding[:, [0, 2, 5, 6]] = 0.0
    sliding[:, 1] = 100.0
    sliding[:, -1] = 1e-7
    return -reference_forces(surrogate.vehicle, surrogate.mode, sliding)[:, 1:2]


# --- the error is that of the assembled model


@pytest.mark.parametrize("mode", ["rigid", "soil"])
@pytest.mark.parametrize("name", ["m113", "marder", "warthog"])
def test_structured_errors_are_those_of_the_surrogate_over_the_available_shear(
    make_structured: Make, driving_rows: Rows, name: str, mode: Mode
) -> None:
    vehicle = replace(TrackedVehicle.preset(name), cg_offset=0.05)
    surrogate = make_structured(mode, vehicle=vehicle)
    x, _ = driving_rows(vehicle, mode, runs=4, samples=50, seed=2)
    x[150:, 3:5] *= 8.0  # wheels and tracks off the ground
    x[-1, [0, 1, 2, 5, 6]] = 0.0
    forces = PhysicsBackend(vehicle, mode).forces(x) + np.random.default_rng(0).normal(0.0, 500.0, (200, 3))
    objective = make_objective(TrainingConfig(family="structured", hidden=(32, 24)), vehicle, mode, x, forces)
    assert objective.widths == (10, 32, 24, 3 * vehicle.road_wheels)
    assert objective.feature_map == "track"
    given = forces.copy()
    batch = objective.tensors(x, forces)
    np.testing.assert_array_equal(forces, given)
    assert all(part.dtype == torch.float32 and len(part) == 200 for part in batch)
    errors = objective.errors(torch_module(surrogate.network), batch).detach().numpy()
    assembled = replace(
        surrogate,
        network=objective.finished(surrogate.network),
        input_normalizer=objective.input_normalizer,
        output_normalizer=objective.output_normalizer,
    )
    scale = 0.02 * available(surrogate, x) * np.array([1.0, 1.0, vehicle.contact_length / 4])
    expected = (assembled.reference_forces(x) - forces) / scale
    assert np.all(np.abs(expected).max(axis=0) > 1)
    # float32: parts of the output's size.
    assert np.all(np.abs(errors - expected) <= 1e-5 * np.abs(expected).max(axis=0))


def test_a_model_without_fault_has_no_error(make_structured: Make, driving_rows: Rows) -> None:
    surrogate = make_structured()
    x, _ = driving_rows(surrogate.vehicle, "rigid", runs=3, samples=50, seed=2)
    objective = make_objective(TrainingConfig(family="structured"), surrogate.vehicle, "rigid", x, np.zeros((150, 3)))
    exact = replace(
        surrogate, input_normalizer=objective.input_normalizer, output_normalizer=objective.output_normalizer
    )
    batch = objective.tensors(x, exact.reference_forces(x))
    errors = objective.errors(torch_module(surrogate.network), batch).detach().numpy()
    assert np.abs(errors).max() < 1e-4  # of 2 % of the available shear: float32
    other = torch_module(make_structured(seed=2).network)
    assert np.abs(objective.errors(other, batch).detach().numpy()).max() > 0.1


@pytest.mark.parametrize("whiten", [True, False])
def test_plain_errors_are_those_of_the_surrogate_over_the_spread(
    make_surrogate: Make, driving_rows: Rows, whiten: bool
) -> None:
    surrogate = make_surrogate()
    x, _ = driving_rows(surrogate.vehicle, "rigid", runs=4, samples=50, seed=2)
    forces = PhysicsBackend(surrogate.vehicle, "rigid").forces(x)
    config = TrainingConfig(hidden=(32, 24), whiten=whiten)
    objective = make_objective(config, surrogate.vehicle, "rigid", x, forces)
    assert (objective.widths, objective.feature_map) == ((10, 32, 24, 3), "interface")
    errors = objective.errors(torch_module(surrogate.network), objective.tensors(x, forces)).detach().numpy()
    assembled = replace(
        surrogate,
        network=objective.finished(surrogate.network),
        input_normalizer=objective.input_normalizer,
        output_normalizer=objective.output_normalizer,
    )
    expected = (assembled.reference_forces(x) - forces) / forces.std(axis=0)
    # The whitening is folded into the first layer in float32, where small differences hang on it.
    assert np.all(np.abs(errors - expected) <= 1e-4 * np.abs(expected).max(axis=0))


def test_structured_features_are_normalized_over_both_tracks(driving_rows: Rows) -> None:
    vehicle = TrackedVehicle.preset("m113")
    x, _ = driving_rows(vehicle, "rigid", runs=4, samples=50, seed=2)
    objective = make_objective(TrainingConfig(family="structured"), vehicle, "rigid", x, np.zeros((200, 3)))
    features = objective.tensors(x, np.zeros((200, 3)))[0].double().numpy()
    assert features.shape == (200, 2, 10)
    np.testing.assert_allclose(features.mean(axis=(0, 1)), 0.0, atol=1e-6)
    np.testing.assert_allclose(features.std(axis=(0, 1)), 1.0, rtol=1e-6)


def test_the_mirror_image_adds_no_rows_to_a_structured_training(rigid: Dataset, training_config: Config) -> None:
    plain, structured = (
        training_rows(rigid, training_config(family=family, perturbed_copies=0))[0]
        for family in ("plain", "structured")
    )
    assert (len(plain), len(structured)) == (4 * len(rigid.inputs), 2 * len(rigid.inputs))


# --- training

#: A fifth of a second.
SMALL: dict[str, Any] = {"schedule": "cosine", "epochs": 12, "batch_size": 128}


@pytest.fixture(scope="module")
def structured(tmp_path_factory: pytest.TempPathFactory, rigid: Dataset, training_config: Config) -> Trained:
    path = tmp_path_factory.mktemp("structured") / "small.safetensors"
    return train_surrogate(rigid, training_config(family="structured", **SMALL), path), path


def relative_errors(result: TrainingResult, dataset: Dataset) -> FloatArray:
    """Root-mean-square error of each output on the test runs, over its spread."""
    test = dataset.select(result.split.test)
    error = result.surrogate.reference_forces(test.inputs) - test.forces
    relative: FloatArray = np.sqrt(np.mean(error**2, axis=0)) / test.forces.std(axis=0)
    return relative


def test_a_structured_training_beats_a_plain_one_of_the_same_width_by_far(
    rigid: Dataset, structured: Trained, training_config: Config, tmp_path: Path
) -> None:
    other = train_surrogate(rigid, training_config(**SMALL), tmp_path / "plain.safetensors")
    assert structured[0].split == other.split
    assert structured[0].surrogate.network.widths[1:-1] == other.surrogate.network.widths[1:-1]
    found, plain = (relative_errors(result, rigid) for result in (structured[0], other))
    assert np.all(found < plain / 5), (found, plain)  # measured a fourteenth and less


@pytest.mark.parametrize("mode", ["rigid", "soil"])
def test_training_adds_to_what_the_shear_points_know_of_its_rows(
    datasets: dict[str, Dataset], training_config: Config, tmp_path: Path, mode: str
) -> None:
    config = training_config(family="structured", **SMALL | {"epochs": 30}, hidden=(16, 16))
    result = train_surrogate(datasets[mode], config, tmp_path / "net.safetensors")
    trained, train = result.surrogate, datasets[mode].select(result.split.train)
    size = trained.output_normalizer.size
    silent = DenseNetwork("silu", (np.zeros((10, size), np.float32),), (np.zeros(size, np.float32),))
    scale = available(trained, train.inputs) * np.array([1.0, 1.0, trained.vehicle.contact_length / 4])
    found, alone = (
        np.sqrt(np.mean(((each.reference_forces(train.inputs) - train.forces) / scale) ** 2))
        for each in (trained, replace(trained, network=silent))
    )
    assert found < 0.7 * alone, (found, alone)


def test_two_structured_trainings_give_the_same_bytes(
    rigid: Dataset, structured: Trained, training_config: Config, tmp_path: Path
) -> None:
    torch.manual_seed(99)
    again = train_surrogate(rigid, training_config(family="structured", **SMALL), tmp_path / "a.safetensors")
    assert (tmp_path / "a.safetensors").read_bytes() == structured[1].read_bytes()
    assert again.history == structured[0].history


def test_the_artifact_of_a_structured_training_says_so(structured: Trained, rigid: Dataset) -> None:
    loaded = Surrogate.load(structured[1])
    assert loaded.structured
    assert loaded.network.widths == (10, 8, 8, 15)
    assert loaded.content_hash == structured[0].surrogate.content_hash
    assert (loaded.recipe["family"], loaded.recipe["schedule"]) == ("structured", "cosine")
    assert loaded.detector.low[7:] == pytest.approx(loaded.ranges.low)
    rest = rigid.inputs[:5].copy()
    rest[:, [0, 1, 2, 5, 6]] = 0.0
    assert np.all(loaded.reference_forces(rest) == 0)


def test_a_plain_training_is_the_textbooks(rigid: Dataset, training_config: Config, tmp_path: Path) -> None:
    """Adam on the weighted Huber loss of whitened, normalized rows, written out."""
    config = training_config(epochs=2, patience=5)
    result = train_surrogate(rigid, config, tmp_path / "net.safetensors")
    assert result.surrogate.feature_map == "interface"
    inputs, forces = training_rows(rigid.select(result.split.train), config)
    columns = Normalizer.fit(inputs).normalize(inputs)
    coordinates = whitening(columns)
    rows = torch.tensor(columns @ coordinates, dtype=torch.float32)
    targets = torch.tensor(Normalizer.fit(forces).normalize(forces), dtype=torch.float32)
    module = torch_module(random_network((10, 8, 8, 3), "silu", np.random.default_rng(config.seed)))
    adam = torch.optim.Adam(module.parameters(), lr=config.learning_rate)
    huber = torch.nn.HuberLoss(reduction="none")
    losses = []
    for epoch in range(2):
        torch.manual_seed(int(np.random.SeedSequence((config.seed, epoch)).generate_state(1)[0]))
        losses.append(0.0)
        for batch in torch.split(torch.randperm(len(rows)), config.batch_size):
            adam.zero_grad()
            loss = (huber(module(rows[batch]), targets[batch]) * torch.tensor([1.0, 1.0, 3.0])).sum(dim=1).mean()
            loss.backward()
            adam.step()
            losses[-1] += loss.item() * len(batch) / len(rows)
    assert [entry.improved for entry in result.history] == [True, True]
    assert [entry.train_loss for entry in result.history] == pytest.approx(losses, rel=1e-4)
    first, *others = DenseNetwork.from_torch(module).weights
    folded: list[FloatArray] = [coordinates @ first, *(weights.astype(float) for weights in others)]
    for found, expected in zip(result.surrogate.network.weights, folded, strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(expected).max())


# --- the schedule

COSINE: dict[str, Any] = {"schedule": "cosine", "epochs": 20, "perturbed_copies": 0, "symmetries": False}


def rates(dataset: Dataset, config: TrainingConfig, output: Path) -> list[float]:
    return [entry.learning_rate for entry in train_surrogate(dataset, config, output).history]


@pytest.mark.parametrize("family", ["plain", "structured"])
def test_the_cosine_rises_over_a_tenth_and_falls_to_nothing(
    rigid: Dataset, training_config: Config, tmp_path: Path, family: str
) -> None:
    config = training_config(**COSINE, family=family, batch_size=10_000)
    found = rates(rigid, config, tmp_path / "net.safetensors")
    # One step an epoch, taken at its start.
    done = np.arange(20) / 20
    falling = config.learning_rate * (1 + np.cos(math.pi * (done - 0.1) / 0.9)) / 2
    assert found[2:] == pytest.approx(falling[2:], rel=1e-9)
    assert found[2] == config.learning_rate == max(found)
    assert 0 < found[0] < found[1] == pytest.approx(config.learning_rate / 2)
    assert found[-1] < 0.01 * config.learning_rate


def test_the_cosine_goes_on_within_an_epoch(rigid: Dataset, training_config: Config, tmp_path: Path) -> None:
    config = training_config(**COSINE | {"epochs": 2}, batch_size=64)
    found = rates(rigid, config, tmp_path / "net.safetensors")
    count = len(rigid.select(split_runs(rigid.records, seed=0).train).inputs)
    last = (math.ceil(count / 64) - 1) / math.ceil(count / 64)
    # What is reported is the rate of an epoch's last step.
    done = (np.array([0, 1]) + last) / 2
    assert found == pytest.approx(config.learning_rate * (1 + np.cos(math.pi * (done - 0.1) / 0.9)) / 2, rel=1e-9)


@pytest.mark.parametrize("epochs", [[1], [2, 7], [12]], ids=str)
def test_an_interrupted_cosine_ends_at_the_same_bytes(
    rigid: Dataset, structured: Trained, training_config: Config, tmp_path: Path, epochs: list[int]
) -> None:
    config, output = training_config(family="structured", **SMALL), tmp_path / "net.safetensors"

    def interrupt(entry: EpochReport) -> None:
        if entry.epoch == epochs[0]:
            epochs.pop(0)
            raise Interrupted

    last = epochs[-1]
    while epochs:
        with pytest.raises(Interrupted):
            train_surrogate(rigid, config, output, report=interrupt)
    rest = train_surrogate(rigid, config, output)
    assert output.read_bytes() == structured[1].read_bytes()
    assert rest.history == structured[0].history[last:]


@pytest.mark.parametrize(
    ("change", "known"),
    [
        ({"family": "dense"}, "plain, structured"),
        ({"schedule": "step"}, "plateau, cosine"),
        ({"family": None}, "plain"),
    ],
)
def test_an_unknown_family_or_schedule_comes_with_the_known(change: dict[str, Any], known: str) -> None:
    (name,) = change
    with pytest.raises(InvalidInputError, match=f"{name} must be one of {known}"):
        TrainingConfig(**change)


def test_objectives_follow_the_family(driving_rows: Rows) -> None:
    vehicle = TrackedVehicle.preset("m113")
    x, _ = driving_rows(vehicle, "rigid", runs=2, samples=20)
    made: dict[str, Objective] = {
        family: make_objective(TrainingConfig(family=family), vehicle, "rigid", x, np.ones((40, 3)))
        for family in ("plain", "structured")
    }
    assert {family: each.feature_map for family, each in made.items()} == {"plain": "interface", "structured": "track"}
