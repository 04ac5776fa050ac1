"""Accuracy against time: physics on coarser grids and the shipped surrogates, on the same unseen rows."""

from __future__ import annotations

from statistics import median
from time import perf_counter
from typing import Any, Final

import numpy as np

from grouser.surrogate import NativeSurrogate, Surrogate
from grouser.surrogate.offline import Dataset, split_runs
from grouser.terrain import OUTPUT_NAMES, ForceBackend, make_backend

GRIDS: Final = ((2, 1), (4, 2), (8, 4), (16, 4), (32, 8))
_ROUNDS: Final = 9
_ROWS: Final = 4000


def pareto(dataset: Dataset, artifacts: dict[str, Surrogate]) -> dict[str, dict[str, Any]]:
    """Return R² against the logged forces, and ns a row in a batch of one thread, interleaved medians.

    The forces were logged from physics at 16 x 4 cells, which therefore has no error.
    """
    mode, vehicle = dataset.manifest.mode, dataset.vehicle
    test = dataset.select(split_runs(dataset.records).test)
    backends: dict[str, ForceBackend] = {
        f"physics {along} x {across}": make_backend("physics", mode=mode, vehicle=vehicle, cells=(along, across))
        for along, across in GRIDS
    }
    backends |= {name: NativeSurrogate(vehicle, mode, surrogate) for name, surrogate in artifacts.items()}
    rows = np.ascontiguousarray(test.inputs[:: max(1, len(test.inputs) // _ROWS)])
    times: dict[str, list[float]] = {name: [] for name in backends}
    for _ in range(_ROUNDS):
        for name, backend in backends.items():
            begin = perf_counter()
            backend.forces(rows)
            times[name].append((perf_counter() - begin) / len(rows) * 1e9)
    variance = test.forces.var(axis=0)
    made = {}
    for name, backend in backends.items():
        error = np.mean((backend.forces(test.inputs) - test.forces) ** 2, axis=0)
        r2 = dict(zip(OUTPUT_NAMES, (1 - error / variance).tolist(), strict=True))
        made[name] = {"r2": r2, "unexplained": float(np.max(error / variance)), "ns": median(times[name])}
    return made
