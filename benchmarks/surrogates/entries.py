"""The entries of the study: recipes on the same runs, judged on runs, maneuvers and ground that they have not seen."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from grouser.surrogate import Surrogate
from grouser.surrogate.offline import MANEUVERS, PRESETS, Dataset, TrainingConfig, split_runs, train_surrogate
from grouser.surrogate.offline.judgement import judge
from grouser.terrain import OUTPUT_NAMES, FloatArray

WIDTHS: Final = (8, 16, 32, 64)
#: Percentile of the strength parameter, μ or φ, below which ground counts as low traction.
LOW_TRACTION: Final = 20.0


@dataclass(frozen=True)
class Sizes:
    """What the study is run at: runs of the dataset, and epochs of both families."""

    runs: int
    structured_epochs: int
    plain_epochs: int


Entry = tuple[str, Callable[[], dict[str, Any]]]


def entries(dataset: Dataset, sizes: Sizes) -> Iterator[Entry]:
    """Yield name and computation of every entry of one mode."""
    mode = dataset.manifest.mode
    subset = dataset.select(record.run for record in dataset.records[: sizes.runs])
    structured = replace(
        PRESETS[f"m113-{mode}-paper"].training, epochs=sizes.structured_epochs, patience=sizes.structured_epochs
    )
    recipe = replace(PRESETS[f"m113-{mode}-paper-recipe"].training, epochs=sizes.plain_epochs)
    yield "ridge", lambda: ridge(subset)
    yield "paper recipe, 128 x 4", lambda: unseen_runs(subset, recipe)
    for width in WIDTHS:
        config = replace(structured, hidden=(width, width))
        yield f"structured, {width} x 2", lambda config=config: unseen_runs(subset, config)  # type: ignore[misc]
    alone = replace(structured, space_filling_rows=0)
    for maneuver in MANEUVERS:
        yield (
            f"structured, without {maneuver}",
            lambda maneuver=maneuver: unseen_maneuver(subset, structured, maneuver),  # type: ignore[misc]
        )
        yield (
            f"structured on trajectories alone, without {maneuver}",
            lambda maneuver=maneuver: unseen_maneuver(subset, alone, maneuver),  # type: ignore[misc]
        )
    yield "structured, without low traction", lambda: unseen_ground(subset, structured)
    yield "paper recipe, without prbs", lambda: unseen_maneuver(subset, recipe, "prbs")
    yield "paper recipe, without low traction", lambda: unseen_ground(subset, recipe)


def ridge(dataset: Dataset) -> dict[str, Any]:
    """Ridge regression on z-scored columns."""
    split = split_runs(dataset.records)
    train, test = dataset.select(split.train), dataset.select(split.test)
    mean, scale = train.inputs.mean(axis=0), train.inputs.std(axis=0)

    def design(x: FloatArray) -> FloatArray:
        return np.column_stack([(x - mean) / scale, np.ones(len(x))])

    a = design(train.inputs)
    weights = np.linalg.solve(a.T @ a + 1e-3 * len(a) * np.eye(a.shape[1]), a.T @ train.forces)
    return summary(judge(design(test.inputs) @ weights, test))


def unseen_runs(dataset: Dataset, config: TrainingConfig) -> dict[str, Any]:
    """Train on the training runs, judge on the test runs."""
    surrogate = trained(dataset, config)
    return summary(dict(surrogate.metrics)) | {"parameters": surrogate.network.parameter_count}


def unseen_maneuver(dataset: Dataset, config: TrainingConfig, maneuver: str) -> dict[str, Any]:
    """Train without a maneuver, judge on its runs."""
    held = [record.run for record in dataset.records if record.maneuver == maneuver]
    return held_out(dataset, config, held)


def unseen_ground(dataset: Dataset, config: TrainingConfig) -> dict[str, Any]:
    """Train without the ground of least friction, judge on it."""
    name = "mu" if dataset.manifest.mode == "rigid" else "phi"
    strength = np.array([float(record.terrain[name]) for record in dataset.records])
    limit = np.percentile(strength, LOW_TRACTION)
    held = [record.run for record, value in zip(dataset.records, strength, strict=True) if value <= limit]
    return held_out(dataset, config, held)


def held_out(dataset: Dataset, config: TrainingConfig, runs: list[int]) -> dict[str, Any]:
    """Train without some runs, judge on them."""
    kept = dataset.select(record.run for record in dataset.records if record.run not in set(runs))
    test = dataset.select(runs)
    return summary(judge(trained(kept, config).reference_forces(test.inputs), test))


def trained(dataset: Dataset, config: TrainingConfig) -> Surrogate:
    """Train one surrogate with one thread."""
    with TemporaryDirectory() as folder:
        return train_surrogate(dataset, config, Path(folder) / "entry.safetensors").surrogate


def summary(metrics: dict[str, Any]) -> dict[str, Any]:
    """Return R² by output, the tail and the worst run."""
    return {
        "r2": {output: metrics["test"][output]["r2"] for output in OUTPUT_NAMES},
        "mz_rmse": metrics["test"]["mz"]["rmse"],
        "mz_tail_share": metrics["mz_tail_share"],
        "worst_run_mz_rmse": metrics["worst_run"]["mz_rmse"],
    }
