"""Where in slip space the rows of a training lie."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from benchmarks.data.style import BLUE, GREEN, ORANGE, SETTINGS, save
from grouser.surrogate.offline import DataConfig, Dataset, load_dataset, space_filling_rows
from grouser.surrogate.offline.generate import generate_dataset
from grouser.surrogate.offline.perturbation import perturbed_rows, teacher_of
from grouser.surrogate.offline.space_filling import slip_coordinates
from grouser.terrain import FloatArray, parameter_ranges

SEED: Final = 0
RUNS: Final = 120
SAMPLES: Final = 200
#: Copies of each row, the default of a training.
COPIES: Final = 2
SHOWN: Final = 8000
# What slips less is drawn at zero, and counted in words.
_FLOOR: Final = 1e-4
_CEILING: Final = 1e4
_COORDINATES: Final = ("along", "across", "turning")
_SOURCES: Final = ("trajectories", "perturbed copies", "space-filling rows")
_COLORS: Final = (BLUE, ORANGE, GREEN)


def slips_by_source(vehicle: str, folder: Path) -> dict[str, FloatArray]:
    """Return u along, across and turning of both tracks, shape (2n, 3), of a training's rows by where they come from."""
    generate_dataset(DataConfig(vehicle=vehicle, runs=RUNS, samples_per_run=SAMPLES, seed=SEED), folder)
    dataset: Dataset = load_dataset(folder)
    ranges = parameter_ranges(dataset.manifest.ranges, dataset.manifest.mode)
    beside, _ = perturbed_rows(dataset, COPIES, np.random.default_rng(SEED))
    count = len(dataset.inputs)
    filling, _ = space_filling_rows(dataset.vehicle, dataset.manifest.mode, ranges, count, teacher_of(dataset), SEED)
    rows = zip(_SOURCES, (dataset.inputs, beside, filling), strict=True)
    return {name: slip_coordinates(dataset.vehicle, part).reshape(-1, 3) for name, part in rows}


def summary(slips: dict[str, FloatArray]) -> list[str]:
    """Return, by source, percentiles of |u| and the share below and above what trajectories reach."""
    lines = []
    for name, slip in slips.items():
        low, middle, high = np.percentile(np.abs(slip), (5, 50, 95), axis=0)
        text = ", ".join(
            f"{what} {a:.2g} / {b:.2g} / {c:.2g}" for what, a, b, c in zip(_COORDINATES, low, middle, high, strict=True)
        )
        lines.append(f"{name:20s} |u| at 5 / 50 / 95 %: {text}")
    return lines


def draw_coverage(slips: dict[str, FloatArray], title: str, target: Path) -> None:
    """Draw the size of each slip coordinate as histograms, and along over turning as points."""
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(10.5, 7.2), layout="constrained")
        figure.suptitle(title, fontsize=10.5)
        (*histograms,), (*clouds,) = figure.subplots(2, 3)
        edges = np.geomspace(_FLOOR, _CEILING, 49)
        for index, (axes, coordinate) in enumerate(zip(histograms, _COORDINATES, strict=True)):
            for slip, color in zip(slips.values(), _COLORS, strict=True):
                size = np.abs(slip[:, index])
                # Per decade, so that the area under each line is 1.
                weights = np.full(len(size), 6 / len(size))
                axes.hist(size, edges, weights=weights, histtype="step", color=color, linewidth=1.5)
            axes.set_xscale("log")
            axes.set_xlabel(f"|u| {coordinate}")
            axes.set_xlim(_FLOOR, _CEILING)
            axes.set_ylim(0, 0.9)
            below = [f"{name}: {100 * np.mean(np.abs(slip[:, index]) < _FLOOR):.0f} %" for name, slip in slips.items()]
            text = "\n".join(["below $10^{-4}$", *below])
            axes.text(0.03, 0.97, text, transform=axes.transAxes, va="top", fontsize=8, linespacing=1.4)
        histograms[0].set_ylabel("share of tracks per decade")
        generator = np.random.default_rng(SEED)
        for axes, (name, slip), color in zip(clouds, slips.items(), _COLORS, strict=True):
            shown = slip[generator.permutation(len(slip))[:SHOWN]]
            axes.scatter(
                _signed_decades(shown[:, 0]), _signed_decades(shown[:, 2]), s=2.0, color=color, alpha=0.4, linewidth=0
            )
            axes.set_title(name)
            axes.set_xlabel("u along")
            _signed_axis(axes.xaxis)
            _signed_axis(axes.yaxis)
            axes.set_xlim(-8.2, 8.2)
            axes.set_ylim(-8.2, 8.2)
            axes.set_aspect("equal")
        clouds[0].set_ylabel("u turning")
        handles = [Line2D([], [], color=color, linewidth=1.5) for color in _COLORS]
        figure.legend(handles, list(slips), loc="outside lower center", ncols=3, frameon=False)
        save(figure, target)


def _signed_decades(u: FloatArray) -> FloatArray:
    """Return decades above the floor, with the sign of u: ±4 is |u| = 1."""
    decades: FloatArray = np.sign(u) * np.log10(np.clip(np.abs(u), _FLOOR, _CEILING) / _FLOOR)
    return decades


def _signed_axis(axis: Any) -> None:
    axis.set_ticks([-7, -4, 0, 4, 7], ["$-10^{3}$", "−1", "0", "1", "$10^{3}$"])
