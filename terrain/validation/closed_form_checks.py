"""Checks 1, 2, 3 and 6: the golden state, thrust, full-slip moments, lateral saturation."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from ..block import SHEAR_PATHS, ShearGrid, ShearPath
from ..closed_forms import locked_tracks_moment, matched_pivot_moment, straight_thrust
from ..errors import InvalidInputError
from ..interface import OUTPUTS, FloatArray
from ..parameters import RigidTerrain, SoilTerrain, Terrain
from ..vehicle import CONTACTS, TrackedVehicle
from .blocks import DEFAULT, FINE, Block
from .check import Check

_GOLDEN_ROW: Final = (3.0, 0.2, 0.3, 0.0, 0.0, 2.5, 3.8, 0.7, 0.0, 0.05)
_GOLDEN: Final[dict[ShearPath, tuple[float, float, float]]] = {
    "soft": (8138.6, -22584.2, 37624.7),
    "exact": (7449.3, -23585.7, 38735.8),
}
_GROUNDS: Final[tuple[Terrain, ...]] = (RigidTerrain(0.7, 0.0, 0.05), SoilTerrain(5e3, 0.5, 0.0, 0.05))
_SLIPS: Final = (-0.5, -0.05, 0.01, 0.05, 0.1, 0.2, 0.5, 0.9)
#: V and Vt in m/s near and far from V_ε.
_SPEEDS: Final = ((3.0, 3.2), (0.1, 0.15), (0.0, 0.05), (0.1, 0.05), (-2.0, -2.5), (0.02, -0.03))
#: Length and width of a track in m, thrust in kN as printed.
_WONG: Final = ((3.6, 1.0, 51.68), (4.5, 0.8, 52.45))
#: K in m at which every cell slides at its full strength.
SLIDING: Final = 1e-9
_TOLERANCES: Final = {FINE: 1e-5, DEFAULT: 2e-3}
_MU: Final = 0.7
_SYMBOLS: Final = {"qx": "Qx", "qy": "Qy", "mz": "Mz"}


def golden_state(block: Block) -> Iterator[Check]:
    """Yield the forces of one state of the M113, of which every figure is known."""
    vehicle = TrackedVehicle.preset("m113")
    for path in SHEAR_PATHS:
        grid = ShearGrid(*FINE, "continuous", path)
        forces = block.build(vehicle, "rigid", grid, 0.0).forces(np.array(_GOLDEN_ROW))
        for output, expected, measured in zip(OUTPUTS, _GOLDEN[path], forces, strict=True):
            yield Check(
                1, f"golden state of the M113, {path} path, {_cells(FINE)}", block.name, _SYMBOLS[output.name], output.unit,
                expected, float(measured), 0.05, "absolute", "independent sum over the same cells, half a printed digit",
            )  # fmt: skip


def thrust(block: Block, vehicle: TrackedVehicle) -> Iterator[Check]:
    """Yield how far the thrust on straight runs is from its closed form, without and with V_ε."""
    level = replace(vehicle, cg_offset=0.0)
    soft = vehicle.soft_speed or 0.1
    for cells, tolerance in _TOLERANCES.items():
        for name, soft_speed, speeds in (
            ("V_ε = 0", 0.0, [(4.0 * (1 - slip), 4.0) for slip in _SLIPS]),
            (f"V_ε = {soft:g} m/s", soft, [(10 * soft * vx, 10 * soft * vt) for vx, vt in _SPEEDS]),
        ):
            worst = max(
                _thrust_error(block, level, terrain, cells, soft_speed, vx, vt, path)
                for terrain in _GROUNDS
                for vx, vt in speeds
                for path in SHEAR_PATHS
            )
            yield Check(
                2, f"thrust on a straight run, {name}, both paths, {_cells(cells)}", block.name,
                "largest error of Qx over the closed form", "1", 0.0, worst, tolerance, "at most",
                "Janosi & Hanamoto 1961, integrated; rigid and soil, K 5 cm",
            )  # fmt: skip
    for length, width, printed in _WONG:
        tracked = wong_vehicle(length, width)
        force = block.build(tracked, "soil", ShearGrid(*FINE), 0.0).forces(wong_row())[0]
        yield Check(
            2, f"Wong's worked example, tracks {length} × {width} m", block.name, "thrust", "kN", printed,
            float(force) / 1e3, 0.005, "absolute", "Wong, Theory of Ground Vehicles, half a printed digit",
        )  # fmt: skip


def wong_vehicle(length: float, width: float) -> TrackedVehicle:
    """Return the vehicle of Wong's worked example: W 135 kN on tracks of this length and width in m."""
    m113 = TrackedVehicle.preset("m113")
    return replace(m113, name="wong", mass=135e3 / 9.81, contact_length=length, track_width=width, tread=2.5)


