"""Plots and one self-contained page of a comparison."""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path as FilePath
from typing import Any, Final

import numpy as np

from ..envs import Path
from ..terrain import OUTPUT_NAMES, TerrainField, missing_extra, write_aside
from .comparison_row import TIME_FIELDS, Drive
from .scenario import Scenario

# Okabe-Ito: told apart by the colour-blind, and in grey.
BACKEND_COLORS: Final = {"physics": "#000000", "torch": "#0072B2", "native": "#E69F00", "guarded": "#009E73"}
_OTHER_COLOR: Final = "#CC79A7"
_STYLES: Final = {"physics": "-", "torch": "--", "native": "-.", "guarded": ":"}
_UNITS: Final = {"qx": "Qx (kN)", "qy": "Qy (kN)", "mz": "Mz (kN m)"}


def overlay_plot(scenario: Scenario, controller: str, drives: Sequence[Drive]) -> bytes:
    """Return a PNG: the driven paths over each other, cross-track error, forces, and the guard.

    Raises
    ------
    ConfigurationError
        If matplotlib is not installed.
    """
    figure_class, _ = _matplotlib()
    figure = figure_class(figsize=(11, 11.5), layout="constrained")
    axes = figure.subplots(6, 1, height_ratios=(2.0, 1, 1, 1, 1, 0.8))
    _draw_path(axes[0], scenario.path)
    for drive in drives:
        name = drive.row.backend
        style = {"color": BACKEND_COLORS.get(name, _OTHER_COLOR), "linestyle": _STYLES.get(name, "-"), "linewidth": 1.4}
        log = drive.log
        time = log.state("time")
        axes[0].plot(log.state("x"), log.state("y"), label=name, **style)
        axes[1].plot(time, scenario.path.follow(log.states[:, :2])[1], **style)
        for i, output in enumerate(OUTPUT_NAMES):
            axes[2 + i].plot(time[1:], log.forces[:, i] / 1000, **style)
            axes[2 + i].set_ylabel(_UNITS[output])
        if np.isfinite(log.ood_score).any():
            axes[5].plot(time[1:], log.ood_score, color=style["color"], linewidth=1.0, label="score")
            axes[5].fill_between(
                time[1:],
                0,
                1,
                where=log.fallback_weight > 0,
                color=style["color"],
                alpha=0.25,
                step="pre",
                transform=axes[5].get_xaxis_transform(),
                label="physics answers",
            )
            axes[5].axhline(1.0, color="0.5", linewidth=0.8)
            axes[5].set_yscale("log")
            axes[5].legend(loc="upper right", fontsize=8, ncols=2)
    low, high = axes[0].get_ylim()
    axes[0].set_ylim(low, high + 0.25 * (high - low))
    axes[0].set(title=f"{scenario.name}: {controller} on {scenario.terrain}", xlabel="x (m)", ylabel="y (m)")
    if isinstance(scenario.ground, TerrainField):
        _draw_ground(axes[0], scenario.ground)
    axes[0].legend(loc="upper right", ncols=len(drives) + 2, fontsize=8)
    axes[1].set_ylabel("cross-track (m)")
    axes[5].set(ylabel="OOD score", xlabel="time (s)")
    for axis in axes[1:]:
        axis.grid(alpha=0.3)
        axis.sharex(axes[5])
    return _png(figure)


def _draw_ground(axis: Any, field: TerrainField) -> None:
    """Tint the ground by its friction, μ or tan φ, the bluer the less it holds; the axis keeps its limits."""
    limits = axis.axis()
    rigid = field.mode == "rigid"
    friction = field.parameters[..., 0] if rigid else np.tan(field.parameters[..., 1])
    image = axis.imshow(
        friction, extent=field.extent, origin="lower", cmap="Blues_r", vmin=0.0, vmax=1.0, alpha=0.4, aspect="auto"
    )
    image.set_zorder(0)
    axis.axis(limits)
    axis.figure.colorbar(image, ax=axis, label="μ" if rigid else "tan φ", ticks=(0.0, 0.2, 0.4, 0.6, 0.8, 1.0))


