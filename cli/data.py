"""``grouser data``: drive maneuvers on the physics and log what the force block saw."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import Annotated, Literal

import typer

from ..envs import Integrator
from ..terrain import Mode
from ._console import StageBars, print_facts
from ._options import Seed, Vehicle, Workers


def data(
    output: Annotated[Path, typer.Argument(metavar="FOLDER", help="Gets the dataset.")],
    mode: Annotated[Mode, typer.Option(help="Firm ground, with friction, or soil, with cohesion.")] = "rigid",
    vehicle: Vehicle = "m113",
    ranges: Annotated[
        Literal["wide", "paper"],
        typer.Option(help="Terrain that runs are drawn from; wide takes in ice and sand, paper does not."),
    ] = "wide",
    runs: Annotated[int, typer.Option(help="Runs; six maneuvers take turns. Training needs three of each.")] = 300,
    samples: Annotated[int, typer.Option(help="Logged ticks a run.")] = 3801,
    transient: Annotated[float, typer.Option(metavar="S", help="Discarded start of each run, in s.")] = 2.0,
    tick: Annotated[float, typer.Option(metavar="S", help="Time step of the simulation, in s.")] = 0.01,
    integrator: Annotated[Integrator, typer.Option(help="Of the simulation; euler chatters near rest.")] = "implicit",
    teacher: Annotated[
        str, typer.Option(metavar="NAME", help="Who gives the forces: physics, or exact, dearer and less smooth.")
    ] = "physics",
    seed: Seed = 0,
    workers: Workers = 2,
    engine: Annotated[
        Literal["joblib", "ray"], typer.Option(help="Who runs the workers: this machine, or a Ray cluster.")
    ] = "joblib",
) -> None:
    """Make a dataset: maneuvers on random ground, driven on a physics block and logged at it.

    Each run draws its ground and its maneuver from the seed and its own number, so that the same options give the
    same bits whatever the engine and the number of workers; the content hash that is printed names them. Interrupted, the same
    command goes on with the runs that are missing.
    """
    from ..surrogate.offline import DataConfig, generate_dataset

    config = DataConfig(
        mode=mode,
        vehicle=vehicle,
        ranges=ranges,
        runs=runs,
        samples_per_run=samples,
        transient=transient,
        tick=tick,
        integrator=integrator,
        teacher=teacher,
        seed=seed,
    )
    began = perf_counter()
    with StageBars() as tell:
        manifest = generate_dataset(
            config, output, workers=workers, engine=engine, progress=lambda done, total: tell("runs", done, total)
        )
    print_facts(
        {
            "dataset": output,
            "samples": f"{manifest.runs} runs of {manifest.samples_per_run}, {manifest.mode}, {manifest.ranges} ranges",
            "content hash": manifest.content_hash,
            "time": f"{perf_counter() - began:.1f} s",
        }
    )
