"""``grouser validate``: the block against what is known."""

from __future__ import annotations

import os
import platform
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ._console import StageBars, out, print_facts
from ._options import Vehicle
from ._tables import table

if TYPE_CHECKING:
    from ..terrain.validation import Check


def validate(
    vehicle: Vehicle = "m113",
    output: Annotated[Path, typer.Option(metavar="FOLDER", help="Gets table, figures and data.")] = Path(
        "build/validation"
    ),
    quick: Annotated[bool, typer.Option("--quick", help="Fewer states, coarser studies: a few seconds.")] = False,
) -> None:
    """Check the block against closed forms, identities and published figures, and plot what it says of the vehicle.

    Compiled block and NumPy oracle are checked on both shear paths. The folder gets validation.json, index.md and a
    figure for every study. Leaves with 1 if a check is not within its tolerance.
    """
    from ..terrain import resolve_vehicle
    from ..terrain.validation import validate as run_validation
    from ..terrain.validation import write_validation

    chosen = resolve_vehicle(vehicle)
    meta = {"command": _command(vehicle, output, quick), "grouser": version("grouser"), "machine": _machine()}
    with StageBars() as tell:
        made = run_validation(chosen, quick=quick, progress=tell)
        write_validation(output, made, meta, progress=tell)
    _print_checks(made.checks)
    print_facts(
        {
            "checks": f"{len(made.checks) - len(made.failed)} of {len(made.checks)} within tolerance",
            "report": output / "index.md",
            "data": output / "validation.json",
        }
    )
    if made.failed:
        raise typer.Exit(1)


def _print_checks(checks: tuple[Check, ...]) -> None:
    from ..terrain.validation import format_difference, format_value

    headings = ["", "check", "block", "quantity", "expected", "measured", "difference", "tolerance", "passed"]
    listed = table("Checks", headings, text_columns=4)
    before = checks[0].number
    for check in checks:
        if check.number != before:
            listed.add_section()
        before = check.number
        unit = "" if check.unit == "1" else f", {check.unit}"
        listed.add_row(
            str(check.number),
            check.name,
            check.block,
            f"{check.quantity}{unit}",
            format_value(check.expected),
            format_value(check.measured),
            *format_difference(check),
            "yes" if check.passed else "[red]no[/red]",
        )
    out.print(listed)


def _command(vehicle: str, output: Path, quick: bool) -> str:
    named = [] if vehicle == "m113" else [f"--vehicle {vehicle}"]
    return " ".join(["grouser validate", *named, f"--output {output}", *(["--quick"] if quick else [])])


def _machine() -> str:
    from ..native import cpu_level

    return f"{platform.system()} {platform.machine()}, {os.cpu_count()} CPUs, kernels at {cpu_level()}"