def report_page(
    compared: Mapping[str, Any], plots: Mapping[str, bytes], artifacts: Mapping[str, Mapping[str, Any]]
) -> str:
    """Return one HTML page with the table, the surrogates' test metrics and every plot inside.

    Parameters
    ----------
    compared : mapping
        What ``compare.json`` holds.
    plots : mapping of str to bytes
        PNG by caption.
    artifacts : mapping of str to mapping
        Test metrics by surrogate name.
    """
    columns = [
        ("scenario", "scenario"), ("controller", "controller"), ("backend", "backend"), ("seed", "seed"), ("finished", "finished"),
        ("corridor_violation_m", "out of lane, m"), ("cross_track_rmse_m", "cross-track RMSE, m"),
        ("final_position_difference_m", "end from physics, m"), ("force_r2", "R² of Qx, Qy, Mz on the way"),
        ("first_move_difference_rms", "command difference"), ("fallback_rate", "fallback"),
        ("force_call_ns", "force call, ns"),
    ]  # fmt: skip
    head = "".join(f"<th>{html.escape(label)}</th>" for _, label in columns)
    body = "\n".join(
        "<tr>" + "".join(f"<td>{html.escape(_cell(row[key]))}</td>" for key, _ in columns) + "</tr>"
        for row in compared["rows"]
    )
    metrics = "\n".join(
        f"<tr><td>{html.escape(name)}</td>"
        + "".join(f"<td>{_cell(values[o]['r2'])}</td>" for o in OUTPUT_NAMES)
        + "</tr>"
        for name, values in artifacts.items()
    )
    figures = "\n".join(
        f'<figure><img alt="{html.escape(caption)}" src="data:image/png;base64,{base64.b64encode(png).decode()}">'
        f"<figcaption>{html.escape(caption)}</figcaption></figure>"
        for caption, png in plots.items()
    )
    return _PAGE.format(
        head=head, body=body, metrics=metrics, figures=figures, times=", ".join(TIME_FIELDS),
        version=html.escape(str(compared["meta"].get("grouser", ""))),
        summary=html.escape(str(compared["meta"].get("summary", ""))),
    )  # fmt: skip


def write_report(
    folder: FilePath,
    compared: Mapping[str, Any],
    drives: Sequence[Drive],
    scenarios: Sequence[Scenario],
    artifacts: Mapping[str, Mapping[str, Any]],
) -> list[FilePath]:
    """Write the overlay plots and ``report.html`` into a folder; return the files."""
    folder.mkdir(parents=True, exist_ok=True)
    plots, files = {}, []
    for scenario in scenarios:
        for controller in scenario.drivers:
            chosen = [d for d in drives if (d.row.scenario, d.row.controller) == (scenario.name, controller)]
            first_seed = [d for d in chosen if d.row.seed == chosen[0].row.seed]
            png = overlay_plot(scenario, controller, first_seed)
            stem = re.sub(r"[^\w.-]+", "-", f"{scenario.name}-{controller}")
            files.append(write_aside(folder / f"{stem}.png", png))
            plots[f"{scenario.name}, {controller}"] = png
    page = write_aside(folder / "report.html", report_page(compared, plots, artifacts).encode())
    return [*files, page]


def _draw_path(axis: Any, path: Path) -> None:
    if path.corridor is not None:
        for lane in path.corridor.lanes:
            axis.fill_between([lane.start, lane.end], lane.right, lane.left, color="0.9", linewidth=0)
            axis.plot([lane.start, lane.end], [lane.left] * 2, color="0.6", linewidth=0.8)
            axis.plot([lane.start, lane.end], [lane.right] * 2, color="0.6", linewidth=0.8)
    axis.plot(path.x, path.y, color="0.5", linewidth=0.8, linestyle=(0, (8, 6)), label="path")


def _cell(value: Any) -> str:
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.4g}"
    if isinstance(value, list):
        return ", ".join("–" if item is None else f"{item:.4f}" for item in value)
    return str(value)


def _png(figure: Any) -> bytes:
    buffer = BytesIO()
    # Without metadata equal figures are equal files.
    figure.savefig(buffer, format="png", dpi=110, metadata={"Software": None})
    return buffer.getvalue()


def _matplotlib() -> tuple[Any, Any]:
    try:
        import matplotlib
        from matplotlib.figure import Figure
    except ImportError as error:
        raise missing_extra("matplotlib", "plot") from error
    return Figure, matplotlib


_PAGE: Final = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>grouser: the same drivers on every backend</title>
<style>
:root {{ color-scheme: light; }}
body {{ font: 15px/1.5 system-ui, sans-serif; max-width: 1180px; margin: 2rem auto; padding: 0 1rem; color: #222; }}
h1 {{ font-size: 1.5rem; }} h2 {{ font-size: 1.15rem; margin-top: 2rem; }}
.scroll {{ overflow-x: auto; }}
table {{ border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: 13px; }}
th, td {{ padding: .25rem .6rem; border-bottom: 1px solid #ddd; text-align: left; white-space: nowrap; }}
th {{ background: #f4f4f4; }}
figure {{ margin: 1.5rem 0; }} img {{ width: 100%; height: auto; border: 1px solid #ddd; }}
figcaption {{ color: #555; font-size: 13px; }}
</style></head><body>
<h1>The same drivers on every backend</h1>
<p>{summary}</p>
<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>
{body}
</tbody></table></div>
<p>“End from physics” is the distance from the drive on physics when the shorter of the two ended; “command difference”
is the RMS difference of the belt commands over the training speed; the R² hold each backend's forces against physics
at the inputs that its own drive logged, where steady driving leaves little to explain and small errors weigh
much. Times ({times}) vary from run to run.</p>
<h2>Surrogates, R² on unseen runs</h2>
<div class="scroll"><table><thead><tr><th>surrogate</th><th>Qx</th><th>Qy</th><th>Mz</th></tr></thead><tbody>
{metrics}
</tbody></table></div>
<h2>Drives</h2>
{figures}
<p>grouser {version}</p>
</body></html>
"""
