"""Accuracy against time as a picture."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

from grouser.terrain import write_aside


def figure(results: Mapping[str, Any], file: Path) -> None:
    """Write the Pareto plot of both modes."""
    from matplotlib.figure import Figure

    made = Figure(figsize=(11, 4.6), layout="constrained")
    axes = made.subplots(1, 2, sharey=True)
    for axis, (mode, content) in zip(axes, results["modes"].items(), strict=True):
        for name, entry in content["pareto"].items():
            physics = name.startswith("physics")
            exact = entry["unexplained"] < 1e-12
            height = 1e-7 if exact else entry["unexplained"]
            axis.plot(entry["ns"], height, "s" if physics else "o", color="#0072B2" if physics else "#D55E00", ms=8)
            label = f"{name} (the teacher)" if exact else name
            axis.annotate(label, (entry["ns"], height), textcoords="offset points", xytext=(7, 5), fontsize=8)
        axis.set(xscale="log", yscale="log", xlabel="ns a row, in a batch", title=f"M113, {mode}, unseen runs")
        axis.grid(alpha=0.3, which="both")
        axis.margins(x=0.35)
    axes[0].set_ylabel("1 − R², worst output")
    buffer = BytesIO()
    made.savefig(buffer, dpi=150, format="png")
    write_aside(file, buffer.getvalue())
