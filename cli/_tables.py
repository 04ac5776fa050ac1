"""The tables that more than one verb prints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from rich.box import SIMPLE_HEAD
from rich.table import Table

from ..terrain import OUTPUT_NAMES

_SYMBOLS: Final = {"qx": "Qx", "qy": "Qy", "mz": "Mz"}
_UNITS: Final = {"qx": "N", "qy": "N", "mz": "N m"}


def table(title: str, columns: Sequence[str], *, text_columns: int = 1) -> Table:
    """Return an empty table: first columns of text, then of numbers."""
    made = Table(title=title, title_justify="left", title_style="bold", box=SIMPLE_HEAD, pad_edge=False)
    for index, heading in enumerate(columns):
        made.add_column(heading, justify="left" if index < text_columns else "right", overflow="fold")
    return made


def drives_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    """Return the table of a comparison, from the rows of ``compare.json``."""
    seeds = len({row["seed"] for row in rows}) > 1
    headings = [
        "scenario", "controller", "backend", *(["seed"] if seeds else []), "finished", "out of\nlane, m",
        "cross-track\nRMSE, m", "R² of Qx Qy Mz\non the way", "fallback,\n%", "force call,\nns",
    ]  # fmt: skip
    made = table("Drives", headings, text_columns=3)
    before = ("", "")
    for row in rows:
        drive = (row["scenario"], row["controller"])
        if before[0] and drive != before:
            made.add_section()
        before = drive
        made.add_row(
            *drive,
            row["backend"],
            *([str(row["seed"])] if seeds else []),
            "yes" if row["finished"] else "[red]no[/red]",
            number(row["corridor_violation_m"], ".3f"),
            number(row["cross_track_rmse_m"], ".3f"),
            " ".join(number(value, ".3f") for value in row["force_r2"]),
            number(100 * row["fallback_rate"], ".1f"),
            number(row["force_call_ns"], ".0f"),
        )
    return made


def surrogates_table(metrics: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> Table:
    """Return R² on unseen runs, by surrogate name."""
    made = table("Surrogates, R² on unseen runs", ["surrogate", *(_SYMBOLS[name] for name in OUTPUT_NAMES)])
    for name, values in metrics.items():
        made.add_row(name, *(number(values[output]["r2"], ".4f") for output in OUTPUT_NAMES))
    return made


def metrics_table(title: str, metrics: Mapping[str, Mapping[str, Any]]) -> Table:
    """Return every metric of one surrogate, by output."""
    made = table(
        title, ["output", "unit", "RMSE", "MAE", "R²", "bias", "P95 of |error|", "max |error|"], text_columns=2
    )
    for output in OUTPUT_NAMES:
        values = metrics[output]
        made.add_row(
            _SYMBOLS[output],
            _UNITS[output],
            *(number(values[key], ".1f") for key in ("rmse", "mae")),
            number(values["r2"], ".5f"),
            *(number(values[key], ".1f") for key in ("bias", "p95_abs", "max_abs")),
        )
    return made


def number(value: float | None, form: str) -> str:
    """Return a number as text; – where there is none."""
    return "–" if value is None else format(value, form)
