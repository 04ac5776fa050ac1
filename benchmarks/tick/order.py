"""The order of every method, against Radau: within the tick, memory and belts held, and in continuous time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from grouser.envs import VehicleState

from .hosts import METHODS, TICKS, VARIANTS, Case, Method, make_host, step_held
from .reference import TickReference, solve_live, solve_ticks
from .runs import ORDER_RUN, Trajectory, observed_order, play, velocity_error

#: Label of the tick whose body is solved exactly: what memory and belts alone leave of an error.
EXACT_BODY: Final = "body solved by Radau"


@dataclass(frozen=True)
class Errors:
    """Errors of one method over the ticks of the study.

    Parameters
    ----------
    label : str
        Method.
    errors : list of float
        In m/s, ω at the track's centre, at 10, 5, 2, 1 ms.
    """

    label: str
    errors: list[float]

    @property
    def order(self) -> float:
        """Slope by least squares over all ticks."""
        return observed_order(TICKS, self.errors)

    @property
    def last_order(self) -> float:
        """Slope from 2 ms to 1 ms."""
        return observed_order(TICKS[-2:], self.errors[-2:])


@dataclass(frozen=True, eq=False)
class OrderStudy:
    """One drive without a stop.

    Parameters
    ----------
    held : list of Errors
        Every tick's memory and V_mid taken from Radau's drive: the method alone.
    own : list of Errors
        Each method's own memory and belts, still against Radau within the tick.
    live : list of Errors
        The same drives against continuous time.
    """

    held: list[Errors]
    own: list[Errors]
    live: list[Errors]


def play_held(case: Case, method: Method, reference: TickReference, start: VehicleState) -> Trajectory:
    """Drive through the memory and the V_mid of the reference."""
    tick = reference.trajectory.tick
    host = make_host(case, method, tick, start)
    bodies, forces = [reference.trajectory.bodies[0]], []
    for memory, belts in zip(reference.memories, reference.belts, strict=True):
        state = replace(host.get_state(), ax=float(memory[0]), ay=float(memory[1]))
        moved = step_held(host, state, (float(belts[0]), float(belts[1])))
        bodies.append(np.array([moved.state.vx, moved.state.vy, moved.state.yaw_rate]))
        forces.append(moved.forces)
    return Trajectory(tick, np.array(bodies), np.array(forces))


def study_order(case: Case) -> OrderStudy:
    """Measure the orders on one case."""
    vehicle = case.vehicle
    start, commands = ORDER_RUN.initial_state(vehicle), ORDER_RUN.commands(vehicle)
    references = [solve_ticks(case, start, commands, tick) for tick in TICKS]
    continuous = solve_live(case, start, commands).bodies
    held, own, live = [], [], []
    for method in METHODS:
        alone = [play_held(case, method, reference, start) for reference in references]
        drives = [play(make_host(case, method, tick, start), commands, tick) for tick in TICKS]
        held.append(Errors(method, _against(case, alone, [r.trajectory.compared() for r in references])))
        own.append(Errors(method, _against(case, drives, [r.trajectory.compared() for r in references])))
        live.append(Errors(method, _against(case, drives, [continuous] * len(TICKS))))
    live.append(Errors(EXACT_BODY, _against(case, [r.trajectory for r in references], [continuous] * len(TICKS))))
    for variant in VARIANTS:
        drives = [play(make_host(case, variant, tick, start), commands, tick) for tick in TICKS]
        live.append(Errors(variant, _against(case, drives, [continuous] * len(TICKS))))
    return OrderStudy(held, own, live)


def _against(case: Case, drives: list[Trajectory], references: list[np.ndarray]) -> list[float]:
    return [
        velocity_error(case.vehicle, drive.compared() - reference)
        for drive, reference in zip(drives, references, strict=True)
    ]