def wong_row(slip: float = 0.2) -> FloatArray:
    """Return the interface row of Wong's worked example: c 1 kPa, φ 19.7°, K 5 cm, belts at 1 m/s."""
    return np.array([1 - slip, 0, 0, 0, 0, 1.0, 1.0, 1e3, math.radians(19.7), 0.0, 0.05])


def full_slip_moments(block: Block, vehicle: TrackedVehicle) -> Iterator[Check]:
    """Yield the moments of a matched pivot and of locked tracks for K → 0."""
    level = replace(vehicle, cg_offset=0.0)
    omega = 0.5
    for name, belt, expected in (
        ("matched pivot", omega * level.tread / 2, matched_pivot_moment(level, _MU)),
        ("locked tracks", 0.0, locked_tracks_moment(level, _MU)),
    ):
        row = np.array([0, 0, omega, 0, 0, -belt, belt, _MU, 0.0, SLIDING])
        for cells, tolerance in _TOLERANCES.items():
            for path in SHEAR_PATHS:
                moments = [
                    -float(block.build(level, "rigid", ShearGrid(*cells, contact, path), level.soft_speed).forces(row)[2])
                    for contact in CONTACTS
                ]  # fmt: skip
                yield Check(
                    3, f"{name}, K → 0, {path} path, {_cells(cells)}", block.name, "resisting Mz", "N m", expected,
                    max(moments, key=lambda moment: abs(moment - expected)), tolerance, "relative",
                    "integral over the tracks, μ .7; the worse contact option",
                )  # fmt: skip


def lateral_saturation(block: Block, vehicle: TrackedVehicle) -> Iterator[Check]:
    """Yield force and moment of locked tracks that slide sideways, and whether a stopped belt is refused at V_ε = 0."""
    level = replace(vehicle, cg_offset=0.0)
    soft, k = vehicle.soft_speed or 0.1, 0.05
    vy = 20 * 2 * soft * k / level.contact_length
    for path in SHEAR_PATHS:
        backend = block.build(level, "rigid", ShearGrid(*DEFAULT, "continuous", path), soft)
        qx, qy, mz = backend.forces(np.array([0, vy, 0, 0, 0, 0, 0, _MU, 0.0, k])) / level.weight
        conditions = f"locked tracks, |Vy| L/(2 V_ε K) = 20, {path} path"
        for quantity, unit, expected, measured, tolerance in (
            ("−Qy/(μ W)", "1", 1.0, -qy / _MU, 1e-8),
            ("Qx/W", "1", 0.0, qx, 1e-12),
            ("Mz/W", "m", 0.0, mz, 1e-12),
        ):
            yield Check(
                6, conditions, block.name, quantity, unit, expected, float(measured), tolerance, "absolute",
                "friction bears μ W; e^−20 is 2e-9",
            )  # fmt: skip
        yield Check(
            6, f"a stopped belt at V_ε = 0, {path} path", block.name, "refused (1: yes)", "1", 1.0,
            float(_refuses_stopped_belts(block, level, ShearGrid(*DEFAULT, "continuous", path))), 0.0, "absolute",
            "its contact time is infinite",
        )  # fmt: skip


def printed_closed_forms(printed: Sequence[tuple[int, str, str, str, float, float, float]]) -> Iterator[Check]:
    """Yield closed forms against printed figures: (number, name, quantity, unit, printed, computed, half a digit)."""
    for number, name, quantity, unit, expected, measured, half_digit in printed:
        yield Check(
            number, name, "closed form", quantity, unit, expected, measured, half_digit, "absolute", "printed figure"
        )


def _cells(cells: tuple[int, int]) -> str:
    return f"{cells[0]} × {cells[1]} cells"


def _thrust_error(
    block: Block,
    vehicle: TrackedVehicle,
    terrain: Terrain,
    cells: tuple[int, int],
    soft_speed: float,
    vx: float,
    vt: float,
    path: ShearPath,
) -> float:
    """Error of the thrust over the thrust."""
    grid = ShearGrid(*cells, "continuous", path)
    row = np.array([vx, 0, 0, 0, 0, vt, vt, *terrain.parameters])
    expected = straight_thrust(vehicle, terrain, vx, vt, soft_speed)
    return abs(float(block.build(vehicle, terrain.mode, grid, soft_speed).forces(row)[0]) / expected - 1)


def _refuses_stopped_belts(block: Block, vehicle: TrackedVehicle, grid: ShearGrid) -> bool:
    backend = block.build(vehicle, "rigid", grid, 0.0)
    for belts in ((0.0, 3.0), (3.0, 0.0)):
        try:
            backend.forces(np.array([3.0, 0, 0, 0, 0, *belts, _MU, 0.0, 0.05]))
        except InvalidInputError:
            continue
        return False
    return True
