"""Checks 9 and 10: grid convergence, and the agreement of forces, track forces and Jacobians."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import product
from typing import Final

import numpy as np

from ..backend import assemble
from ..block import SHEAR_PATHS, ShearGrid
from ..interface import MODES, FloatArray, Mode
from ..vehicle import CONTACTS, TrackedVehicle
from .blocks import COMPILED, DEFAULT, Block
from .check import Check
from .states import driven_states, random_states, without_corners

#: Cells that the grids are compared with.
FINEST: Final = (80, 40)
#: Root-mean-square difference to the finest grid over the output's standard deviation: published lower and upper end.
BANDS: Final = {(2, 1): (0.011, 0.048), (8, 4): (0.0009, 0.0024), (16, 4): (0.0003, 0.0030), (32, 8): (0.0001, 0.0007)}


def grid_differences(
    block: Block, vehicle: TrackedVehicle, mode: Mode, x: FloatArray, grids: tuple[tuple[int, int], ...]
) -> FloatArray:
    """Return the rms difference of [Qx, Qy, Mz] to the finest grid over their standard deviation, shape (grids, 3)."""

    def forces(cells: tuple[int, int]) -> FloatArray:
        return block.build(vehicle, mode, ShearGrid(*cells, vehicle.contact), vehicle.soft_speed).forces(x)

    finest = forces(FINEST)
    spread = finest.std(axis=0)
    return np.array([np.sqrt(np.mean((forces(cells) - finest) ** 2, axis=0)) / spread for cells in grids])


def grid_convergence(block: Block, vehicle: TrackedVehicle, count: int) -> Iterator[Check]:
    """Yield the worst difference of each grid to 80 × 40 cells at driven states."""
    worst = np.max(
        [
            grid_differences(block, vehicle, mode, driven_states(vehicle, mode, count), tuple(BANDS)).max(axis=1)
            for mode in MODES
        ],
        axis=0,
    )
    for (along, across), measured in zip(BANDS, worst, strict=True):
        low, high = BANDS[along, across]
        yield Check(
            9, f"{along} × {across} cells against 80 × 40, soft path, {count} driven states of each mode", block.name,
            "rms difference over std, worst output", "1", 0.0, float(measured), high, "at most",
            f"published band {100 * low:g}-{100 * high:g} %",
        )  # fmt: skip


def parity(block: Block, vehicle: TrackedVehicle, count: int) -> Iterator[Check]:
    """Yield how far a block is from the compiled one, over each output's standard deviation."""
    worst = 0.0
    for mode, contact, path in product(MODES, CONTACTS, SHEAR_PATHS):
        x = random_states(vehicle, mode, count)
        grid = ShearGrid(*DEFAULT, contact, path)
        compiled = COMPILED.build(vehicle, mode, grid, vehicle.soft_speed).forces(x)
        difference = np.abs(block.build(vehicle, mode, grid, vehicle.soft_speed).forces(x) - compiled)
        worst = max(worst, float(np.max(difference / compiled.std(axis=0))))
    yield Check(
        10, f"forces against the compiled block, {count} random states of each mode, contact and path", block.name,
        "largest difference over std", "1", 0.0, worst, 1e-9, "at most", "two implementations of the same sums",
    )  # fmt: skip


def track_split(block: Block, vehicle: TrackedVehicle, count: int) -> Iterator[Check]:
    """Yield whether forces are the sum of the track forces."""
    worst = 0.0
    for mode, contact, path in product(MODES, CONTACTS, SHEAR_PATHS):
        x = random_states(vehicle, mode, count)
        backend = block.build(vehicle, mode, ShearGrid(*DEFAULT, contact, path), vehicle.soft_speed)
        difference = np.abs(assemble(backend.track_forces(x, x)) - backend.forces(x))
        worst = max(worst, float(difference.max() / vehicle.weight))
    yield Check(
        10, f"forces are the sum of the track forces, {count} random states of each mode, contact and path", block.name,
        "largest difference over W, W × 1 m", "1", 0.0, worst, 0.0, "at most", "definition",
    )  # fmt: skip


def jacobian(block: Block, oracle: Block, vehicle: TrackedVehicle, count: int) -> Iterator[Check]:
    """Yield how far analytic slopes are from extrapolated central differences of the oracle, off the corners."""
    for path in SHEAR_PATHS:
        worst = 0.0
        for mode, contact in product(MODES, CONTACTS):
            x = without_corners(vehicle, driven_states(vehicle, mode, count))
            grid = ShearGrid(3, 2, contact, path)
            backend = oracle.build(vehicle, mode, grid, vehicle.soft_speed)
            _, analytic = block.build(vehicle, mode, grid, vehicle.soft_speed).forces_and_jacobian(x)
            numeric = np.stack([_slope(backend.forces, x, column) for column in range(x.shape[1])], axis=-1)
            scale = np.abs(analytic).max(axis=0)
            scale = np.maximum(scale, 1e-9 * scale.max(axis=0))
            worst = max(worst, float(np.max(np.abs(analytic - numeric) / scale)))
        yield Check(
            10, f"analytic Jacobian, {path} path, driven states of each mode and contact off the corners", block.name,
            "largest difference over the column's largest slope", "1", 0.0, worst, 1e-6, "at most",
            "central differences of the NumPy block, extrapolated",
        )  # fmt: skip


def _slope(forces: Callable[[FloatArray], FloatArray], x: FloatArray, column: int) -> FloatArray:
    """Return ∂Q/∂x_column by two central differences, extrapolated to fourth order."""
    step = np.zeros(x.shape[1])
    step[column] = 1e-5 * min(float(np.abs(x[:, column]).max()), 10 * float(x[:, column].std()))

    def slope(width: float) -> FloatArray:
        return np.asarray((forces(x + width * step) - forces(x - width * step)) / (2 * width * step[column]))

    return np.asarray((4 * slope(0.5) - slope(1.0)) / 3)
