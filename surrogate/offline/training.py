"""Train a surrogate of the block: weighted Huber on normalized data, early stopping, reduce-on-plateau."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from ...terrain import (
    ArtifactError,
    FloatArray,
    InvalidInputError,
    parameter_ranges,
)
from ..artifact import SUFFIX, Surrogate
from ..detector import BoxMahalanobisDetector
from ..network import DenseNetwork, random_network, torch_module
from ..normalizer import Normalizer
from ..threads import torch_threads
from .checkpoint import TrainingState, load_checkpoint, save_checkpoint
from .dataset import Dataset
from .judgement import judge
from .objective import Objective, make_objective
from .preparation import training_rows
from .split import RunSplit, split_runs
from .training_config import TrainingConfig


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

# Share of all steps over which the cosine schedule rises.
_WARM_UP: Final = 0.1


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
    inputs, forces = training_rows(train, config)
    objective = make_objective(config, dataset.vehicle, dataset.manifest.mode, inputs, forces)
    with torch_threads(threads):
        network, history = optimize(
            config,
            objective,
            [(inputs, forces), (validation.inputs, validation.forces)],
            output.with_suffix(".checkpoint"),
            {"config": asdict(config), "dataset": dataset.manifest.content_hash},
            report,
        )
    ranges = parameter_ranges(dataset.manifest.ranges, dataset.manifest.mode)
    detector = BoxMahalanobisDetector.fit(
        train.inputs,
        train.run_index,
        Normalizer.fit(inputs),
        ranges,
        dataset.vehicle,
        calibration=(validation.inputs, validation.run_index),
    )
    draft = Surrogate(
        vehicle=dataset.vehicle,
        mode=dataset.manifest.mode,
        network=network,
        input_normalizer=objective.input_normalizer,
        output_normalizer=objective.output_normalizer,
        detector=detector,
        ranges=ranges,
        range_name=dataset.manifest.ranges,
        recipe={**asdict(config), "split": split.to_dict(), "teacher": dict(dataset.manifest.backend)},
        dataset_hash=dataset.manifest.content_hash,
        metrics={},
        feature_map=objective.feature_map,
    )
    surrogate = draft.with_metrics(judge(draft.reference_forces(test.inputs), test))
    surrogate.save(output)
    output.with_suffix(".checkpoint").unlink(missing_ok=True)
    return TrainingResult(surrogate, split, tuple(history))


def optimize(
    config: TrainingConfig,
    objective: Objective,
    sides: list[tuple[FloatArray, FloatArray]],
    checkpoint: Path,
    identity: dict[str, Any],
    report: Report | None,
) -> tuple[DenseNetwork, list[EpochReport]]:
    """Fit a network to an objective, going on from the checkpoint if there is one.

    Parameters
    ----------
    config : TrainingConfig
        The recipe.
    objective : Objective
        What is fitted to what.
    sides : list of tuple of ndarray
        Inputs and forces of the training and of the validation rows.
    checkpoint : Path
        Written after every epoch.
    identity : dict
        What a checkpoint must be of, as JSON can hold it.
    report : callable, optional
        Called after each epoch.
    """
    import torch

    rows, held_out = (objective.tensors(inputs, forces) for inputs, forces in sides)
    count = len(rows[0])
    module = _initial_module(objective, config)
    optimizer = torch.optim.Adam(module.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay)
    weights = torch.tensor(config.output_weights)

    def loss_of(batch: Sequence[Any]) -> Any:
        errors = objective.errors(module, batch)
        zeros = torch.zeros_like(errors)
        element = torch.nn.functional.huber_loss(errors, zeros, reduction="none", delta=config.huber_delta)
        return (element * weights).sum(dim=1).mean()

    state = load_checkpoint(checkpoint, module, optimizer, identity) or TrainingState(rate=config.learning_rate)
    history: list[EpochReport] = []
    while state.epoch < config.epochs and state.stale < config.patience:
        module.train()
        torch.manual_seed(np.random.SeedSequence((config.seed, state.epoch)).generate_state(1)[0].item())
        total = 0.0
        batches = torch.split(torch.randperm(count), config.batch_size)
        for index, batch in enumerate(batches):
            rate = _rate(config, state, index / len(batches))
            for group in optimizer.param_groups:
                group["lr"] = rate
            optimizer.zero_grad(set_to_none=True)
            loss = loss_of([part[batch] for part in rows])
            loss.backward()
            optimizer.step()
            total += float(loss.detach()) * len(batch)
        module.eval()
        with torch.inference_mode():
            validation_loss = float(loss_of(held_out))
        improved = validation_loss < state.best_loss
        state = state.after(
            validation_loss,
            module,
            plateau_patience=config.plateau_patience,
            plateau_factor=config.plateau_factor,
            decay=config.learning_rate_decay,
        )
        save_checkpoint(checkpoint, state, module, optimizer, identity)
        entry = EpochReport(state.epoch, config.epochs, total / count, validation_loss, rate, improved)
        history.append(entry)
        if report:
            report(entry)
    module.load_state_dict(state.best_parameters)
    return objective.finished(DenseNetwork.from_torch(module)), history


def _rate(config: TrainingConfig, state: TrainingState, share: float) -> float:
    """Return the learning rate at a share of the state's epoch."""
    if config.schedule == "plateau":
        return state.rate
    done = (state.epoch + share) / config.epochs
    if done < _WARM_UP:
        return config.learning_rate * max(done, _WARM_UP / 20) / _WARM_UP
    return config.learning_rate * (1.0 + math.cos(math.pi * (done - _WARM_UP) / (1.0 - _WARM_UP))) / 2


def _initial_module(objective: Objective, config: TrainingConfig) -> Any:
    """Return the network at its random start, with dropout behind every activation."""
    import torch

    plain = torch_module(random_network(objective.widths, config.activation, np.random.default_rng(config.seed)))
    if objective.corrects:
        for parameters in plain[-1].parameters():
            torch.nn.init.zeros_(parameters)
    if config.dropout == 0:
        return plain
    parts: list[Any] = []
    for part in plain:
        parts.append(part)
        if not isinstance(part, torch.nn.Linear):
            parts.append(torch.nn.Dropout(config.dropout))
    return torch.nn.Sequential(*parts)
