"""The study in one picture: what rounding costs in accuracy and in the loop, and what it earns in time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from benchmarks.data.style import BLUE, GREEN, GREY, ORANGE, SETTINGS, save

from .formats import FLOAT32, FORMATS
from .loop import LOOSE, MARGIN, POSITION, contenders
from .prototypes import PROTOTYPES
from .speed import OURS

_COLORS: Final = (BLUE, ORANGE, GREEN, GREY, "#CC79A7", "#56B4E9", "#E69F00", "black")
_MARKERS: Final = "osD^vPX*"


def draw(results: Mapping[str, Any], target: Path) -> None:
    """Draw accuracy, drives and times of the study's results, and write the picture."""
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(14.5, 5.4), layout="constrained")
        errors, drives, times = figure.subplots(1, 3)
        _draw_errors(errors, results["accuracy"])
        _draw_drives(drives, results["drives"])
        _draw_times(times, results["speed"]["ns"])
        save(figure, target)


def _draw_errors(axes: Any, accuracy: Mapping[str, Any]) -> None:
    formats = list(FORMATS)
    for index, (name, found) in enumerate(accuracy.items()):
        base = max(found[FLOAT32.name]["nrmse"].values())
        values = [max(found[kind]["nrmse"].values()) / base for kind in formats]
        axes.plot(values, range(len(formats)), _MARKERS[index % 8], color=_COLORS[index % 8], label=name, ms=5)
    _label(axes, formats)
    axes.set(xlabel="NRMSE over that of float32, worst output", title="(a) test rows of the shipped artifacts")
    _legend(axes)


def _draw_drives(axes: Any, drives: Mapping[str, Any]) -> None:
    names: list[str] = []
    for index, (name, found) in enumerate(drives.items()):
        # The plain surrogate is metres away from physics in any format.
        if "recipe" in name:
            continue
        judged = found["judged"]
        growths = {kind: judged[kind]["growth"][POSITION] for kind in contenders() if kind != FLOAT32.name}
        names = list(growths)
        axes.errorbar(
            [1e3 * each["mean"] for each in growths.values()],
            np.arange(len(names)) + 0.12 * (index - 1.5),
            xerr=[1e3 * each["half_interval"] for each in growths.values()],
            fmt=_MARKERS[index % 8],
            color=_COLORS[index % 8],
            label=name,
            ms=4,
            lw=1,
        )
    axes.axvline(1e3 * MARGIN, color="black", linestyle="--", linewidth=0.9)
    _label(axes, names)
    axes.set_xscale("symlog", linthresh=0.1)
    axes.set_xlim(-1.5, 4e4)
    axes.set_xticks([-1, -0.1, 0, 0.1, 1, 10, 100, 1e3, 1e4], ["−1", "−.1", "0", ".1", "1", "10", "100", "10³", "10⁴"])
    axes.set(xlabel="further from physics than with float32 (mm), 95 %", title="(b) final position of the lane change")
    if names:
        _legend(axes)


def _draw_times(axes: Any, times: Mapping[str, Mapping[str, float]]) -> None:
    names = [OURS, *(prototype.name for prototype in PROTOTYPES)]
    for index, (network, found) in enumerate(times.items()):
        base = found.get(FLOAT32.weights)
        if base is None:
            continue
        shown = [(place, found[name] / base) for place, name in enumerate(names) if name in found]
        places, shares = zip(*shown, strict=True)
        axes.plot(
            shares, places, _MARKERS[index % 8], color=_COLORS[index % 8], label=network.replace("m113-", ""), ms=5
        )
    axes.axvline(1.0, color=GREY, linewidth=0.9)
    _label(axes, names)
    axes.set(xlabel="time over that of the float32 prototype", xlim=(0, None), title="(c) one sample in C")
    if times:
        _legend(axes)


def _legend(axes: Any) -> None:
    axes.legend(fontsize=7, loc="upper center", bbox_to_anchor=(0.4, -0.13), ncols=2, frameon=False)


def _label(axes: Any, names: list[str]) -> None:
    shorter = [
        name.replace(LOOSE, ", loose tick").replace(", first layer float32", ",\nfirst layer float32") for name in names
    ]
    axes.set_yticks(range(len(names)), shorter, fontsize=7.5)
    axes.invert_yaxis()
