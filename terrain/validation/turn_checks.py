"""Checks 4 and 5: the steady skid turn for K → 0, and turning resistance against the empirical curve."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from ..block import SHEAR_PATHS, ShearGrid
from ..closed_forms import (
    locked_tracks_moment,
    matched_pivot_moment,
    skid_turn_slip,
    straight_thrust,
    turning_resistance,
)
from ..interface import FloatArray
from ..parameters import RigidTerrain, SoilTerrain
from ..steady import steady_turn
from ..vehicle import TrackedVehicle
from .blocks import DEFAULT, Block
from .cells import shear_cells
from .check import Check
from .closed_form_checks import printed_closed_forms, wong_vehicle

#: L/B, and λ as printed.
_SKID_TURNS: Final = ((1.0, 0.20073), (1.25, 0.27705), (1.5, 0.35917), (2.0, 0.53300))
#: Radii in m over which the empirical curve is compared.
RADII: Final = tuple(float(radius) for radius in np.geomspace(5.0, 100.0, 41))
# So slow that the centripetal acceleration is nothing; V_ε = 0, so that only ratios of velocities matter.
_CRAWL: Final = 1e-3


def printed_figures() -> Iterator[Check]:
    """Yield the closed forms themselves against printed figures."""
    m113, soil = TrackedVehicle.preset("m113"), SoilTerrain(1e3, np.radians(19.7), 0.0, 0.05)
    yield from printed_closed_forms(
        [
            (2, "Wong's worked example, tracks 3.6 × 1.0 m", "thrust", "kN", 51.68,
             straight_thrust(wong_vehicle(3.6, 1.0), soil, 0.8, 1.0) / 1e3, 0.005),
            (2, "Wong's worked example, tracks 4.5 × 0.8 m", "thrust", "kN", 52.45,
             straight_thrust(wong_vehicle(4.5, 0.8), soil, 0.8, 1.0) / 1e3, 0.005),
            (3, "matched pivot of the M113, μ .7", "resisting Mz", "N m", 52_955, matched_pivot_moment(m113, 0.7), 0.5),
            (3, "locked tracks of the M113, μ .7", "resisting Mz", "N m", 101_864, locked_tracks_moment(m113, 0.7), 0.5),
            *((4, f"steady skid turn, L/B {ratio:g}", "λ = 2u/(ωL)", "1", printed, skid_turn_slip(ratio), 5e-6)
              for ratio, printed in _SKID_TURNS),
        ]
    )  # fmt: skip


def skid_turns(block: Block, *, along: int = 800) -> Iterator[Check]:
    """Yield λ of steady turns of a line track for K → 0 against the solution of Steeds and Merritt."""
    m113 = TrackedVehicle.preset("m113")
    for ratio, _ in _SKID_TURNS:
        line = replace(m113, track_width=1e-6, tread=m113.contact_length / ratio)
        for path in SHEAR_PATHS:
            backend = block.build(line, "rigid", ShearGrid(along, 1, "continuous", path), 0.0)
            turn = steady_turn(backend, RigidTerrain(0.7, 0.0, 1e-6), _CRAWL, 10.0)
            inner, outer = turn.sliding
            slip = (outer - inner) / (turn.yaw_rate * line.contact_length)
            yield Check(
                4, f"steady skid turn of a line track, L/B {ratio:g}, K 1 µm, {path} path", block.name, "λ = 2u/(ωL)",
                "1", skid_turn_slip(ratio), float(slip), 1e-5, "absolute", "Merritt 1939, Steeds 1950",
            )  # fmt: skip


@dataclass(frozen=True, eq=False)
class TurningResistance:
    """μ_t/μ = 4 M_r/(μ W L) over radius, in slow steady turns without rolling resistance; it does not depend on μ.

    Parameters
    ----------
    radii : ndarray, shape (n,)
        R in m.
    by_thrust : ndarray, shape (n,)
        M_r = (F_outer − F_inner) B/2, as it is measured: what the belts' thrusts hold in balance. That is
        −Σ (M + y_track Fx) of the tracks.
    by_lateral_force : ndarray, shape (n,)
        M_r = −Σ x dFy over the cells: the moment of the lateral forces alone. Some 3 % less for the M113, since across
        the width of a track longitudinal forces resist the turn, too, by Σ (y − y_track) dFx.
    """

    radii: FloatArray
    by_thrust: FloatArray
    by_lateral_force: FloatArray


def turning_resistance_curve(
    block: Block, vehicle: TrackedVehicle, k: float, grid: ShearGrid, radii: Sequence[float] = RADII
) -> TurningResistance:
    """Return the turning resistance of a vehicle on firm ground of given K in m."""
    mu = 0.7
    backend = block.build(vehicle, "rigid", grid, 0.0)
    terrain = RigidTerrain(mu, 0.0, k)
    rows = np.array([steady_turn(backend, terrain, _CRAWL, radius).row for radius in radii])
    thrust = backend.track_forces(rows, rows)[:, :, 0]
    lateral = shear_cells(vehicle, "rigid", rows, grid=grid, soft_speed=0.0).lateral_moment
    full_slip = mu * vehicle.weight * vehicle.contact_length / 4
    by_thrust = (thrust[:, 1] - thrust[:, 0]) * vehicle.tread / 2 / full_slip
    return TurningResistance(np.asarray(radii), by_thrust, -lateral / full_slip)


def empirical_curve(vehicle: TrackedVehicle, radii: Sequence[float] = RADII) -> FloatArray:
    """Return μ_t/μ_max = 1/(0.925 + 0.15 R/B) at the radii in m."""
    return np.array([turning_resistance(1.0, radius, vehicle.tread) for radius in radii])


def turning_resistances(block: Block, radii: Sequence[float] = RADII) -> Iterator[Check]:
    """Yield how far the exact continuous model of the M113 is from the empirical turning resistance."""
    m113 = TrackedVehicle.preset("m113")
    for k in (0.052, 0.055):
        curve = turning_resistance_curve(block, m113, k, ShearGrid(*DEFAULT, "continuous", "exact"), radii)
        empirical = empirical_curve(m113, radii)
        deviation, lateral = (np.abs(made / empirical - 1).max() for made in (curve.by_thrust, curve.by_lateral_force))
        yield Check(
            5, f"turning resistance of the M113, {len(radii)} radii of 5-100 m, exact path, continuous, K {1e3 * k:g} mm", block.name,
            "largest |deviation| of μ_t by thrust", "1", 0.0, float(deviation), 0.06,
            "at most", "empirical μ_max/(0.925 + 0.15 R/B); trials of the model 4-6 %; "
            f"with M_r by the lateral forces alone it is {lateral:.3f}",
        )  # fmt: skip
