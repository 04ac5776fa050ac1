"""Regression metrics of predicted forces, by output and by run."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ...terrain import OUTPUT_NAMES, FloatArray, InvalidInputError
from .manifest import RunRecord

# Where an output hardly varies (straight motion has no Qy), R² compares noise with noise.
_MINIMUM_RELATIVE_SPREAD: Final = 1e-6


@dataclass(frozen=True)
class OutputMetrics:
    """Errors of one output in its own unit, and R²; None where the output does not vary."""

    rmse: float
    mae: float
    r2: float | None
    bias: float
    p95_abs: float
    max_abs: float


def output_metrics(predicted: FloatArray, truth: FloatArray, *, noise: float = 0.0) -> OutputMetrics:
    """Compare one output.

    Parameters
    ----------
    predicted, truth : ndarray, shape (n,)
        In the unit of the output.
    noise : float
        Standard deviation of the truth, in that unit, up to which it counts as not varying: R² is then None.

    Raises
    ------
    InvalidInputError
        If the shapes differ or there is nothing to compare.
    """
    if predicted.shape != truth.shape or truth.ndim != 1 or not len(truth):
        raise InvalidInputError(f"expected two arrays of one shape (n,), got {predicted.shape} and {truth.shape}")
    error = predicted - truth
    spread, scale = float(np.var(truth)), float(np.max(np.abs(truth)))
    varies = spread > max(noise, _MINIMUM_RELATIVE_SPREAD * scale) ** 2
    return OutputMetrics(
        rmse=float(np.sqrt(np.mean(error**2))),
        mae=float(np.mean(np.abs(error))),
        r2=1.0 - float(np.mean(error**2)) / spread if varies else None,
        bias=float(np.mean(error)),
        p95_abs=float(np.percentile(np.abs(error), 95)),
        max_abs=float(np.max(np.abs(error))),
    )


def force_metrics(predicted: FloatArray, truth: FloatArray) -> dict[str, OutputMetrics]:
    """Compare forces of shape (n, 3), output by output."""
    return {name: output_metrics(predicted[:, i], truth[:, i]) for i, name in enumerate(OUTPUT_NAMES)}


def metrics_to_dict(metrics: dict[str, OutputMetrics]) -> dict[str, dict[str, Any]]:
    """Return metrics as JSON can hold them."""
    return {name: asdict(values) for name, values in metrics.items()}


@dataclass(frozen=True)
class RunError:
    """Yaw-moment error of one run."""

    run: int
    maneuver: str
    mz_rmse: float
    mz_p95_abs: float
    mz_max_abs: float


def worst_runs(
    predicted: FloatArray,
    truth: FloatArray,
    run_index: NDArray[np.int64],
    records: tuple[RunRecord, ...],
    *,
    count: int = 3,
) -> list[RunError]:
    """Return the runs with the largest yaw-moment RMSE, worst first."""
    yaw = OUTPUT_NAMES.index("mz")
    errors = []
    for record in records:
        rows = run_index == record.run
        metrics = output_metrics(predicted[rows, yaw], truth[rows, yaw])
        errors.append(RunError(record.run, record.maneuver, metrics.rmse, metrics.p95_abs, metrics.max_abs))
    return sorted(errors, key=lambda error: (-error.mz_rmse, error.run))[:count]
