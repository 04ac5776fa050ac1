"""The same drivers on every backend, and what changes: paired drives, one row each, in ``compare.json``."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from time import perf_counter
from typing import Any, Final

import numpy as np

from ..envs import BeltCommand, Driver, InterfaceLog, Path, Simulator, VehicleState, rollout
from ..surrogate.offline.metrics import output_metrics
from ..terrain import (
    FloatArray,
    ForceBackend,
    Ground,
    InvalidInputError,
    SimulationDivergedError,
    TrackedVehicle,
    make_backend,
)

#: Row fields that hold times; two equal comparisons differ in nothing else.
TIME_FIELDS: Final = ("force_call_ns", "deadline_misses")
REFERENCE_BACKEND: Final = "physics"
#: Distance from the path in m at which a drive is given up.
MAXIMUM_CROSS_TRACK: Final = 10.0
_TIMED_CALLS: Final = 400
_NOISE_SHARE: Final = 1e-6

DriverFactory = Callable[[], Driver]
Progress = Callable[[str], None]


@dataclass(frozen=True)
class Scenario:
    """A ground, a path, and the speed to start at.

    Parameters
    ----------
    name : str
        Of the scenario.
    terrain : str
        Of the ground, for the table.
    ground : Ground
        Under the vehicle.
    path : Path
        To drive along.
    vehicle : TrackedVehicle
        That drives.
    speed : float
        Initial speed in m/s.
    drivers : mapping of str to callable
        A fresh driver by controller name.
    backend_options : mapping of str to mapping
        Options of :func:`~grouser.terrain.make_backend` by backend name.
    time_limit : float
        Of a drive, in s.
    maximum_cross_track : float
        Distance from the path in m at which a drive is given up.
    """

    name: str
    terrain: str
    ground: Ground
    path: Path
    vehicle: TrackedVehicle
    speed: float
    drivers: Mapping[str, DriverFactory]
    backend_options: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    time_limit: float = 60.0
    maximum_cross_track: float = MAXIMUM_CROSS_TRACK


@dataclass(frozen=True)
class ComparisonRow:
    """One drive against the same drive on physics.

    Parameters
    ----------
    scenario, terrain, controller, backend : str
        What drove where.
    seed : int
        Of the initial offsets.
    finished : bool
        Whether the vehicle reached the path's end; not so where it lost the path, time ran out or the simulation
        diverged.
    cross_track_rmse_m : float
        Over all ticks.
    corridor_violation_m : float or None
        Largest distance of a corner of the footprint beyond its lane; None without a corridor.
    final_position_difference_m, final_heading_difference_rad : float
        From the drive on physics, at the instant at which the shorter of the two ended.
    force_r2 : list of float or None
        R² of Qx, Qy, Mz against physics at the drive's own logged inputs; None where the physics does not vary.
    first_move_difference_rms : float or None
        Root mean square over control instants of the difference of the belt commands from the drive on physics,
        over the training speed; the difference is the norm over both belts. None where there was no move.
    failed_solves : int
        Of a controller that solves.
    fallback_rate : float
        Share of ticks in which the fallback had a part in the force.
    switches : int
        Of the guard.
    force_call_ns : float or None
        Median time of one force call at logged inputs, from Python; None where nothing was logged.
    deadline_misses : int
        Control instants whose command took longer than the control period.
    """

    scenario: str
    terrain: str
    controller: str
    backend: str
    seed: int
    finished: bool
    cross_track_rmse_m: float
    corridor_violation_m: float | None
    final_position_difference_m: float
    final_heading_difference_rad: float
    force_r2: list[float | None]
    first_move_difference_rms: float | None
    failed_solves: int
    fallback_rate: float
    switches: int
    force_call_ns: float | None
    deadline_misses: int


@dataclass(frozen=True, eq=False)
class Drive:
    """One row with the log behind it."""

    row: ComparisonRow
    log: InterfaceLog


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


def path_driven_or_lost(path: Path, maximum_cross_track: float) -> Callable[[VehicleState], bool]:
    """Return what ends a drive: the path's end, or a distance from it in m at which it counts as lost."""
    near = 0.0

    def over(state: VehicleState) -> bool:
        nonlocal near
        foot = path.project(state.x, state.y, near=near)
        near = foot.arc_length
        return near >= path.length or abs(foot.cross_track) > maximum_cross_track

    return over


def start_state(scenario: Scenario, seed: int) -> VehicleState:
    """Return where a seed's drives start: rolling along the path, a little off it."""
    lateral, heading = np.random.default_rng(seed).uniform(-1.0, 1.0, size=2) * (0.1, 0.01)
    x, y = scenario.path.point_at(0.0)
    direction = scenario.path.heading_at(0.0)
    return VehicleState.rolling(
        scenario.speed,
        x=float(x - lateral * np.sin(direction)),
        y=float(y + lateral * np.cos(direction)),
        heading=float(direction + heading),
    )


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
        force_r2=[_r2(log.forces[:, i], truth[:, i], noise) for i, noise in enumerate(_noise(vehicle))],
        first_move_difference_rms=_rms(moves - their_moves, vehicle.training_speed),
        failed_solves=sum(not record.success for record in getattr(driver, "records", ())),
        fallback_rate=log.fallback_rate,
        switches=log.switches,
        force_call_ns=_force_call_ns(backend, log.inputs),
        deadline_misses=timed.misses,
    )
    return Drive(row, log)


def _noise(vehicle: TrackedVehicle) -> tuple[float, float, float]:
    """Return the spreads of Qx, Qy, Mz up to which they are round-off: a straight drive has no Qy to explain."""
    force = _NOISE_SHARE * vehicle.weight
    return force, force, force * vehicle.contact_length / 4


def _r2(forces: FloatArray, truth: FloatArray, noise: float) -> float | None:
    return output_metrics(forces, truth, noise=noise).r2 if len(truth) else None


def _rms(differences: FloatArray, scale: float) -> float | None:
    return float(np.sqrt(np.mean(np.sum(differences**2, axis=1))) / scale) if len(differences) else None


def corridor_violation(path: Path, vehicle: TrackedVehicle, log: InterfaceLog) -> float | None:
    """Return the largest distance in m of a corner of the footprint beyond its lane; None without a corridor."""
    if path.corridor is None:
        return None
    x, y, heading = (log.state(name) for name in ("x", "y", "heading"))
    return float(path.corridor.violations(x, y, heading, vehicle.contact_length, vehicle.overall_width).max())


def _force_call_ns(backend: ForceBackend, inputs: FloatArray) -> float | None:
    if not len(inputs):
        return None
    rows = inputs[:: max(1, len(inputs) // _TIMED_CALLS)]
    times = []
    for row in rows:
        began = perf_counter()
        backend.forces(row)
        times.append(perf_counter() - began)
    return float(np.median(times) * 1e9)
