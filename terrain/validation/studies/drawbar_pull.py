"""Drawbar pull against slip on every published soil."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from ...block import ShearGrid
from ...named import named
from ...vehicle import TrackedVehicle
from ..blocks import COMPILED, DEFAULT
from .grounds import KINDS, ground_kind, soil_names
from .study import Data, Study
from .style import CYCLE, label, new_figure

_BELT_SPEED: Final = 3.0


def compute(vehicle: TrackedVehicle, quick: bool = False) -> dict[str, Any]:
    """Return (thrust − rolling resistance)/W by slip from 0 to 1 at V_ε = 0, for every named soil."""
    slips = np.concatenate([np.linspace(0, 0.1, 6 if quick else 26), np.linspace(0.12, 1.0, 12 if quick else 45)])
    curves = []
    for name in soil_names():
        terrain = named(name)
        rows = np.zeros((len(slips), 7 + len(terrain.parameters)))
        rows[:, 0] = _BELT_SPEED * (1 - slips)
        rows[:, 5:7] = _BELT_SPEED
        rows[:, 7:] = terrain.parameters
        pull = COMPILED.build(vehicle, "soil", ShearGrid(*DEFAULT), 0.0).forces(rows)[:, 0] / vehicle.weight
        curves.append({"name": name, "kind": ground_kind(name), "pull": pull.tolist()})
    return {"vehicle": vehicle.name, "slip": slips.tolist(), "curves": curves}


def draw(data: Data) -> Any:
    """Draw one panel for each kind of soil."""
    kinds = [kind for kind in KINDS if any(curve["kind"] == kind for curve in data["curves"])]
    columns = 2
    rows = (len(kinds) + 1) // columns
    figure = new_figure(10.5, 3.6 * rows)
    axes = figure.subplots(rows, columns, squeeze=False, sharex=True)
    slip = 100 * np.array(data["slip"])
    for axis, kind in zip(axes.flat, kinds, strict=False):
        chosen = [curve for curve in data["curves"] if curve["kind"] == kind]
        # The legend reads in the order in which the curves lie.
        for color, curve in zip(CYCLE, sorted(chosen, key=lambda curve: -curve["pull"][-1]), strict=False):
            axis.plot(slip, curve["pull"], color=color, linewidth=1.4, label=curve["name"])
        axis.axhline(0, color="0.3", linewidth=0.8)
        axis.set_xlim(0, 100)
        low, high = axis.get_ylim()
        axis.set_ylim(low, high + 0.05 * (high - low))
        axis.legend(fontsize=8, loc="best")
        label(axis, x="slip $i$ (%)", y="drawbar pull / weight (–)", title=f"{data['vehicle']}, {kind}")
        axis.xaxis.set_tick_params(labelbottom=True)
    for axis in axes.flat[len(kinds) :]:
        axis.remove()
    return figure


def remark(data: Data) -> str:
    """Say where there is no pull, and where there is most."""
    last = {curve["name"]: curve["pull"][-1] for curve in data["curves"]}
    best, least = max(last, key=lambda name: last[name]), min(last, key=lambda name: last[name])
    return (
        f"At full slip the vehicle pulls most on {best}, {last[best]:.2f} of its weight, and least on {least}, "
        f"{last[least]:.2f}. Clay is mobilized at small slip and snow late, as their K tell. Sinkage is not modelled: "
        "rolling resistance does not grow with slip, so that no curve turns down."
    )


STUDY: Final = Study("drawbar-pull", "Drawbar pull against slip", compute, draw, remark)
