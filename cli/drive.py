"""``grouser drive``: one drive, to look at."""

from __future__ import annotations

import math
from pathlib import Path as FilePath
from typing import Annotated, Any

import numpy as np
import typer

from ..envs import Driver, GroundSampling, InterfaceLog, Path, Simulator, VehicleState, make_path, rollout
from ..terrain import Ground, SimulationDivergedError, SlopedGround, TrackedVehicle, make_backend, resolve_ground
from ._console import print_facts
from ._drivers import artifact_options, driver_factory, one_torch_thread
from ._log_file import write_log
from ._options import Artifact, Backend, PathOrFile, Speed, Terrain, Vehicle, label_of
from ._replay import check_target, replay

_CONTROL_PERIOD = 0.1


def drive(
    terrain: Terrain = "asphalt",
    path: PathOrFile = "iso-3888-1",
    controller: Annotated[
        str, typer.Option(metavar="NAME|FILE", help="Driver: mpc, pure-pursuit, or a policy, shipped or a file.")
    ] = "mpc",
    backend: Backend = "native",
    vehicle: Vehicle = "m113",
    speed: Speed = 5.0,
    artifact: Artifact = None,
    grade: Annotated[float, typer.Option(metavar="DEG", help="Slope along x in degrees, uphill positive.")] = 0.0,
    bank: Annotated[float, typer.Option(metavar="DEG", help="Slope along y in degrees, uphill positive.")] = 0.0,
    ground_sampling: Annotated[
        GroundSampling, typer.Option(help="Where the ground is taken: under the CG, or under each track.")
    ] = "vehicle",
    time_limit: Annotated[float, typer.Option(metavar="S", help="When to stop, in s.")] = 60.0,
    render: Annotated[
        str, typer.Option(metavar="human|FILE", help="human: a window; FILE.png: the last frame; FILE.gif: all.")
    ] = "",
    log: Annotated[
        FilePath | None,
        typer.Option(metavar="FILE.npz", help="Gets inputs, forces, states and commands of every tick."),
    ] = None,
) -> None:
    """Drive once along a path, from its start, and say how it went.

    The summary holds time, distance from the path, what the guard did where there is one, and the solver's statistics
    where the controller solves. --render shows the drive from above once it is over; --log keeps it for NumPy.
    """
    from ..controllers.scenario import MAXIMUM_CROSS_TRACK, path_driven_or_lost

    check_target(render)
    machine = TrackedVehicle.preset(vehicle)
    ground: Ground = resolve_ground(terrain)
    if grade or bank:
        ground = SlopedGround(ground, math.radians(grade), math.radians(bank))
    track = make_path(path, machine)
    options = artifact_options(backend, [artifact] if artifact else [], ground.mode)
    built = make_backend(backend, mode=ground.mode, vehicle=machine, **options)
    _, make_driver = driver_factory(controller, track, machine, ground, speed)
    driver = make_driver()
    x, y = track.point_at(0.0)
    start = VehicleState.rolling(speed, x=float(x), y=float(y), heading=float(track.heading_at(0.0)))
    simulator = Simulator(machine, built, ground, ground_sampling=ground_sampling, state=start)
    diverged = None
    with one_torch_thread([backend]):
        try:
            over = path_driven_or_lost(track, MAXIMUM_CROSS_TRACK)
            driven = rollout(simulator, driver, time_limit, control_period=_CONTROL_PERIOD, until=over)
        except SimulationDivergedError as error:
            if not isinstance(error.log, InterfaceLog) or not len(error.log):
                raise
            driven, diverged = error.log, error
    print_facts(_summary(driven, track, machine, driver))
    if log is not None:
        write_log(log, driven)
    if render:
        replay(driven, track, machine, f"{label_of(terrain)}, {backend}", render, _CONTROL_PERIOD)
    if diverged is not None:
        raise diverged


def _summary(log: InterfaceLog, path: Path, vehicle: TrackedVehicle, driver: Driver) -> dict[str, str]:
    from ..controllers.drive_measures import corridor_violation
    from ..controllers.scenario import MAXIMUM_CROSS_TRACK

    arc_length, cross_track = path.follow(log.states[:, :2])
    lost = ", then lost" if abs(cross_track[-1]) > MAXIMUM_CROSS_TRACK else ""
    share = min(1.0, max(0.0, float(arc_length[-1]) / path.length))
    facts = {
        "driven": f"{log.state('time')[-1]:.2f} s, {100 * share:.0f} % of {path.name} ({path.length:.1f} m){lost}",
        "cross-track": f"RMSE {math.sqrt(float(np.mean(cross_track**2))):.3f} m, max {abs(cross_track).max():.3f} m",
    }
    beyond = corridor_violation(path, vehicle, log)
    if beyond is not None:
        facts["out of lane"] = f"{beyond:.3f} m at most"
    if np.isfinite(log.ood_score).any():
        facts["guard"] = f"fallback in {100 * log.fallback_rate:.1f} % of ticks, {log.switches} switches"
    records: Any = getattr(driver, "records", ())
    if records:
        times = 1000 * np.array([record.solve_time for record in records])
        failed = sum(not record.success for record in records)
        median, p95 = np.percentile(times, (50, 95))
        facts["solves"] = (
            f"{len(records)}, {failed} failed; median {median:.2f} ms, P95 {p95:.2f} ms, max {times.max():.2f} ms"
        )
    return facts
