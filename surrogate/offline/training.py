"""Train a surrogate of the block: weighted Huber on normalized data, early stopping, reduce-on-plateau."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from ...terrain import (
    OUTPUT_NAMES,
    ArtifactError,
    FloatArray,
    InvalidInputError,
    mirror_forces,
    parameter_ranges,
    reverse_forces,
)
from ..artifact import SUFFIX, Surrogate
from ..detector import BoxMahalanobisDetector
from ..network import ACTIVATIONS, Activation, DenseNetwork, random_network, torch_module
from ..normalizer import Normalizer
from ..threads import torch_threads
from .checkpoint import TrainingState, load_checkpoint, save_checkpoint
from .dataset import Dataset
from .metrics import force_metrics, metrics_to_dict
from .perturbation import perturbed_rows
from .split import RunSplit, split_runs

# Below this share of a column's variance a direction is rounding, not data.
_FLAT_VARIANCE: Final = 1e-8


@dataclass(frozen=True)
class TrainingConfig:
    """A training recipe, stored in the artifact.

    Parameters
    ----------
    hidden : tuple of int
        Hidden layer widths.
    activation : {"relu", "silu", "tanh"}
        Between layers.
    dropout : float
        In [0, 1).
    weight_decay : float
        L2 penalty.
    output_weights : tuple of float
        Huber weights of Qx, Qy, Mz.
    huber_delta : float
        In standard deviations.
    learning_rate : float
        Of Adam, at the start.
    learning_rate_decay : float
        What the learning rate is multiplied by after every epoch, in (0, 1]; short trainings need it.
    batch_size : int
        Samples a step.
    epochs : int
        At most.
    patience : int
        Epochs without improvement before training stops.
    plateau_patience : int
        Epochs without improvement before the learning rate falls.
    plateau_factor : float
        What it falls by.
    perturbed_copies : int
        Copies of each training row with perturbed velocities, for which the teacher is asked again; see
        :mod:`grouser.surrogate.offline.perturbation`.
    symmetries : bool
        Whether training rows are joined by their mirror images and, where the CG is centred, their fore-aft
        reversals: the block has both symmetries exactly.
    whiten : bool
        Whether the first layer is trained in whitened coordinates, then folded back to normalized ones. Belt speeds
        nearly follow the body, and the forces hang on the small differences, which gradients otherwise hardly see.
    seed : int
        Of split, initial weights, shuffling and dropout.

    Raises
    ------
    InvalidInputError
        If a value is impossible.
    """

    hidden: tuple[int, ...] = (128, 128)
    activation: Activation = "silu"
    dropout: float = 0.0
    weight_decay: float = 0.0
    output_weights: tuple[float, float, float] = (1.0, 1.0, 3.0)
    huber_delta: float = 1.0
    learning_rate: float = 2e-3
    learning_rate_decay: float = 1.0
    batch_size: int = 1024
    epochs: int = 60
    patience: int = 20
    plateau_patience: int = 4
    plateau_factor: float = 0.5
    perturbed_copies: int = 2
    symmetries: bool = True
    whiten: bool = True
    seed: int = 0

    def __post_init__(self) -> None:
        positive = ("huber_delta", "learning_rate", "batch_size", "epochs", "patience", "plateau_patience")
        for name in positive:
            if not 0 < getattr(self, name) < math.inf:
                raise InvalidInputError(f"{name} must be positive and finite, got {getattr(self, name)}")
        whole = ("batch_size", "epochs", "patience", "plateau_patience", "perturbed_copies", "seed")
        for name, value in [*((name, getattr(self, name)) for name in whole), *(("hidden", w) for w in self.hidden)]:
            if isinstance(value, bool) or not isinstance(value, int):
                raise InvalidInputError(f"{name} must be a whole number, got {value!r}")
        if not self.hidden or any(width < 1 for width in self.hidden):
            raise InvalidInputError(f"hidden needs at least one positive width, got {self.hidden}")
        if not 0 < self.learning_rate_decay <= 1:
            raise InvalidInputError(f"learning_rate_decay must lie in (0, 1], got {self.learning_rate_decay}")
        if self.perturbed_copies < 0:
            raise InvalidInputError(f"perturbed_copies must not be negative, got {self.perturbed_copies}")
        if self.activation not in ACTIVATIONS:
            raise InvalidInputError(f"activation must be one of {', '.join(ACTIVATIONS)}, got {self.activation!r}")
        if (
            not 0 <= self.dropout < 1
            or not 0 <= self.weight_decay < math.inf
            or not 0 < self.plateau_factor < 1
            or self.seed < 0
        ):
            raise InvalidInputError("dropout in [0, 1), plateau_factor in (0, 1), weight_decay and seed not negative")
        finite = len(self.output_weights) == 3 and all(0 <= weight < math.inf for weight in self.output_weights)
        if not finite or not any(self.output_weights):
            raise InvalidInputError(
                f"output_weights are three finite numbers of at least 0, not all 0; got {self.output_weights}"
            )


@dataclass(frozen=True)
class EpochReport:
    """What one epoch did.

    Parameters
    ----------
    epoch, epochs : int
        This one, from 1, and the most there can be.
    train_loss, validation_loss : float
        Weighted Huber.
    learning_rate : float
        During the epoch.
    improved : bool
        Whether the validation loss is the lowest so far.
    """

    epoch: int
    epochs: int
    train_loss: float
    validation_loss: float
    learning_rate: float
    improved: bool


Report = Callable[[EpochReport], None]


@dataclass(frozen=True, eq=False)
class TrainingResult:
    """A trained surrogate with what it was judged on.

    Parameters
    ----------
    surrogate : Surrogate
        As it was saved.
    split : RunSplit
        Runs by side.
    history : tuple of EpochReport
        Epochs of this call; those before an interruption were reported then.
    """

    surrogate: Surrogate
    split: RunSplit
    history: tuple[EpochReport, ...] = field(default=())


def train_surrogate(
    dataset: Dataset, config: TrainingConfig, output: Path, *, report: Report | None = None, threads: int = 1
) -> TrainingResult:
    """Train on a dataset's training runs and write the artifact.

    Interrupted, it goes on from the last whole epoch when called again with the same dataset and configuration, and
    ends at the same weights. With one thread, equal inputs give equal bits.

    Parameters
    ----------
    dataset : Dataset
        With at least three runs of each maneuver.
    config : TrainingConfig
        The recipe.
    output : Path
        The ``.safetensors`` artifact; beside it, while training, a ``.checkpoint``.
    report : callable, optional
        Called after each epoch.
    threads : int
        Of torch; more than one gives up the promise of equal bits.

    Raises
    ------
    InvalidInputError
        If a maneuver has too few runs to split, or there is no thread.
    ArtifactError
        If the output's name does not end in ``.safetensors``, or the checkpoint beside it is of another training.
    """
    if output.suffix != SUFFIX:
        raise ArtifactError(f"an artifact's name ends in {SUFFIX}, got {output.name!r}")
    if threads < 1:
        raise InvalidInputError(f"threads must be at least 1, got {threads}")
    split = split_runs(dataset.records, seed=config.seed)
    train, validation, test = (dataset.select(side) for side in (split.train, split.validation, split.test))
    inputs, forces = _training_rows(train, config)
    input_normalizer, output_normalizer = Normalizer.fit(inputs), Normalizer.fit(forces)
    with torch_threads(threads):
        network, history = _optimize(
            config,
            [
                (input_normalizer.normalize(x), output_normalizer.normalize(y))
                for x, y in ((inputs, forces), (validation.inputs, validation.forces))
            ],
            output.with_suffix(".checkpoint"),
            {"config": asdict(config), "dataset": dataset.manifest.content_hash},
            report,
        )
    ranges = parameter_ranges(dataset.manifest.ranges, dataset.manifest.mode)
    detector = BoxMahalanobisDetector.fit(
        train.inputs,
        train.run_index,
        input_normalizer,
        ranges,
        dataset.vehicle,
        calibration=(validation.inputs, validation.run_index),
    )
    draft = Surrogate(
        vehicle=dataset.vehicle,
        mode=dataset.manifest.mode,
        network=network,
        input_normalizer=input_normalizer,
        output_normalizer=output_normalizer,
        detector=detector,
        ranges=ranges,
        range_name=dataset.manifest.ranges,
        recipe={**asdict(config), "split": split.to_dict(), "teacher": dict(dataset.manifest.backend)},
        dataset_hash=dataset.manifest.content_hash,
        metrics={},
    )
    metrics = force_metrics(draft.reference_forces(test.inputs), test.forces)
    surrogate = replace(draft, metrics={"test": metrics_to_dict(metrics)})
    surrogate.save(output)
    output.with_suffix(".checkpoint").unlink(missing_ok=True)
    return TrainingResult(surrogate, split, tuple(history))


def _training_rows(train: Dataset, config: TrainingConfig) -> tuple[FloatArray, FloatArray]:
    generator = np.random.default_rng((config.seed, len(train.inputs)))
    beside, beside_forces = perturbed_rows(train, config.perturbed_copies, generator)
    inputs, forces = np.concatenate([train.inputs, beside]), np.concatenate([train.forces, beside_forces])
    return with_symmetries(train, inputs, forces) if config.symmetries else (inputs, forces)


def with_symmetries(dataset: Dataset, inputs: FloatArray, forces: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return rows and forces joined by their mirror images and, with a centred CG, their fore-aft reversals."""
    table = dataset.interface
    inputs, forces = np.concatenate([inputs, table.mirror(inputs)]), np.concatenate([forces, mirror_forces(forces)])
    if dataset.vehicle.cg_offset == 0:
        inputs, forces = (
            np.concatenate([inputs, table.reverse(inputs)]),
            np.concatenate([forces, reverse_forces(forces)]),
        )
    return inputs, forces


