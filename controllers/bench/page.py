"""The figures as a page: targets, our own physics, the best library, then every table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from .accuracy import WORST
from .calls import GATED, OURS, PRECISIONS, STRUCTURED, batched_physics
from .onnx_in_c import ONNX_IN_C
from .paper import TABLE_IX, TABLE_X
from .timing import Section

_NONE: Final = "–"
_TITLES: Final = {
    "networks_c": "Single samples in C",
    "bounds": "How near the bound",
    "limits": "What this core can do",
    "physics_c": "The physics in C",
    "python": "Called from Python",
    "batch": "Batches",
    "batch_peak": "Batches, share of the peak",
    "accuracy": "How accurate the grids are",
    "latency": "How late a call can be",
    "environments": "Environments",
    "fleets": "The dynamics alone",
}
_PHYSICS: Final = (("16x4", "float64"), ("16x4", "float32"), ("4x2", "float32"))
_CHOSEN: Final = (STRUCTURED, GATED, "64x64", "128x128", "128x4")
_METHOD: Final = (
    "Medians of rounds in which every contender has its turn, so that ratios within one run carry over to another "
    "machine of the kind, and absolute times do not. One thread, where not two are named. Networks have 10 inputs, "
    "3 outputs and ReLU, where nothing else is said; rivals get both normalizers folded into their weights and rows in "
    "their own type, so that they have nothing to do but the layers."
)
_OWN_PHYSICS: Final = (
    "How many times as long the compiled, vectorised physics takes as the surrogate, single samples in C. Below 1 the "
    "physics is faster. 16x4 is the default grid, 640 cells, which the shipped surrogate has learned from."
)
_AT_EQUAL_ACCURACY: Final = (
    "A coarser grid is faster and less accurate, and so is a surrogate. What a force takes, in ns, and how far the worst "
    "of its three outputs is from the physics on a grid beyond doubt, in % of its standard deviation ([how it is "
    "measured](#how-accurate-the-grids-are)); batches are of 256 rows."
)
_PAPER: Final = (
    "The paper timed functions written by hand for MEX, on a processor that it does not name: its times and ours do not "
    "compare. Its speed-ups over its own physics and ours over our own vectorised physics (float64, 16x4) do, and ours "
    "are the harder ones. Our times are of rigid mode. Table IX, µs:"
)
_CEILING: Final = (
    "*At the bound* says what a kernel would reach that takes no longer than this core needs to read and multiply its "
    "weights; a target above it is out of reach here, unless weights are left out, as those of units that are zero."
)
_IN_C: Final = (
    "Single samples called from C: the library through its C API, on bound memory and one thread, each call waiting for "
    "the last."
)
_IX: Final = (
    "", "paper, rigid", "over its physics", "paper, soil", "over its physics", "ours, in C", "over our SIMD physics",
)  # fmt: skip
_FIGURES: Final = {"networks_c": "latency", "environments": "environments"}


def sections_of(document: Mapping[str, Any]) -> dict[str, Section]:
    """Return the sections of a document of :func:`run_bench`."""
    return {name: Section.from_dict(read) for name, read in document["times"].items()}


def page(document: Mapping[str, Any], *, data: str = "bench.json", figures: str = "bench-") -> str:
    """Return the page as Markdown.

    Parameters
    ----------
    document : mapping
        Of :func:`run_bench`.
    data : str
        Where the page finds the document.
    figures : str
        What stands before the names of its figures; empty for a page without.
    """
    sections, meta = sections_of(document), document["meta"]
    packages = ", ".join(f"{name} {number}" for name, number in meta["packages"].items())
    made_by = (
        f"Made by `{meta['command']}`; every figure stands in [{data}]({data}). grouser {meta['grouser']} on "
        f"{meta['machine']}; kernels at {meta['kernels']}; rivals in C by {meta['compiler of the rivals']}; {packages}."
    )
    lines = [
        "# Benchmarks",
        "",
        made_by,
        "",
        _METHOD,
        "",
        *_targets(document["targets"]),
        *_own_physics(sections),
        *_best_library(sections),
    ]
    for name, title in _TITLES.items():
        if name in sections:
            lines += [f"## {title}", "", *_section(sections[name]), ""]
            if figures and name in _FIGURES:
                lines += [f"![{title}]({figures}{_FIGURES[name]}.png)", ""]
    lines += _paper(sections)
    if document["absent"]:
        lines += ["## Not measured here", ""]
        lines += [f"- {name}: {reason}" for name, reason in document["absent"].items()] + [""]
    return "\n".join(lines)


def figure(value: float | None) -> str:
    """Return a number with three digits that mean something; – for none."""
    if value is None:
        return _NONE
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"


def markdown(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return a table whose first column is text and whose others are numbers."""
    lines = [headings, ["---", *["---:"] * (len(headings) - 1)], *rows]
    return [f"| {' | '.join(cells)} |" for cells in lines]


