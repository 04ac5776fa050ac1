"""How a surrogate is judged on runs that it has not seen: in all, by maneuver, in the tail and at its worst."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Final

import numpy as np

from ...terrain import OUTPUT_NAMES, FloatArray
from .dataset import Dataset
from .metrics import force_metrics, metrics_to_dict, worst_runs

_TAIL: Final = 99.9


def judge(predicted: FloatArray, unseen: Dataset) -> dict[str, Any]:
    """Return metrics as an artifact holds them.

    Parameters
    ----------
    predicted : ndarray, shape (n, 3)
        Forces for the dataset's inputs.
    unseen : Dataset
        Runs that were not trained on.

    Returns
    -------
    dict
        ``test``: metrics by output; ``maneuvers``: R² by maneuver and output, None where the output hardly varies;
        ``worst_run``: the run with the largest yaw-moment RMSE; ``mz_tail_share``: P99.9 of |Mz error| over the range
        of Mz.
    """
    maneuver_of = {record.run: record.maneuver for record in unseen.records}
    maneuvers = np.array([maneuver_of[run] for run in unseen.run_index.tolist()])
    by_maneuver = {}
    for name in sorted(set(maneuver_of.values())):
        rows = maneuvers == name
        parts = force_metrics(predicted[rows], unseen.forces[rows])
        by_maneuver[name] = {output: parts[output].r2 for output in OUTPUT_NAMES}
    worst = worst_runs(predicted, unseen.forces, unseen.run_index, unseen.records, count=1)[0]
    truth = unseen.forces[:, 2]
    spread = float(truth.max() - truth.min())
    tail = float(np.percentile(np.abs(predicted[:, 2] - truth), _TAIL))
    return {
        "test": metrics_to_dict(force_metrics(predicted, unseen.forces)),
        "maneuvers": by_maneuver,
        "worst_run": asdict(worst),
        "mz_tail_share": tail / spread if spread > 0 else 0.0,
    }
