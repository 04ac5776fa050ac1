"""The figures as pictures: latency by network, steps a second of the environments."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from typing import Any, Final

from ...terrain import missing_extra
from .calls import OURS
from .compiled_rivals import PLAIN_FLAGS
from .onnx_in_c import ONNX_IN_C
from .subjects import NETWORKS
from .targets import BOUND
from .timing import Section

# Okabe and Ito's colours, told apart without colour vision.
_COLOURS: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#999999", "#000000")
_MARKERS: Final = "xsdv^*P"
_IN_C: Final = (OURS, *PLAIN_FLAGS, ONNX_IN_C)
_PHYSICS: Final = (("16x4", "float64", "--"), ("16x4", "float32", "-."), ("4x2", "float32", ":"))


def pictures(sections: Mapping[str, Section]) -> dict[str, bytes]:
    """Return PNG files by name.

    Raises
    ------
    ConfigurationError
        If matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise missing_extra("matplotlib", "plot") from error
    made = {}
    for name, draw in (("latency", _draw_latency), ("environments", _draw_environments)):
        figure = Figure(figsize=(8.0, 4.6), layout="constrained")
        axes = figure.add_subplot()
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(axis="y", alpha=0.3)
        draw(axes, sections)
        buffer = BytesIO()
        figure.savefig(buffer, format="png", dpi=130, metadata={"Software": None})
        made[name] = buffer.getvalue()
    return made


def _draw_latency(axes: Any, sections: Mapping[str, Section]) -> None:
    in_c, python, physics = sections["networks_c"], sections["python"], sections["physics_c"]
    names = [name for name in NETWORKS if name in in_c.figures]
    rivals = list(dict.fromkeys(name for case in names for name in python.figures.get(case, {})))
    rivals = [name for name in rivals if name == "grouser, bound step()" or not name.startswith("grouser")]
    styles = [(in_c, name, "-", "o", "in C") for name in _IN_C]
    styles += [(python, name, "none", marker, "from Python") for name, marker in zip(rivals, _MARKERS, strict=False)]
    for index, (section, name, line, marker, place) in enumerate(styles):
        points = [(names.index(case), value) for case in names if (value := section.get(case, name)) is not None]
        if points:
            colour = _COLOURS[index % len(_COLOURS)]
            axes.plot(*zip(*points, strict=True), ls=line, marker=marker, color=colour, label=f"{name}, {place}")
    bounds = sections.get("bounds")
    if bounds is not None:
        levels = [bounds.get(case, BOUND) or float("nan") for case in names]
        axes.plot(levels, color="0.7", lw=1, label="bound of this core")
    for grid, precision, style in _PHYSICS:
        level = physics.get(grid, precision)
        if level is not None:
            axes.axhline(level, color="0.4", ls=style, lw=1, label=f"physics {grid}, {precision} SIMD, in C")
    axes.set_yscale("log")
    axes.set_xticks(range(len(names)), names)
    axes.set_ylabel("one sample, ns")
    axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)


def _draw_environments(axes: Any, sections: Mapping[str, Section]) -> None:
    section = sections["environments"]
    backends = list(section.figures)
    columns = list(dict.fromkeys(name for values in section.figures.values() for name in values))
    width = 0.8 / len(columns)
    for index, name in enumerate(columns):
        places = [place + (index - (len(columns) - 1) / 2) * width for place in range(len(backends))]
        heights = [section.get(backend, name) or 0.0 for backend in backends]
        axes.bar(places, heights, width, color=_COLOURS[index % len(_COLOURS)], label=name)
    axes.set_yscale("log")
    axes.set_xticks(range(len(backends)), [name.replace(", ", "\n") for name in backends])
    axes.set_ylabel("steps/s, 10 ticks each")
    axes.legend(fontsize=8, ncols=len(columns), loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False)
