"""What rounding does to the forces, on the rows that the shipped artifacts were tested on."""

from __future__ import annotations

from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np

from grouser.surrogate import Surrogate
from grouser.surrogate.offline import DataConfig, RunRecord, split_runs
from grouser.surrogate.offline.generate import draw_run, simulate_run
from grouser.terrain import OUTPUT_NAMES, FloatArray, make_backend, resolve_vehicle

from .backend import backend
from .formats import FLOAT32, FORMATS, Format

# So that the layers of a wide network in NumPy stay in the cache.
_ROWS_AT_ONCE: Final = 4096


class Rows(NamedTuple):
    """Logged ticks.

    Parameters
    ----------
    inputs : ndarray, shape (n, d)
        What the block received.
    forces : ndarray, shape (n, 3)
        What it returned.
    """

    inputs: FloatArray
    forces: FloatArray


@cache
def logged_rows(config: DataConfig) -> Rows:
    """Return the test runs of a dataset, driven again: a run is a function of the recipe and its own number."""
    vehicle = resolve_vehicle(config.vehicle)
    records = [
        RunRecord(run, draw_run(config, vehicle, run)[1].name, {}, {}, config.samples_per_run, 0)
        for run in range(config.runs)
    ]
    teacher = make_backend(config.teacher, mode=config.mode, vehicle=vehicle)
    driven = [simulate_run(config, teacher, run) for run in split_runs(records).test]
    return Rows(np.concatenate([run.inputs for run in driven]), np.concatenate([run.forces for run in driven]))


def accuracy(surrogate: Surrogate, rows: Rows) -> dict[str, dict[str, Any]]:
    """Return the errors of a surrogate in every format.

    Parameters
    ----------
    surrogate : Surrogate
        In float32.
    rows : Rows
        To judge it on.

    Returns
    -------
    dict
        By format: ``nrmse`` by output, the root mean square of force less logged force over the standard deviation of
        the latter; ``largest deviation`` by output, of the force from that of the float32 network, over the same.
    """
    spread = rows.forces.std(axis=0)
    exact = _forces(surrogate, FLOAT32, rows.inputs)
    found = {}
    for name, kind in FORMATS.items():
        forces = _forces(surrogate, kind, rows.inputs)
        error = np.sqrt(np.mean((forces - rows.forces) ** 2, axis=0)) / spread
        deviation = np.abs(forces - exact).max(axis=0) / spread
        found[name] = {"nrmse": _by_output(error), "largest deviation": _by_output(deviation)}
    return found


def _forces(surrogate: Surrogate, kind: Format, inputs: FloatArray) -> FloatArray:
    evaluated = backend(surrogate, kind)
    parts = np.split(inputs, range(_ROWS_AT_ONCE, len(inputs), _ROWS_AT_ONCE))
    return np.concatenate([evaluated.forces(part) for part in parts])


def _by_output(values: FloatArray) -> dict[str, float]:
    return dict(zip(OUTPUT_NAMES, values.tolist(), strict=True))
