"""``grouser compare``: the same drivers on every backend."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import Annotated, Any

import typer

from ..envs import make_path
from ..terrain import InvalidInputError, TrackedVehicle, resolve_ground
from ._console import StageBars, out, print_facts
from ._drivers import driver_factory, fitting_artifact, one_torch_thread, takes_artifact
from ._options import PathOrFile, Speed, Vehicle, label_of, names_of
from ._tables import drives_table, surrogates_table


def compare(
    terrain: Annotated[
        str,
        typer.Option(metavar="NAME|FILE,...", help="Grounds, one scenario each; see grouser list terrains."),
    ] = "asphalt",
    path: PathOrFile = "iso-3888-1",
    controller: Annotated[
        str, typer.Option(metavar="NAME,...", help="Drivers: mpc, pure-pursuit, or policies, shipped or files.")
    ] = "mpc,pure-pursuit",
    backends: Annotated[
        str, typer.Option(metavar="NAME,...", help="Who gives the force. Physics is always driven, as the reference.")
    ] = "physics,torch,native,guarded",
    vehicle: Vehicle = "m113",
    speed: Speed = 5.0,
    seeds: Annotated[int, typer.Option(min=1, help="Paired starts, each a little off the path.")] = 1,
    time_limit: Annotated[float, typer.Option(metavar="S", help="Of a drive, in s.")] = 60.0,
    artifact: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE",
            help="Surrogate; give it twice, rigid and soil, for grounds of both modes.",
            show_default="the ones that are shipped",
        ),
    ] = None,
    output: Annotated[Path, typer.Option(metavar="FOLDER", help="Gets compare.json, plots and report.html.")] = Path(
        "build/compare"
    ),
) -> None:
    """Drive the same path with the same controllers on several backends, and see what the backend changes.

    Every backend starts from the same place. A row holds how well the drive kept the path, how far it went from the
    same drive on physics, how well the forces fit physics on the way, and what a force costs. The controllers are
    told the slip parameters of the ground, measured on physics.
    """
    from ..controllers import Scenario, document
    from ..controllers import compare as drive_all
    from ..controllers.report import write_report
    from ..terrain import write_json

    machine = TrackedVehicle.preset(vehicle)
    track = make_path(path, machine)
    wanted = names_of(backends, "--backends")
    began = perf_counter()
    scenarios, surrogates = [], {}
    typed = names_of(terrain, "--terrain")
    grounds = {label_of(name): resolve_ground(name) for name in typed}
    if len(grounds) < len(typed):
        raise InvalidInputError(f"two grounds of one name: {terrain}; rename a ground's file")
    for name, ground in grounds.items():
        surrogate = fitting_artifact(artifact or [], ground.mode)
        made = [driver_factory(who, track, machine, ground, speed) for who in names_of(controller, "--controller")]
        if len(dict(made)) < len(made):
            raise InvalidInputError(f"two controllers of one name: {controller}; rename a policy's file")
        chosen = {} if surrogate is None else {"artifact": surrogate}
        options = {backend: chosen for backend in wanted if takes_artifact(backend)}
        scenarios.append(Scenario(name, name, ground, track, machine, speed, dict(made), options, time_limit))
        if surrogate is not None:
            surrogates[f"{surrogate.vehicle.name} {surrogate.mode}"] = surrogate

    total = len(scenarios) * len(scenarios[0].drivers) * seeds * len({"physics", *wanted})
    driven = iter(range(total))
    with StageBars() as tell, one_torch_thread(wanted):
        drives = drive_all(
            scenarios, wanted, seeds=range(seeds), progress=lambda _: tell("drives", next(driven), total)
        )
        tell("drives", total, total)
    meta: dict[str, Any] = {
        "summary": f"{machine.name} at {speed:g} m/s along {track.name}; starts up to 0.1 m and 0.01 rad off the path.",
        "vehicle": machine.name,
        "path": track.name,
        "speed": speed,
        "artifacts": {name: surrogate.content_hash for name, surrogate in surrogates.items()},
        "times": {"seconds": perf_counter() - began},
    }
    compared = document(drives, meta)
    measured = {name: s.metrics["test"] for name, s in surrogates.items() if "test" in s.metrics}
    output.mkdir(parents=True, exist_ok=True)
    write_json(output / "compare.json", compared)
    write_report(output, compared, drives, scenarios, measured)
    out.print(drives_table(compared["rows"]))
    if measured:
        out.print(surrogates_table(measured))
    print_facts({"comparison": output / "compare.json", "report": output / "report.html"})
