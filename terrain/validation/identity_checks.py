"""Checks 7 and 8: power and loads, and the symmetries, at random states of both modes and both contact options."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import Final

import numpy as np

from ..block import SHEAR_PATHS, ShearGrid
from ..interface import MODES, FloatArray, Interface, Mode, interface, mirror_forces, reverse_forces
from ..vehicle import CONTACTS, TrackedVehicle
from .blocks import DEFAULT, Block
from .cells import shear_cells
from .check import Check
from .states import random_states

_TOLERANCE: Final = 1e-12
#: Factor on every velocity; no power of two, so that every velocity is rounded.
_FACTOR: Final = 3.0
_CASES: Final = tuple(product(MODES, CONTACTS, SHEAR_PATHS))


def power_identity(block: Block, vehicle: TrackedVehicle, count: int) -> Iterator[Check]:
    """Yield the residual of the power balance of the shear forces, and the least slip power of a cell."""
    residuals, least = [], []
    for mode, contact, path in _CASES:
        grid = ShearGrid(6, 3, contact, path)
        x = random_states(vehicle, mode, count)
        x[:, interface(mode).index("fr")] = 0.0
        backend = block.build(vehicle, mode, grid, vehicle.soft_speed)
        tracks, total = backend.track_forces(x, x), backend.forces(x)
        lost = shear_cells(vehicle, mode, x, grid=grid, soft_speed=vehicle.soft_speed).slip_power
        driven, received = x[:, 5:7] * tracks[:, :, 0], x[:, :3] * total
        flow = np.abs(driven).sum(axis=1) + np.abs(received).sum(axis=1) + lost.sum(axis=1)
        balance = driven.sum(axis=1) - received.sum(axis=1) - lost.sum(axis=1)
        residuals.append(float(np.max(np.abs(balance) / flow)))
        least.append(float(lost.min()))
    yield Check(
        7, f"VtL F_L + VtR F_R = Qx Vx + Qy Vy + Mz ω + P_slip, {_where(count)}", block.name,
        "largest residual over the sum of the terms' sizes", "1", 0.0, max(residuals), _TOLERANCE, "at most",
        "energy balance; P_slip from separate cells",
    )  # fmt: skip
    yield Check(
        7, f"no cell drives the vehicle, {_where(count)}", block.name, "largest −P_slip of a cell", "W", 0.0,
        max(-min(least), 0.0), 0.0, "at most", "shear opposes sliding",
    )  # fmt: skip


def load_sums(block: Block, vehicle: TrackedVehicle, count: int) -> Iterator[Check]:
    """Yield ΣN/W at any acceleration, weighed by friction at full slip and by rolling resistance."""
    x = random_states(vehicle, "rigid", count)
    mu, fr, vt = 0.7, 0.05, 3.0
    rows = np.zeros((count, interface("rigid").size))
    rows[:, 3:5] = x[:, 3:5]
    rows[:, 0] = rows[:, 5] = rows[:, 6] = vt
    rows[:, 7:] = mu, fr, 1e-9
    rolling = rows.copy()
    rows[:, 1] = 1.0
    worst = {"full slip sideways": 0.0, "rolling resistance": 0.0}
    for path, contact in product(SHEAR_PATHS, CONTACTS):
        backend = block.build(vehicle, "rigid", ShearGrid(*DEFAULT, contact, path), 0.0)
        by_friction = -backend.forces(rows)[:, 1] / (mu * vehicle.weight)
        by_rolling = -backend.forces(rolling)[:, 0] / (fr * vehicle.weight)
        for name, measured in zip(worst, (by_friction, by_rolling), strict=True):
            worst[name] = max(worst[name], float(np.abs(measured - 1).max()))
    for name, error in worst.items():
        yield Check(
            7, f"sum of the loads, weighed by {name}, {count} accelerations to 20 m/s², each contact and path",
            block.name, "largest |ΣN/W − 1|", "1", 0.0, error, _TOLERANCE, "at most", "equilibrium",
        )  # fmt: skip


def symmetries(block: Block, vehicle: TrackedVehicle, count: int) -> Iterator[Check]:
    """Yield how far the block is from mirror, fore-aft and scaling symmetry."""
    names = ["mirror"] + (["fore-aft"] if vehicle.cg_offset == 0 else []) + ["scaling"]
    texts = {
        "mirror": "left and right exchanged",
        "fore-aft": "front and rear exchanged",
        "scaling": f"velocities times {_FACTOR:g} at V_ε = 0",
    }
    for name in names:
        worst = max(
            _asymmetry(block, vehicle, name, mode, ShearGrid(*DEFAULT, contact, path), count)
            for mode, contact, path in _CASES
        )
        yield Check(
            8, f"{texts[name]}, {_where(count)}", block.name,
            "largest difference over W and W (L + B)/2", "1", 0.0, worst, _TOLERANCE, "at most", "symmetry of the equations",
        )  # fmt: skip


def _asymmetry(block: Block, vehicle: TrackedVehicle, name: str, mode: Mode, grid: ShearGrid, count: int) -> float:
    table, x = interface(mode), random_states(vehicle, mode, count)
    backend = block.build(vehicle, mode, grid, 0.0 if name == "scaling" else vehicle.soft_speed)
    changed, expected = _transformed(table, name, x, backend.forces(x))
    arm = (vehicle.contact_length + vehicle.tread) / 2
    scale = vehicle.weight * np.array([1.0, 1.0, arm])
    # Soil bears more than friction does: cohesion over the whole area.
    if mode == "soil":
        scale = scale * (1 + x[:, 7:8] * 2 * vehicle.contact_length * vehicle.track_width / vehicle.weight)
    return float(np.max(np.abs(backend.forces(changed) - expected) / scale))


def _transformed(table: Interface, name: str, x: FloatArray, forces: FloatArray) -> tuple[FloatArray, FloatArray]:
    if name == "mirror":
        return table.mirror(x), mirror_forces(forces)
    if name == "fore-aft":
        return table.reverse(x), reverse_forces(forces)
    scaled = x.copy()
    scaled[:, [0, 1, 2, 5, 6]] *= _FACTOR
    return scaled, forces


def _where(count: int) -> str:
    return f"{count} random states of each mode, contact and path"
