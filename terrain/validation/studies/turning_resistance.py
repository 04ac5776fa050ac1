"""Turning resistance against radius: the acceptance curve of the contact options."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from ...block import ShearGrid, ShearPath
from ...vehicle import Contact, TrackedVehicle
from ..blocks import COMPILED, DEFAULT
from ..turn_checks import RADII, empirical_curve, turning_resistance_curve
from .study import Data, Study
from .style import BLACK, BLUE, GREEN, ORANGE, label, new_figure

#: Label, path, contact option, K in m from and to, colour.
_MODELS: Final[tuple[tuple[str, ShearPath, Contact, tuple[float, float], str], ...]] = (
    ("exact path, continuous", "exact", "continuous", (0.052, 0.055), BLUE),
    ("soft path, continuous", "soft", "continuous", (0.052, 0.055), ORANGE),
    ("soft path, per wheel", "soft", "per_wheel", (0.013, 0.016), GREEN),
)
_ACCEPTED: Final = 6.0


def compute(vehicle: TrackedVehicle, quick: bool = False) -> dict[str, Any]:
    """Return μ_t/μ by radius for the empirical curve and each model at both ends of its K, and deviations in percent."""
    radii = RADII[::8] if quick else RADII
    empirical = empirical_curve(vehicle, radii)
    curves = []
    for name, path, contact, ks, _ in _MODELS:
        for k in ks:
            grid = ShearGrid(*DEFAULT, contact, path)
            made = turning_resistance_curve(COMPILED, vehicle, k, grid, radii)
            curves.append(
                {
                    "name": name,
                    "k": k,
                    "by_thrust": made.by_thrust.tolist(),
                    "deviation_percent": (100 * (made.by_thrust / empirical - 1)).tolist(),
                    "by_lateral_force": made.by_lateral_force.tolist(),
                    "lateral_deviation_percent": (100 * (made.by_lateral_force / empirical - 1)).tolist(),
                }
            )
    return {"vehicle": vehicle.name, "radius_m": list(radii), "empirical": empirical.tolist(), "curves": curves}


def draw(data: Data) -> Any:
    """Draw the curves, each model as the band between its two K, and their deviations."""
    figure = new_figure(9.0, 7.0)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(1.5, 1))
    radius = np.array(data["radius_m"])
    top.plot(radius, data["empirical"], color=BLACK, linewidth=2.0, label="empirical, 1/(0.925 + 0.15 R/B)")
    bottom.axhspan(-_ACCEPTED, _ACCEPTED, color="0.92", linewidth=0, label=f"±{_ACCEPTED:g} %")
    bottom.axhline(0, color=BLACK, linewidth=1.2)
    for name, _, _, ks, color in _MODELS:
        low, high = (curve for curve in data["curves"] if curve["name"] == name)
        text = f"{name}, K {1e3 * ks[0]:g} mm (solid) – {1e3 * ks[1]:g} mm (dashed)"
        for axis, key in ((top, "by_thrust"), (bottom, "deviation_percent")):
            axis.plot(radius, low[key], color=color, linewidth=1.4, label=text)
            axis.plot(radius, high[key], color=color, linewidth=1.4, linestyle="--")
            axis.fill_between(radius, low[key], high[key], color=color, alpha=0.2, linewidth=0)
    top.set_ylim(0)
    top.legend(fontsize=8, loc="upper right")
    bottom.legend(bottom.get_legend_handles_labels()[0][:1], [f"±{_ACCEPTED:g} %"], fontsize=8, loc="upper left")
    bottom.set_xlim(radius[0], radius[-1])
    label(
        top,
        y="turning resistance $\\mu_t/\\mu_{max}$ (–)",
        title=f"{data['vehicle']}, slow steady turn, $V_\\epsilon$ = 0",
    )
    label(bottom, x="turning radius $R$ (m)", y="deviation from empirical (%)")
    return figure


def remark(data: Data) -> str:
    """Say how far each curve is off, by either moment."""
    parts = [
        f"{curve['name']}, K {1e3 * curve['k']:g} mm: {_span(curve['deviation_percent'])} % "
        f"({_span(curve['lateral_deviation_percent'])} %)"
        for curve in data["curves"]
    ]
    return (
        "Deviation from the empirical curve, with M_r as it is measured, by the difference of the thrusts (in brackets: "
        f"by the lateral forces alone): {'; '.join(parts)}. The lateral moment is smaller, since across the width "
        "of a track longitudinal forces resist the turn, too."
    )


def _span(values: list[float]) -> str:
    return f"{min(values):+.1f} to {max(values):+.1f}"


STUDY: Final = Study("turning-resistance", "Turning resistance against radius", compute, draw, remark)
