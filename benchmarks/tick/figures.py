"""The study's three figures."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from .chatter import SPEED, Chatter, drive, drive_live
from .cost import Cost
from .hosts import BELTS_AT_END, EXPLICIT, MEAN_FORCE, METHODS, TICKS, Case, Method
from .live import LiveStudy
from .order import EXACT_BODY, Errors, OrderStudy
from .runs import COMPARISON_PERIOD
from .stability import REAL_LIMIT, Probe, StabilityMap

# Okabe and Ito's colours, told apart without colour vision; markers and lines tell them apart in print.
_STYLES: Final[dict[str, dict[str, Any]]] = {
    "implicit": {"color": "#0072B2", "marker": "o", "label": "implicit (backward Euler)"},
    "sdirk2": {"color": "#D55E00", "marker": "s", "label": "SDIRK2"},
    "euler": {"color": "#009E73", "marker": "^", "label": "Euler"},
    "rk4": {"color": "#CC79A7", "marker": "D", "label": "RK4"},
    EXACT_BODY: {"color": "black", "linestyle": ":", "label": EXACT_BODY, "zorder": 5},
    BELTS_AT_END: {"color": "#56B4E9", "marker": "o", "fillstyle": "none", "linestyle": "--", "label": BELTS_AT_END},
    MEAN_FORCE: {
        "color": "#E69F00",
        "marker": "s",
        "fillstyle": "none",
        "linestyle": "--",
        "label": "SDIRK2, mean force remembered",
    },
}
_TITLES: Final[dict[str, str]] = {"implicit": "implicit", "sdirk2": "SDIRK2", "euler": "Euler", "rk4": "RK4"}
_MILLISECONDS: Final = [1000 * tick for tick in TICKS]
# Untyped: matplotlib's stubs spell out every key.
_SETTINGS: Final[Any] = {
    "font.size": 9,
    "axes.titlesize": 9.5,
    "legend.fontsize": 8,
    "axes.grid": True,
    "grid.alpha": 0.3,
}
_MAP_SETTINGS: Final[Any] = {**_SETTINGS, "axes.grid": False}
_MAP_LEVELS: Final = (0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100)
_DRAWN_STOPS: Final[tuple[Method, ...]] = ("euler", "rk4", "sdirk2", "implicit")
_DRAWN_STRAIGHT: Final[tuple[tuple[Method, float, str], ...]] = (
    ("euler", 0.010, "-"),
    ("euler", 0.002, "--"),
    ("implicit", 0.010, "-"),
)


def _style(name: str, /, **changes: Any) -> dict[str, Any]:
    return {"linewidth": 1.4, "markersize": 5, **_STYLES[name], **changes}


def _save(figure: Figure, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(target, dpi=150, metadata={"Software": None})


def _tick_axis(axes: Any) -> None:
    axes.set_xscale("log")
    axes.set_xticks(_MILLISECONDS, [f"{value:g}" for value in _MILLISECONDS])
    axes.minorticks_off()
    axes.set_xlabel("tick $T_s$, ms")


def draw_order(study: OrderStudy, live: LiveStudy, costs: list[Cost], track_arm: float, target: Path) -> None:
    """Draw error over tick, memory and belts held and live, and error over cost.

    Parameters
    ----------
    study : OrderStudy
        Drive without a stop.
    live : LiveStudy
        The runs of the right panel.
    costs : list of Cost
        Its abscissa.
    track_arm : float
        B/2 in m, at which ω counts.
    target : Path
        Image.
    """
    with mpl.rc_context(_SETTINGS):
        figure = Figure(figsize=(11, 4.8))
        left, middle, right = figure.subplots(1, 3)
        _draw_errors(left, study.held)
        _label_slopes(left, study.held)
        left.set_title("(a) the method alone: memory and belts held")
        _draw_errors(middle, study.live)
        middle.set_title("(b) the same drive against continuous time")
        # A variant costs what its method costs.
        for label, method in (*zip(METHODS, METHODS, strict=True), (BELTS_AT_END, "implicit"), (MEAN_FORCE, "sdirk2")):
            wall = [cost.wall_ratio for cost in costs if cost.method == method]
            pooled = live.pooled(label) * np.array([1.0, 1.0, track_arm])
            right.loglog(wall, 1000 * np.linalg.norm(pooled, axis=1), **_style(label))
        right.set_xlabel("wall time over the implicit 10 ms tick's")
        right.set_ylabel("error of velocity at the track, mm/s")
        right.set_title("(c) six driven runs: error over cost")
        _plain_ticks(right.xaxis, [0.5, 1, 2, 5, 10])
        for axes, marks in ((middle, [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2]), (right, [0.1, 0.2, 0.5, 1, 2, 5])):
            _plain_ticks(axes.yaxis, marks)
        handles, labels = middle.get_legend_handles_labels()
        figure.legend(handles, labels, loc="lower center", ncols=4, frameon=False)
        figure.tight_layout(rect=(0, 0.11, 1, 1))
        _save(figure, target)


def _draw_errors(axes: Any, errors: list[Errors]) -> None:
    for entry in errors:
        axes.plot(_MILLISECONDS, [1000 * value for value in entry.errors], **_style(entry.label))
    axes.set_yscale("log")
    _tick_axis(axes)
    axes.set_ylabel("error of velocity at the track, mm/s")


def _label_slopes(axes: Any, errors: list[Errors]) -> None:
    for entry in errors:
        middle = 1000 * float(np.sqrt(entry.errors[1] * entry.errors[2]))
        text = f"{_TITLES[entry.label]}: slope {entry.order:.2f}"
        above = entry.label == "implicit"
        offset = (-22, 14) if above else (-22, -16 if entry.label == "euler" else -24)
        axes.annotate(text, (np.sqrt(10.0), middle), xytext=offset, textcoords="offset points", fontsize=8)


def _plain_ticks(axis: Any, marks: list[float]) -> None:
    axis.set_ticks(marks, [f"{mark:g}" for mark in marks])
    axis.set_minor_locator(NullLocator())


def draw_transients(soft: Case, stiff: Case, chatters: dict[str, list[Chatter]], target: Path) -> None:
    """Draw what a stop and a straight run look like, and the speed left after a stop.

    Parameters
    ----------
    soft, stiff : Case
        An ordinary and a stiff ground.
    chatters : dict
        Of both, by case name.
    target : Path
        Image.
    """
    with mpl.rc_context(_SETTINGS):
        figure = Figure(figsize=(11, 7))
        (speed, force), (moment, left) = figure.subplots(2, 2)
        _draw_stop(speed, force, soft)
        _draw_straight(moment, stiff)
        for case, line in ((soft, "-"), (stiff, "--")):
            for method in METHODS:
                rows = [c for c in chatters[case.name] if c.maneuver == "brake" and c.method == method]
                style = _style(method, linestyle=line, label=f"{_TITLES[method]}, {case.name}")
                left.plot([1000 * c.tick for c in rows], [1000 * c.speed_left for c in rows], **style)
        left.set_yscale("log")
        left.set_ylim(1e-8, 1e3)
        _tick_axis(left)
        left.set_ylabel("speed left, mm/s")
        left.set_title("(d) speed left 5 s after the command to stop")
        left.legend(ncols=2, loc="center", frameon=False)
        figure.tight_layout()
        _save(figure, target)


def _draw_stop(speed: Any, force: Any, case: Case) -> None:
    tick = TICKS[0]
    reference = drive_live(case, "brake")
    for method in _DRAWN_STOPS:
        trajectory = drive(case, "brake", method, tick)
        time = tick * np.arange(len(trajectory.bodies))
        style = _style(method, marker="", label=_TITLES[method])
        speed.plot(time, 1000 * trajectory.bodies[:, 0], **style)
        force.step(time[1:], trajectory.forces[:, 0] / 1000, where="pre", **style)
    instants = COMPARISON_PERIOD * np.arange(len(reference))
    speed.plot(instants, 1000 * reference[:, 0], color="black", linestyle=":", linewidth=1.6, label="continuous time")
    for axes in (speed, force):
        axes.set_xlim(0.5, 2.0)
        axes.set_xlabel("time since the command to stop, s")
        axes.legend(loc="upper right", ncols=2)
    speed.set_ylim(-40, 320)
    speed.set_ylabel("forward speed $V_x$, mm/s")
    speed.set_title(f"(a) stop from {SPEED:g} m/s on {case.name}, 10 ms")
    force.set_ylim(-130, 190)
    force.set_ylabel("force $Q_x$, kN")
    force.set_title("(b) the force that each tick remembers in the same stop")


def _draw_straight(axes: Any, case: Case) -> None:
    for method, tick, line in _DRAWN_STRAIGHT:
        trajectory = drive(case, "straight", method, tick)
        time = tick * np.arange(1, len(trajectory.bodies))
        label = f"{_TITLES[method]}, {1000 * tick:g} ms"
        style = _style(method, marker="", linestyle=line, label=label)
        axes.step(time, trajectory.forces[:, 2] / 1000, where="pre", **style)
    axes.set_xlim(0, 0.4)
    axes.set_ylim(-60, 80)
    axes.set_xlabel("time, s")
    axes.set_ylabel("yaw moment $M_z$, kN m")
    axes.set_title(f"(c) straight on at {SPEED:g} m/s on {case.name}, nudged by .01 rad/s")
    axes.legend(loc="upper right", ncols=3)


def draw_stability(maps: list[StabilityMap], probes: list[Probe], default_soft_speed: float, target: Path) -> None:
    """Draw the largest stable tick of explicit hosts over V_ε and speed, a column a K and a row a method.

    Parameters
    ----------
    maps : list of StabilityMap
        One a K; their speeds are positive.
    probes : list of Probe
        Simulated points, marked where they lie.
    default_soft_speed : float
        V_ε of the vehicle in m/s.
    target : Path
        Image.
    """
    with mpl.rc_context(_MAP_SETTINGS):
        figure = Figure(figsize=(11, 7.2))
        grid = figure.subplots(len(EXPLICIT), len(maps), sharex=True, sharey=True)
        for row, method in zip(grid, EXPLICIT, strict=True):
            for axes, entry in zip(row, maps, strict=True):
                shading = _draw_map(axes, entry, method)
                axes.axvline(default_soft_speed, color="white", linestyle="--", linewidth=0.9)
                _draw_probes(axes, entry, [p for p in probes if p.method == method])
                limit = rf"$|h\lambda| \leq {REAL_LIMIT[method]:.4g}$"
                axes.set_title(f"{_TITLES[method]} ({limit}), $K$ = {1000 * entry.shear_modulus:g} mm")
            row[0].set_ylabel("speed $V$, m/s (bottom: at rest)")
        for axes in grid[-1]:
            axes.set_xlabel("soft speed $V_\\varepsilon$, m/s")
        bar = figure.colorbar(shading, ax=grid, ticks=_MAP_LEVELS, shrink=0.9)
        bar.set_label("largest stable tick, ms")
        bar.ax.set_yticklabels([f"{level:g}" for level in _MAP_LEVELS])
        figure.set_layout_engine("constrained", wspace=0.05)
        _save(figure, target)


def _draw_map(axes: Any, entry: StabilityMap, method: Method) -> Any:
    ticks = 1000 * entry.largest_tick(method).T
    grid = (entry.soft_speeds, entry.speeds, ticks)
    axes.set_xscale("log")
    axes.set_yscale("log")
    shading = axes.contourf(
        *grid, levels=_MAP_LEVELS, norm=BoundaryNorm(_MAP_LEVELS, 256, extend="both"), cmap="cividis", extend="both"
    )
    axes.contour(*grid, levels=_MILLISECONDS[::-1], colors="white", linewidths=[2.6, 1.1, 1.1, 1.1])
    for level in _MILLISECONDS:
        crossing = float(np.exp(np.interp(np.log(level), np.log(ticks[:, 0]), np.log(entry.speeds))))
        if ticks[0, 0] < level < 0.75 * ticks[-1, 0]:
            text = f"{level:g} ms" + (" (1 kHz)" if level == 1 else "")
            axes.text(0.0115, 1.06 * crossing, text, color="white", fontsize=8, va="bottom")
    _plain_ticks(axes.xaxis, [0.01, 0.03, 0.1, 0.3, 1])
    _plain_ticks(axes.yaxis, [0.01, 0.1, 1, 10])
    return shading


def _draw_probes(axes: Any, entry: StabilityMap, probes: list[Probe]) -> None:
    for probe in probes:
        if probe.shear_modulus == entry.shear_modulus:
            axes.plot(
                probe.soft_speed,
                max(probe.speed, entry.speeds[0]),
                marker="o" if probe.agrees else "X",
                color="#D55E00",
                markeredgecolor="white",
                markersize=6,
                clip_on=False,
                linestyle="",
                zorder=10,
            )
