"""Thrust against slip: the block on straight runs, and the closed form."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Final

import numpy as np

from ...block import ShearGrid
from ...closed_forms import straight_thrust
from ...named import named
from ...parameters import SoilTerrain, Terrain
from ...vehicle import TrackedVehicle
from ..blocks import COMPILED, DEFAULT, FINE
from ..closed_form_checks import wong_vehicle
from .study import Data, Study
from .style import CYCLE, label, new_figure

_GROUNDS: Final = ("asphalt", "heavy-clay-25", "upland-sandy-loam", "dry-sand", "snow-us")
_BELT_SPEED: Final = 3.0


def compute(vehicle: TrackedVehicle, quick: bool = False) -> dict[str, Any]:
    """Return thrust over weight by slip, in closed form and by the block on two grids; V_ε = 0, no rolling resistance."""
    slips = np.concatenate([np.geomspace(1e-3, 0.1, 8 if quick else 20), np.linspace(0.12, 1.0, 12 if quick else 45)])
    snow = SoilTerrain(1e3, math.radians(19.7), 0.0, 0.05)
    level = replace(vehicle, cg_offset=0.0)
    cases: list[tuple[str, TrackedVehicle, Terrain]] = [
        ("Wong's example, 3.6 × 1.0 m", wong_vehicle(3.6, 1.0), snow),
        ("Wong's example, 4.5 × 0.8 m", wong_vehicle(4.5, 0.8), snow),
        *((f"{vehicle.name} on {name}", level, replace(named(name), fr=0.0)) for name in _GROUNDS),
    ]
    curves = []
    for name, driven, terrain in cases:
        closed = np.array(
            [straight_thrust(driven, terrain, _BELT_SPEED * (1 - slip), _BELT_SPEED) for slip in slips]
        )  # fmt: skip
        default, fine = (_by_block(driven, terrain, slips, along) for along in (DEFAULT[0], FINE[0]))
        curves.append(
            {
                "name": name,
                "closed_form": (closed / driven.weight).tolist(),
                "block": (default / driven.weight).tolist(),
                "error_default": (default / closed - 1).tolist(),
                "error_fine": (fine / closed - 1).tolist(),
            }
        )
    return {"slip": slips.tolist(), "cells": {"default": list(DEFAULT), "fine": list(FINE)}, "curves": curves}


def draw(data: Data) -> Any:
    """Draw thrust over weight, and the error of the grids."""
    figure = new_figure(10.5, 4.6)
    left, right = figure.subplots(1, 2)
    slip = 100 * np.array(data["slip"])
    for color, curve in zip(CYCLE, data["curves"], strict=False):
        left.plot(slip, curve["closed_form"], color=color, linewidth=1.3, label=curve["name"])
        left.plot(slip[::5], curve["block"][::5], "o", color=color, markersize=3.5)
        right.plot(slip, np.abs(curve["error_default"]), color=color, linewidth=1.3)
        right.plot(slip, np.abs(curve["error_fine"]), color=color, linewidth=1.0, linestyle="--")
    left.plot([], [], "o", color="0.3", markersize=3.5, label="block, 16 × 4 cells")
    left.set_xlim(0, 100)
    left.set_ylim(0)
    left.legend(fontsize=8, loc="upper right", bbox_to_anchor=(1.0, 0.9))
    label(left, x="slip $i$ (%)", y="thrust / weight (–)", title="closed form (lines) and block (dots)")
    right.set(xscale="log", yscale="log", xlim=(0.1, 100))
    for style, text in (("-", "16 × 4 cells"), ("--", "104 × 64 cells")):
        right.plot([], [], style, color="0.3", label=text)
    right.legend(fontsize=8, loc="upper left")
    label(right, x="slip $i$ (%)", y="|error of the thrust| (–)", title="block against closed form")
    return figure


def remark(data: Data) -> str:
    """Say how far the default grid is off."""
    worst = {key: max(np.abs(curve[key]).max() for curve in data["curves"]) for key in ("error_default", "error_fine")}
    return (
        f"The block follows the closed form within {worst['error_default']:.1g} at 16 × 4 cells and "
        f"{worst['error_fine']:.1g} at 104 × 64; what is left is the midpoint rule, worst where K is small."
    )


def _by_block(vehicle: TrackedVehicle, terrain: Terrain, slips: Any, along: int) -> Any:
    rows = np.zeros((len(slips), 7 + len(terrain.parameters)))
    rows[:, 0] = _BELT_SPEED * (1 - slips)
    rows[:, 5:7] = _BELT_SPEED
    rows[:, 7:] = terrain.parameters
    return COMPILED.build(vehicle, terrain.mode, ShearGrid(along, 1), 0.0).forces(rows)[:, 0]


STUDY: Final = Study("thrust-slip", "Thrust against slip", compute, draw, remark)
