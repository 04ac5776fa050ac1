"""A threshold that holds for whole runs: split conformal over run scores."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ..terrain import FloatArray, InvalidInputError

#: Percentile of a run's distances that scores the run.
RUN_PERCENTILE: Final = 99.0


def run_scores(distance: FloatArray, run_index: NDArray[Any]) -> FloatArray:
    """Return the 99th percentile of each run's distances, in order of run index.

    The percentile is a sample, not a value between two: a run has more than 1 % of its samples beyond a threshold
    exactly if its score is.

    Parameters
    ----------
    distance : ndarray, shape (n,)
        Distance of each sample.
    run_index : ndarray, shape (n,)
        Run of each sample.
    """
    runs = np.unique(run_index)
    return np.array([np.percentile(distance[run_index == run], RUN_PERCENTILE, method="inverted_cdf") for run in runs])


def conformal_threshold(run_scores: FloatArray, alpha: float) -> tuple[float, bool]:
    """Return the ⌈(n + 1)(1 − α)⌉-th smallest of n run scores, and whether there are that many.

    A fresh run, exchangeable with these, scores above it with probability at most α. With fewer runs than the rank
    the largest score is returned.

    Raises
    ------
    InvalidInputError
        If there is no score or alpha does not lie in (0, 1).
    """
    if not 0.0 < alpha < 1.0:
        raise InvalidInputError(f"alpha must lie in (0, 1), got {alpha!r}")
    ordered = np.sort(np.asarray(run_scores, dtype=np.float64))
    if ordered.ndim != 1 or ordered.size == 0 or not np.isfinite(ordered).all():
        raise InvalidInputError(f"expected finite run scores of shape (n,), got {ordered.shape}")
    # 60 · 0.95 is 57.000000000000007 in floating point, and its rank 57.
    rank = math.ceil((ordered.size + 1) * (1.0 - alpha) - 1e-9)
    return float(ordered[min(rank, ordered.size) - 1]), rank <= ordered.size