def _optimize(
    config: TrainingConfig,
    sides: list[tuple[FloatArray, FloatArray]],
    checkpoint: Path,
    identity: dict[str, Any],
    report: Report | None,
) -> tuple[DenseNetwork, list[EpochReport]]:
    import torch

    coordinates = whitening(sides[0][0]) if config.whiten else np.eye(sides[0][0].shape[1])
    (x, y), (x_validation, y_validation) = (
        tuple(torch.from_numpy(array.astype(np.float32)) for array in (inputs @ coordinates, outputs))
        for inputs, outputs in sides
    )
    module = _initial_module((x.shape[1], *config.hidden, len(OUTPUT_NAMES)), config)
    optimizer = torch.optim.Adam(module.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay)
    weights = torch.tensor(config.output_weights)

    def loss_of(inputs: Any, targets: Any) -> Any:
        element = torch.nn.functional.huber_loss(module(inputs), targets, reduction="none", delta=config.huber_delta)
        return (element * weights).sum(dim=1).mean()

    state = load_checkpoint(checkpoint, module, optimizer, identity) or TrainingState(rate=config.learning_rate)
    history: list[EpochReport] = []
    while state.epoch < config.epochs and state.stale < config.patience:
        for group in optimizer.param_groups:
            group["lr"] = state.rate
        module.train()
        torch.manual_seed(np.random.SeedSequence((config.seed, state.epoch)).generate_state(1)[0].item())
        order = torch.randperm(len(x))
        total = 0.0
        for batch in torch.split(order, config.batch_size):
            optimizer.zero_grad(set_to_none=True)
            loss = loss_of(x[batch], y[batch])
            loss.backward()
            optimizer.step()
            total += float(loss.detach()) * len(batch)
        module.eval()
        with torch.inference_mode():
            validation_loss = float(loss_of(x_validation, y_validation))
        rate, improved = state.rate, validation_loss < state.best_loss
        state = state.after(
            validation_loss,
            module,
            plateau_patience=config.plateau_patience,
            plateau_factor=config.plateau_factor,
            decay=config.learning_rate_decay,
        )
        save_checkpoint(checkpoint, state, module, optimizer, identity)
        entry = EpochReport(state.epoch, config.epochs, total / len(x), validation_loss, rate, improved)
        history.append(entry)
        if report:
            report(entry)
    module.load_state_dict(state.best_parameters)
    trained = DenseNetwork.from_torch(module)
    first, *others = trained.weights
    return replace(trained, weights=((coordinates @ first).astype(np.float32), *others)), history


def whitening(z: FloatArray) -> FloatArray:
    """Return the symmetric matrix that turns normalized rows (n, d) to unit covariance; flat directions stay."""
    variance, directions = np.linalg.eigh(np.cov(z, rowvar=False))
    gain = np.where(variance > _FLAT_VARIANCE, 1.0 / np.sqrt(np.maximum(variance, _FLAT_VARIANCE)), 1.0)
    matrix: FloatArray = (directions * gain) @ directions.T
    return matrix


def _initial_module(widths: tuple[int, ...], config: TrainingConfig) -> Any:
    """Return the network at its random start, with dropout behind every activation."""
    import torch

    plain = torch_module(random_network(widths, config.activation, np.random.default_rng(config.seed)))
    if config.dropout == 0:
        return plain
    parts: list[Any] = []
    for part in plain:
        parts.append(part)
        if not isinstance(part, torch.nn.Linear):
            parts.append(torch.nn.Dropout(config.dropout))
    return torch.nn.Sequential(*parts)
