"""The picture of the path-tracking policy: how it was learned, and what it does beside pure pursuit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from benchmarks.data.style import BLUE, GREEN, ORANGE
from benchmarks.rl.judgement import LEARNED
from grouser.terrain import write_aside

_COLORS: Final = (ORANGE, BLUE, GREEN)


def tracking_figure(drivers: Mapping[str, Any], curve: Sequence[Mapping[str, Any]], file: Path) -> None:
    """Draw the learning curve, and every start's cross-track RMSE and return by driver.

    Parameters
    ----------
    drivers : mapping
        As :func:`benchmarks.rl.judgement.tracking` returned them.
    curve : sequence of mapping
        Evaluations during the training, on physics.
    file : Path
        The picture.
    """
    figure = Figure(figsize=(12.0, 3.8), layout="constrained")
    axes = figure.subplots(1, 3)
    steps = [entry["steps"] / 1e6 for entry in curve]
    axes[0].plot(steps, [entry["cross_track_error_rmse"] for entry in curve], color=_COLORS[0])
    for (name, entry), color in zip(drivers.items(), _COLORS, strict=True):
        if name != LEARNED:
            axes[0].axhline(entry["cross_track_rmse"], color=color, linewidth=0.9, linestyle="--")
    axes[0].set(
        xlabel="million steps on native", ylabel="cross-track RMSE on physics (m)", ylim=(0, None), title="learning"
    )
    # A start that is lost would flatten all others.
    for axis, key, label, shown in (
        (axes[1], "cross_track_rmse_of_seeds", "cross-track RMSE (m)", (0.0, 0.07)),
        (axes[2], "return_of_seeds", "return", (290.0, 292.5)),
    ):
        for (name, entry), color in zip(drivers.items(), _COLORS, strict=True):
            values = np.sort(np.array(entry[key]))
            axis.step(values, np.arange(1, len(values) + 1) / len(values), where="post", color=color, label=name)
        axis.set(xlabel=label, ylabel="share of starts below", xlim=shown, ylim=(0, 1), title=f"{label} of each start")
    axes[1].legend(fontsize=7, loc="lower right")
    for axis in axes:
        axis.grid(alpha=0.3)
    buffer = BytesIO()
    figure.savefig(buffer, dpi=110, format="png")
    write_aside(file, buffer.getvalue())
