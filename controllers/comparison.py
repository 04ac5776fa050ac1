"""The same drivers on every backend, and what changes: paired drives, one row each, in ``compare.json``."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from importlib.metadata import version
from time import perf_counter
from typing import Any, Final

import numpy as np

from ..envs import BeltCommand, Driver, InterfaceLog, Simulator, VehicleState, rollout
from ..terrain import ForceBackend, InvalidInputError, SimulationDivergedError, make_backend
from .comparison_row import TIME_FIELDS, ComparisonRow, Drive
from .drive_measures import corridor_violation, force_call_ns, force_noise, force_r2, rms_over
from .scenario import Scenario, path_driven_or_lost, start_state

REFERENCE_BACKEND: Final = "physics"

Progress = Callable[[str], None]


class _Timed:
    """A driver that counts the commands that took longer than the control period."""

    def __init__(self, driver: Driver, period: float) -> None:
        self.driver = driver
        self.period = getattr(driver, "period", period)
        self.misses = 0

    def reset(self) -> None:
        self.misses = 0
        self.driver.reset()

    def command(self, state: VehicleState) -> BeltCommand:
        began = perf_counter()
        command = self.driver.command(state)
        self.misses += perf_counter() - began > self.period
        return command


def compare(
    scenarios: Sequence[Scenario],
    backends: Sequence[str],
    *,
    seeds: Sequence[int] = (0,),
    control_period: float = 0.1,
    progress: Progress | None = None,
) -> list[Drive]:
    """Drive every scenario with each of its controllers on every backend, from equal starts.

    Parameters
    ----------
    scenarios : sequence of Scenario
        What to drive.
    backends : sequence of str
        Names; physics is driven first, whatever its place, for the others to be held against.
    seeds : sequence of int
        Initial offsets: each draws a lateral offset within ±0.1 m and a heading offset within ±0.01 rad.
    control_period : float
        In s.
    progress : callable, optional
        Called with a description before each drive.

    Returns
    -------
    list of Drive
        In order of scenario, controller, seed, backend.

    Raises
    ------
    InvalidInputError
        If there is nothing to compare.
    """
    if not scenarios or not backends or not seeds or not all(scenario.drivers for scenario in scenarios):
        raise InvalidInputError("a comparison needs at least one scenario, backend and seed, and a driver for each")
    order = list(dict.fromkeys((REFERENCE_BACKEND, *backends)))
    drives = []
    for scenario in scenarios:
        built = {name: _backend(scenario, name) for name in order}
        for controller, factory in scenario.drivers.items():
            for seed in seeds:
                reference: Drive | None = None
                for name in order:
                    if progress:
                        progress(f"{scenario.name} · {controller} · {name}")
                    drive = _drive(scenario, controller, factory(), name, built, seed, control_period, reference)
                    reference = reference or drive
                    drives.append(drive)
    return drives


def document(drives: Sequence[Drive], meta: Mapping[str, Any]) -> dict[str, Any]:
    """Return what ``compare.json`` holds: ``{"meta": ..., "rows": [...]}``."""
    return {
        "meta": {"grouser": version("grouser"), "time_fields": list(TIME_FIELDS), **meta},
        "rows": [asdict(drive.row) for drive in drives],
    }


def without_times(compared: Mapping[str, Any]) -> dict[str, Any]:
    """Return a comparison without the fields that hold times, for telling whether two are equal."""
    rows = [{key: value for key, value in row.items() if key not in TIME_FIELDS} for row in compared["rows"]]
    return {"meta": {key: value for key, value in compared["meta"].items() if key != "times"}, "rows": rows}


def _backend(scenario: Scenario, name: str) -> ForceBackend:
    options = scenario.backend_options.get(name, {})
    return make_backend(name, mode=scenario.ground.mode, vehicle=scenario.vehicle, **options)


def _drive(
    scenario: Scenario,
    controller: str,
    driver: Driver,
    name: str,
    backends: Mapping[str, ForceBackend],
    seed: int,
    control_period: float,
    reference: Drive | None,
) -> Drive:
    path, vehicle, backend = scenario.path, scenario.vehicle, backends[name]
    simulator = Simulator(vehicle, backend, scenario.ground, state=start_state(scenario, seed))
    timed = _Timed(driver, control_period)
    over = path_driven_or_lost(path, scenario.maximum_cross_track)
    try:
        log = rollout(simulator, timed, scenario.time_limit, control_period=control_period, until=over)
    except SimulationDivergedError as error:
        # A surrogate far outside its data may well diverge: that is a result, not a reason to lose the others.
        if not isinstance(error.log, InterfaceLog):
            raise
        log = error.log
    arc_length, cross_track = path.follow(log.states[:, :2])
    truth = log.recomputed(backends[REFERENCE_BACKEND])
    against = reference.log if reference else log
    ticks = round(control_period / simulator.tick)
    common = min(len(log), len(against))
    moves, their_moves = log.commands[:common:ticks], against.commands[:common:ticks]
    position = log.states[common, :2] - against.states[common, :2]
    heading = log.state("heading")[common] - against.state("heading")[common]
    row = ComparisonRow(
        scenario=scenario.name,
        terrain=scenario.terrain,
        controller=controller,
        backend=name,
        seed=seed,
        finished=bool(arc_length[-1] >= path.length and abs(cross_track[-1]) <= scenario.maximum_cross_track),
        cross_track_rmse_m=float(np.sqrt(np.mean(cross_track**2))),
        corridor_violation_m=corridor_violation(path, vehicle, log),
        final_position_difference_m=float(np.hypot(*position)),
        final_heading_difference_rad=abs(math.remainder(float(heading), 2 * math.pi)),
        force_r2=[force_r2(log.forces[:, i], truth[:, i], noise) for i, noise in enumerate(force_noise(vehicle))],
        first_move_difference_rms=rms_over(moves - their_moves, vehicle.training_speed),
        failed_solves=sum(not record.success for record in getattr(driver, "records", ())),
        fallback_rate=log.fallback_rate,
        switches=log.switches,
        force_call_ns=force_call_ns(backend, log.inputs),
        deadline_misses=timed.misses,
    )
    return Drive(row, log)