def verdict(met: bool | None) -> str:
    """Return what is said of a target."""
    return "not measured" if met is None else "met" if met else "**missed**"


def _targets(targets: Sequence[Mapping[str, Any]]) -> list[str]:
    met, judged = sum(target["met"] is True for target in targets), sum(target["met"] is not None for target in targets)
    lines = [
        "## What it was to reach",
        "",
        f"{met} of {judged} targets met of those that were measured. {_CEILING}",
        "",
    ]
    rows: list[list[str]] = []
    before = ""
    for target in targets:
        if target["group"] != before:
            rows.append([f"**{target['group']}**", "", "", "", ""])
            before = target["group"]
        unit = "" if target["unit"] == "x" else f" {target['unit']}"
        wanted = f"{target['sense']} {figure(target['target'])}{unit}"
        rows.append([target["name"], wanted, figure(target["reached"]), figure(target["ceiling"]),
                     verdict(target["met"])])  # fmt: skip
    return [*lines, *markdown(["", "target", "reached", "at the bound", ""], rows), ""]


def _own_physics(sections: Mapping[str, Section]) -> list[str]:
    if not {"networks_c", "physics_c"} <= set(sections):
        return []
    rows = []
    for case in _CHOSEN:
        time = sections["networks_c"].get(case, OURS)
        ratios = [_over(sections["physics_c"].get(*physics), time) for physics in _PHYSICS]
        rows.append([case, figure(time), *ratios])
    return [
        "## Against our own SIMD physics",
        "",
        _OWN_PHYSICS,
        "",
        *markdown(
            ["", "ns", *(f"physics {grid}, {precision} / it" for grid, precision in _PHYSICS)],
            rows,
        ),
        "",
        *_at_equal_accuracy(sections),
    ]


def _at_equal_accuracy(sections: Mapping[str, Section]) -> list[str]:
    """Return the table of times and errors, and which grid is as accurate as the surrogate."""
    if not {"accuracy", "batch"} <= set(sections):
        return []
    errors, single, batch = sections["accuracy"], sections["physics_c"], sections["batch"]
    own = errors.get(STRUCTURED, WORST)
    times = (sections["networks_c"].get(STRUCTURED, OURS), batch.get(STRUCTURED, OURS))
    rows, rival = [], ""
    for grid in single.figures:
        error = errors.get(grid, WORST)
        taken = [(single.get(grid, each), batch.get(batched_physics(grid, each), OURS)) for each in PRECISIONS]
        rows.append([f"physics {grid}", figure(error), *(figure(time) for pair in taken for time in pair)])
        if not rival and own is not None and error is not None and error <= own:
            compared = [
                f"{_over(alone, times[0])} times as long as the surrogate for a single sample and "
                f"{_over(together, times[1])} times in a batch in {precision}"
                for precision, (alone, together) in zip(PRECISIONS, taken, strict=True)
            ]
            rival = f"The coarsest grid that is as accurate as the surrogate, {grid}, takes {', '.join(compared)}."
    rows.append([STRUCTURED, figure(own), "", "", figure(times[0]), figure(times[1])])
    headings = ["", "worst error, %", *(f"{each}, {how}" for each in PRECISIONS for how in ("single", "batch"))]
    return ["### At equal accuracy", "", _AT_EQUAL_ACCURACY, "", *markdown(headings, rows), "", rival, ""]


