"""One run of each maneuver on one ground."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from benchmarks.data.style import BLUE, GREEN, GREY, ORANGE, SETTINGS, save
from grouser.envs import InterfaceLog, Simulator, rollout
from grouser.surrogate.offline import MANEUVERS, DataConfig, draw_maneuver
from grouser.terrain import TrackedVehicle, named

#: Seeds whose draws show what the maneuver varies, none near the end of its range.
SEEDS: Final = {"straight": 36, "turn": 36, "skid_reversal": 32, "pivot": 22, "reversal": 32, "prbs": 18}
#: How much of a run is drawn, in s.
SHOWN: Final = 22.0
TICK: Final = 0.01


def drive_maneuver(name: str, vehicle: TrackedVehicle, ground: str) -> InterfaceLog:
    """Return the log of a maneuver from standstill, without a cut."""
    maneuver = draw_maneuver(name, vehicle, np.random.default_rng(SEEDS[name]), SHOWN)
    return rollout(Simulator(vehicle, "physics", named(ground), tick=TICK), maneuver, SHOWN, control_period=TICK)


def draw_excitation(vehicle: TrackedVehicle, ground: str, target: Path) -> None:
    """Draw six rows: belt commands, forward velocity and yaw rate of each maneuver."""
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(10.5, 10.5), layout="constrained")
        grid = figure.subplots(len(MANEUVERS), 3, sharex=True)
        for row, name in zip(grid, MANEUVERS, strict=True):
            log = drive_maneuver(name, vehicle, ground)
            time = log.state("time")
            belts, forward, turning = row
            belts.plot(time[:-1], log.commands[:, 0], color=BLUE, label="left")
            belts.plot(time[:-1], log.commands[:, 1], color=ORANGE, linestyle="--", label="right")
            left, right = log.state("v_left"), log.state("v_right")
            rolling = {"color": GREY, "linewidth": 1.0, "linestyle": "--", "label": "belts without slip"}
            forward.plot(time, (left + right) / 2, **rolling)
            forward.plot(time, log.state("vx"), color=GREEN, label="vehicle")
            turning.plot(time, (right - left) / vehicle.tread, **rolling)
            turning.plot(time, log.state("yaw_rate"), color=GREEN, label="vehicle")
            belts.set_ylabel(name, fontweight="bold")
            for axes in row:
                axes.axvspan(0.0, DataConfig().transient, color="0.9", linewidth=0)
                axes.axhline(0.0, color="0.3", linewidth=0.6)
                axes.margins(x=0)
            # Exactly straight is a line, not noise on a scale of its own.
            widest = max(1.0, 1.1 * max(abs(value) for value in turning.get_ylim()))
            turning.set_ylim(-widest, widest)
            for axes in (belts, forward):
                axes.set_ylim(-1.08 * vehicle.training_speed, 1.08 * vehicle.training_speed)
        for axes, title in zip(
            grid[0], ("belt-speed command, m/s", "forward velocity $V_x$, m/s", "yaw rate ω, rad/s"), strict=True
        ):
            axes.set_title(title)
        for axes in grid[-1]:
            axes.set_xlabel("time, s")
        handles = [*grid[0, 0].get_lines()[:2], *grid[0, 1].get_lines()[1::-1]]
        labels = ["left belt, command", "right belt, command", "vehicle", "the same belts without slip"]
        figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
        save(figure, target)
