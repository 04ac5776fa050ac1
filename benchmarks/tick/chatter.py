"""How much the forces jump from tick to tick where nothing should happen: at rest, and straight at constant speed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from grouser.envs import BeltCommand, VehicleState
from grouser.terrain import FloatArray

from .hosts import METHODS, TICKS, Case, Method, make_host
from .reference import solve_live
from .runs import CONTROL_PERIOD, Trajectory, play, root_mean_square

SPEED: Final = 3.0
DURATION: Final = 5.0
WINDOW: Final = 2.0
#: In rad/s; without it a straight run is symmetric to the last bit and shows no yaw moment at all.
NUDGE: Final = 0.01


@dataclass(frozen=True)
class Chatter:
    """Chatter of one drive.

    Parameters
    ----------
    maneuver : {"brake", "straight"}
        Belts commanded from 3 m/s to 0, or held at 3 m/s.
    method : str
        Method.
    tick : float
        T_s in s.
    force_change, moment_change : float
        Root mean square of the tick-to-tick change of Qx in N and Mz in N m over the last 2 of 5 s.
    speed_left : float
        After braking, the speed in m/s at the end; straight on, how far the velocity then is from continuous time's.
    """

    maneuver: str
    method: Method
    tick: float
    force_change: float
    moment_change: float
    speed_left: float


def drive(case: Case, maneuver: str, method: Method, tick: float) -> Trajectory:
    """Brake, or run straight on."""
    start, commands = _script(maneuver)
    return play(make_host(case, method, tick, start), commands, tick)


def drive_live(case: Case, maneuver: str) -> FloatArray:
    """Return (Vx, Vy, ω) of the same in continuous time, at every comparison instant."""
    return solve_live(case, *_script(maneuver)).bodies


def _script(maneuver: str) -> tuple[VehicleState, list[BeltCommand]]:
    start = VehicleState.rolling(SPEED)
    target = 0.0 if maneuver == "brake" else SPEED
    if maneuver == "straight":
        start = replace(start, yaw_rate=NUDGE)
    return start, [BeltCommand(target, target)] * round(DURATION / CONTROL_PERIOD)


def study_chatter(case: Case) -> list[Chatter]:
    """Measure every method at every tick."""
    targets = {"brake": np.zeros(2), "straight": drive_live(case, "straight")[-1, :2]}
    return [
        _chatter(maneuver, method, tick, drive(case, maneuver, method, tick), target)
        for maneuver, target in targets.items()
        for method in METHODS
        for tick in TICKS
    ]


def _chatter(maneuver: str, method: Method, tick: float, trajectory: Trajectory, target: FloatArray) -> Chatter:
    changes = root_mean_square(np.diff(trajectory.forces[-round(WINDOW / tick) :], axis=0))
    left = trajectory.bodies[-1, :2] - target
    return Chatter(maneuver, method, tick, float(changes[0]), float(changes[2]), float(np.linalg.norm(left)))
