"""Accuracy against time as a picture."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any, Final

from grouser.terrain import write_aside

# What agrees with the teacher to rounding is drawn at the bottom.
_FLOOR: Final = 1e-7
_STYLES: Final = {
    "float64": ("s", "#0072B2"),
    "float32": ("D", "#56B4E9"),
    "structured": ("o", "#E69F00"),
    "shipped": ("*", "#D55E00"),
}
_LABELS: Final = {
    "float64": "physics, float64",
    "float32": "physics, float32",
    "structured": "structured, {epochs} epochs",
    "shipped": "shipped",
}


def figure(results: Mapping[str, Any], file: Path) -> None:
    """Write the Pareto plot of both modes."""
    from matplotlib.figure import Figure

    made = Figure(figsize=(12, 5.2), layout="constrained")
    axes = made.subplots(1, 2, sharey=True)
    for axis, (mode, content) in zip(axes, results["modes"].items(), strict=True):
        seen = set()
        for name, entry in content["pareto"].items():
            kind = _kind(name)
            marker, color = _STYLES[kind]
            height = max(entry["unexplained"], _FLOOR)
            label = None if kind in seen else _LABELS[kind].format(**results["sizes"])
            seen.add(kind)
            axis.plot(entry["ns"], height, marker, color=color, ms=11 if kind == "shipped" else 7, label=label)
            # Both precisions of a grid lie on one line, which one of them names.
            if kind != "float32":
                place = (entry["ns"], height)
                # A grid and a network may have the same time and error.
                above = -13 if kind == "float64" else 6
                axis.annotate(_short(name), place, textcoords="offset points", xytext=(6, above), fontsize=8)
        axis.set(xscale="log", yscale="log", xlabel="ns a call, single, in C", title=f"M113, {mode}, unseen runs")
        axis.grid(alpha=0.3, which="both")
        axis.margins(x=0.2)
    axes[0].set_ylabel("1 − R², worst output")
    axes[1].legend(loc="center right", fontsize=8)
    buffer = BytesIO()
    made.savefig(buffer, dpi=130, format="png")
    write_aside(file, buffer.getvalue())


def _kind(name: str) -> str:
    for kind in ("float64", "float32"):
        if name.endswith(kind):
            return kind
    return "structured" if name.startswith("structured") else "shipped"


def _short(name: str) -> str:
    if _kind(name) == "shipped":
        return "the paper's recipe" if name.endswith("recipe") else ""
    return (
        name.removeprefix("physics ").removeprefix("structured, ").removesuffix(", float64").removesuffix(", float32")
    )