def _best_library(sections: Mapping[str, Section]) -> list[str]:
    tables = [*_libraries_from_python(sections), *_library_in_c(sections)]
    return ["## Against the best library", "", *tables] if tables else []


def _libraries_from_python(sections: Mapping[str, Section]) -> list[str]:
    if "python" not in sections:
        return []
    rows = []
    for case, values in sections["python"].figures.items():
        rivals = {name: value for name, value in values.items() if not name.startswith("grouser")}
        ours = values.get("grouser, bound step()")
        if rivals and ours is not None:
            best, slowest = min(rivals, key=rivals.__getitem__), max(rivals, key=rivals.__getitem__)
            rows.append([case, figure(ours), best, figure(rivals[best]), _over(rivals[best], ours), slowest,
                         _over(rivals[slowest], ours)])  # fmt: skip
    headings = ["", "`step()`, ns", "best library", "ns", "best / ours", "slowest", "slowest / ours"]
    return ["Single samples called from Python.", "", *markdown(headings, rows), ""]


def _library_in_c(sections: Mapping[str, Section]) -> list[str]:
    section = sections.get("networks_c")
    if section is None:
        return []
    rows = []
    for case in section.figures:
        ours, library = section.get(case, OURS), section.get(case, ONNX_IN_C)
        if library is not None:
            rows.append([case, figure(ours), figure(library), _over(library, ours)])
    return [_IN_C, "", *markdown(["", "ns", ONNX_IN_C, "it / ours"], rows), ""] if rows else []


def _section(section: Section) -> list[str]:
    columns = list(dict.fromkeys(name for values in section.figures.values() for name in values))
    rows = [[case, *(figure(values.get(name)) for name in columns)] for case, values in section.figures.items()]
    spread = "" if section.spread is None else f" Half of the rounds lie within {section.spread:.0%} of each other."
    return [f"{section.about} In {section.unit}.{spread}", "", *markdown(["", *columns], rows)]


def _paper(sections: Mapping[str, Section]) -> list[str]:
    def find(section: str, case: str, name: str) -> float | None:
        return sections[section].get(case, name) if section in sections else None

    physics = find("physics_c", "16x4", "float64")
    first = []
    for row in TABLE_IX:
        time = find("networks_c", row.network, OURS)
        ours = _NONE if time is None else f"{time / 1000:.3g}"
        first.append([row.network, f"{row.rigid * 1e6:.3g}", f"{row.rigid_ratio:.2f}", f"{row.soil * 1e6:.3g}",
                      f"{row.soil_ratio:.2f}", ours, _over(physics, time)])  # fmt: skip
    second = []
    for entry in TABLE_X:
        near = [(name, find(section, case, who)) for name, section, case, who in entry.ours]
        ours = "; ".join(f"{name}: {value / 1000:.3g}" for name, value in near if value is not None)
        second.append([f"{entry.name} ({entry.notes})", f"{entry.seconds * 1e6:.4g}", ours or _NONE])
    return [
        "## The paper's figures beside ours",
        "",
        _PAPER,
        "",
        *markdown(_IX, first),
        "",
        "Table X, rigid, µs, of a network that it does not name; beside each the nearest of ours:",
        "",
        *markdown(["", "paper", "ours"], second),
        "",
    ]


def _over(over: float | None, under: float | None) -> str:
    return (
        _NONE
        if over is None or under is None
        else f"{over / under:.2f}"
        if over < 10 * under
        else f"{over / under:.0f}"
    )
