"""Accuracy against time: physics on every grid and both families at every width, on the same unseen rows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from statistics import median
from time import perf_counter
from typing import Any, Final

import numpy as np

from grouser.surrogate import NativeSurrogate, Surrogate, random_network
from grouser.surrogate.offline import Dataset, split_runs
from grouser.terrain import OUTPUT_NAMES, CompiledBackend, FloatArray, PhysicsBackend

from .entries import WIDTHS

GRIDS: Final = ((2, 1), (4, 2), (8, 4), (16, 4), (32, 8))
_ROUNDS: Final = 9
_ROWS: Final = 4000
_CALLS: Final = 4000


@dataclass(frozen=True)
class Contender:
    """A backend to be timed.

    Parameters
    ----------
    backend : CompiledBackend
        What is timed.
    r2 : mapping, optional
        R² where it was measured elsewhere: the backend then only has the shape of that network.
    """

    backend: CompiledBackend
    r2: Mapping[str, float] | None = None


def pareto(
    dataset: Dataset, artifacts: Mapping[str, Surrogate], entries: Mapping[str, Any]
) -> dict[str, dict[str, Any]]:
    """Return R² against the logged forces, ns of a single call in C, and ns a row in a batch; interleaved medians.

    The forces were logged from physics at 16 x 4 cells in float64, which therefore has no error. The R² of a width is
    that of its entry in the study, trained with fewer epochs than the shipped artifacts.
    """
    test = dataset.select(split_runs(dataset.records).test)
    contenders = _contenders(dataset, artifacts, entries)
    rows = np.ascontiguousarray(test.inputs[:: max(1, len(test.inputs) // _ROWS)])
    single: dict[str, list[float]] = {name: [] for name in contenders}
    batch: dict[str, list[float]] = {name: [] for name in contenders}
    for _ in range(_ROUNDS):
        for name, contender in contenders.items():
            single[name].append(contender.backend.kernel.time_calls(rows, _CALLS, False))
            begin = perf_counter()
            contender.backend.forces(rows)
            batch[name].append((perf_counter() - begin) / len(rows) * 1e9)
    made = {}
    for name, contender in contenders.items():
        r2 = contender.r2 or _explained(contender.backend, test.inputs, test.forces)
        times = {"ns": median(single[name]), "ns_in_a_batch": median(batch[name])}
        made[name] = {"r2": r2, "unexplained": 1.0 - min(r2.values())} | times
    return made


def _contenders(
    dataset: Dataset, artifacts: Mapping[str, Surrogate], entries: Mapping[str, Any]
) -> dict[str, Contender]:
    mode, vehicle = dataset.manifest.mode, dataset.vehicle
    made: dict[str, Contender] = {}
    for cells in GRIDS:
        for precision in ("float64", "float32"):
            name = f"physics {cells[0]} x {cells[1]}, {precision}"
            made[name] = Contender(PhysicsBackend(vehicle, mode, cells=cells, precision=precision))
    for name, surrogate in artifacts.items():
        made[name] = Contender(NativeSurrogate(vehicle, mode, surrogate))
    structured = next(surrogate for surrogate in artifacts.values() if surrogate.structured)
    inputs, *_, outputs = structured.network.widths
    for width in WIDTHS:
        network = random_network((inputs, width, width, outputs), "silu", np.random.default_rng(0))
        backend = NativeSurrogate(vehicle, mode, replace(structured, network=network))
        name = f"structured, {width} x 2"
        made[name] = Contender(backend, entries[name]["r2"])
    return made


def _explained(backend: CompiledBackend, inputs: FloatArray, forces: FloatArray) -> dict[str, float]:
    error = np.mean((backend.forces(inputs) - forces) ** 2, axis=0)
    return dict(zip(OUTPUT_NAMES, (1 - error / forces.var(axis=0)).tolist(), strict=True))
