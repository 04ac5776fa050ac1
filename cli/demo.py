"""``grouser demo``: the whole thread once."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ._console import StageBars, out, print_facts
from ._options import Seed, Workers
from ._tables import drives_table, surrogates_table

if TYPE_CHECKING:
    from ..controllers.demonstration_config import DemoConfig


def demo(
    output: Annotated[Path, typer.Option(metavar="FOLDER", help="Where everything goes.")] = Path("build/demo"),
    workers: Workers = 2,
    seed: Seed = 0,
    quick: Annotated[
        bool, typer.Option("--quick", help="A minute's worth: tiny data, and surrogates that know little.")
    ] = False,
) -> None:
    """Do everything once: data, two surrogates, and every driver on every backend.

    MPC and the shipped policy drive an M113 through a double lane change on asphalt, on sand, and from asphalt onto
    ice, each on the physics, torch, native and guarded backends. The folder gets compare.json, a plot for every pair
    of drives, and report.html, one page that needs no other file. Called again with the same folder and options, it
    uses what is finished.
    """
    from ..controllers.demonstration import run_demonstration

    config = quick_config(seed) if quick else full_config(seed)
    with StageBars() as tell:
        made = run_demonstration(config, output, workers=workers, progress=tell)
    out.print(drives_table(made.compared["rows"]), surrogates_table(made.metrics))
    print_facts({"comparison": output / "compare.json", "report": output / "report.html"})


def full_config(seed: int) -> DemoConfig:
    """Return the sizes of the demonstration."""
    from ..controllers.demonstration_config import DemoConfig

    return DemoConfig(seed=seed)


def quick_config(seed: int) -> DemoConfig:
    """Return sizes that only show that everything runs."""
    config = full_config(seed)
    return replace(
        config,
        rigid_runs=24,
        soil_runs=24,
        samples_per_run=100,
        time_limit=20.0,
        training=replace(config.training, hidden=(32, 32), epochs=2, batch_size=256),
    )
