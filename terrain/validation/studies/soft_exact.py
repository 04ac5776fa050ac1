"""How far the soft path is from the exact one, over turn radius, slip and K."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from ...block import SHEAR_PATHS, ShearGrid
from ...interface import OUTPUT_NAMES, FloatArray
from ...vehicle import TrackedVehicle
from ..blocks import COMPILED, DEFAULT
from .study import Data, Study
from .style import OUTPUT_LABELS, new_figure, plain_ticks

_MODULI: Final = (0.01, 0.025, 0.055)
_SLIPS: Final = (0.0025, 0.005, 0.01, 0.015, 0.02, 0.03, 0.04, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5)
_MU: Final = 0.7
_SPEED: Final = 3.0
# The slip axis is linear up to this, in percent, and logarithmic beyond.
_LINEAR: Final = 2.0


def compute(vehicle: TrackedVehicle, quick: bool = False) -> dict[str, Any]:
    """Return (soft − exact)/(μ W) for Qx and Qy, /(μ W L/4) for Mz, over K, slip and radius of a left turn.

    Both tracks have the same slip i = 1 − V_track/Vt at their centrelines; Vy = 0, uniform pressure, V_ε = 0, no
    rolling resistance: states, not steady turns.
    """
    radii = np.geomspace(2.0, 100.0, 9 if quick else 31)
    slips = np.array([*(-slip for slip in reversed(_SLIPS)), 0.0, *_SLIPS])
    scale = _MU * vehicle.weight * np.array([1.0, 1.0, vehicle.contact_length / 4])
    backends = [COMPILED.build(vehicle, "rigid", ShearGrid(*DEFAULT, "continuous", path), 0.0) for path in SHEAR_PATHS]
    maps, straight = {}, 0.0
    for k in _MODULI:
        soft, exact = (backend.forces(_rows(vehicle, radii, slips, k)) for backend in backends)
        share = ((soft - exact) / scale).reshape(len(slips), len(radii), 3)
        maps[f"{k:g}"] = {name: share[:, :, index].tolist() for index, name in enumerate(OUTPUT_NAMES)}
        soft, exact = (backend.forces(_rows(vehicle, np.array([np.inf]), slips, k)) for backend in backends)
        straight = max(straight, float(np.abs((soft - exact) / scale).max()))
    return {
        "vehicle": vehicle.name,
        "radius_m": radii.tolist(),
        "slip": slips.tolist(),
        "k": list(_MODULI),
        "difference": maps,
        "largest_on_straight_runs": straight,
    }


def _rows(vehicle: TrackedVehicle, radii: FloatArray, slips: FloatArray, k: float) -> FloatArray:
    slip, radius = (grid.ravel() for grid in np.meshgrid(slips, radii, indexing="ij"))
    yaw_rate = _SPEED / radius
    rows = np.zeros((len(slip), 10))
    rows[:, 0], rows[:, 2] = _SPEED, yaw_rate
    for column, y in ((5, vehicle.tread / 2), (6, -vehicle.tread / 2)):
        rows[:, column] = (_SPEED - yaw_rate * y) / (1 - slip)
    rows[:, 7:] = _MU, 0.0, k
    return rows


def draw(data: Data) -> Any:
    """Draw nine maps: a row for each output, with its own symmetric scale, and a column for each K."""
    figure = new_figure(10.5, 8.6)
    axes = figure.subplots(3, 3, sharex=True, sharey=True)
    radius, slip = np.array(data["radius_m"]), 100 * np.array(data["slip"])
    units = ("$\\mu W$", "$\\mu W$", "$\\mu W L/4$")
    for row, (name, symbol, unit) in enumerate(zip(OUTPUT_NAMES, OUTPUT_LABELS, units, strict=True)):
        maps = [100 * np.array(data["difference"][f"{k:g}"][name]) for k in data["k"]]
        limit = max(np.abs(values).max() for values in maps)
        for column, (k, values) in enumerate(zip(data["k"], maps, strict=True)):
            axis = axes[row, column]
            mesh = axis.pcolormesh(radius, slip, values, cmap="RdBu_r", vmin=-limit, vmax=limit, shading="gouraud")
            lines = axis.contour(
                radius, slip, values, levels=[-20, -10, -5, -1, 1, 5, 10, 20], colors="0.25", linewidths=0.6
            )
            axis.clabel(lines, fmt="%g", fontsize=7, inline_spacing=2)
            axis.set_xscale("log")
            axis.set_yscale("symlog", linthresh=_LINEAR, linscale=0.6)
            plain_ticks(axis.xaxis, (2, 5, 10, 20, 50, 100))
            plain_ticks(axis.yaxis, (-50, -20, -10, -5, -2, 0, 2, 5, 10, 20, 50))
            if row == 0:
                axis.set_title(f"{data['vehicle']}, K = {1e3 * k:g} mm", fontsize=10)
            if row == 2:
                axis.set_xlabel("turning radius $R$ (m)")
            if column == 0:
                axis.set_ylabel("slip $i$ of both tracks (%)")
        bar = figure.colorbar(mesh, ax=axes[row, :], pad=0.01)
        bar.set_label(f"{symbol}: (soft − exact) / {unit} (%)")
    return figure


def remark(data: Data) -> str:
    """Say where both agree, and by how much they part."""
    worst = {
        name: max(float(np.abs(maps[name]).max()) for maps in data["difference"].values()) for name in OUTPUT_NAMES
    }
    far = np.abs(data["slip"]) >= 0.1
    slipping = max(
        float(np.abs(np.array(values)[far]).max()) for maps in data["difference"].values() for values in maps.values()
    )
    return (
        f"On straight runs both agree to {data['largest_on_straight_runs']:.0e}. In turns they part most near zero slip, "
        "where the whole shear is that of the turn, and at the radius where the turn shears the ground by about K: by up "
        f"to {100 * worst['qx']:.0f} % of μ W in Qx, {100 * worst['qy']:.0f} % in Qy and {100 * worst['mz']:.0f} % of "
        f"μ W L/4 in Mz. From 10 % slip on they differ by at most {100 * slipping:.1f} %."
    )


STUDY: Final = Study("soft-exact", "Soft path less exact path", compute, draw, remark)
