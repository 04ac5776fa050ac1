"""How far forces are from the physics on a grid beyond doubt: what has to stand beside a time before it means anything."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Final

import numpy as np

from ...envs import BeltCommand, Simulator, VehicleState
from ...terrain import OUTPUT_NAMES, FloatArray, ForceBackend, named
from .calls import STRUCTURED, grid_name
from .subjects import GRIDS, Subjects
from .timing import Section

#: Name of the largest of the three errors.
WORST: Final = "worst"
_BEYOND_DOUBT: Final = (64, 16)
_GROUNDS: Final = ("asphalt", "concrete-steel", "gravel", "ice", "snow-packed")
_SPEEDS: Final = (1.0, 4.0, 8.0)
_DRIVES: Final = tuple(product(_GROUNDS, _SPEEDS))
_COMMANDS, _TICKS = 10, 30


def varied_rows(subjects: Subjects, drives: Sequence[tuple[str, float]] = _DRIVES) -> FloatArray:
    """Return rows of drives with belts that jump, shape (n, 10), all inside the shipped surrogate's distribution.

    Parameters
    ----------
    subjects : Subjects
        The vehicle, and the guard that says what is inside.
    drives : sequence of (str, float)
        Ground and speed in m/s, of which the belts' commands stay within 30 %.
    """
    generator, driven = np.random.default_rng(11), []
    for ground, speed in drives:
        simulator = Simulator(subjects.vehicle, "physics", named(ground), state=VehicleState.rolling(speed))
        for _ in range(_COMMANDS):
            command = BeltCommand(*(speed * generator.uniform(0.7, 1.3, 2)))
            driven += [simulator.step(command).row for _ in range(_TICKS)]
    rows = np.array(driven)
    return np.ascontiguousarray(rows[~subjects.guarded.out_of_distribution(rows)])


def accuracies(subjects: Subjects, rows: FloatArray) -> Section:
    """Return the errors of the physics on every grid and of the structured surrogate, by output, and the worst.

    Parameters
    ----------
    subjects : Subjects
        Ours.
    rows : ndarray, shape (n, 10)
        To judge them on.
    """
    section = Section(
        "% of the standard deviation of the force",
        f"Root mean square of what the force is away from that of the physics on {grid_name(_BEYOND_DOUBT)} cells an "
        f"element, over {len(rows):,} ticks of {len(_DRIVES)} drives with belts that jump, on {len(_GROUNDS)} grounds.",
    )
    exact = subjects.physics(_BEYOND_DOUBT).forces(rows)
    judged: dict[str, ForceBackend] = {grid_name(grid): subjects.physics(grid) for grid in GRIDS}
    for case, backend in (judged | {STRUCTURED: subjects.structured}).items():
        error = 100 * np.sqrt(np.mean((backend.forces(rows) - exact) ** 2, axis=0)) / exact.std(axis=0)
        for output, value in zip(OUTPUT_NAMES, error.tolist(), strict=True):
            section.add(case, output, value)
        section.add(case, WORST, float(error.max()))
    return section
