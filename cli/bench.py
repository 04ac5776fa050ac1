"""``grouser bench``: how fast it is, against whom."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from ._console import StageBars, out, print_facts
from ._options import Vehicle
from ._tables import table


def bench(
    vehicle: Vehicle = "m113",
    output: Annotated[Path, typer.Option(metavar="FOLDER", help="Gets data, page and pictures.")] = Path("build/bench"),
    docs: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Also write bench.md, results/ and figures/ of a documentation."),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Half a minute: everything runs, and the figures mean little.")
    ] = False,
) -> None:
    """Time force calls and environments against our own physics, plain C and the libraries, on this machine.

    Rounds take turns and medians are reported, so that the ratios hold on a machine that is not quiet; the times do
    only on one that is. Everything runs on one thread, but where two are named. C compilers, torch, onnxruntime and
    casadi are used where they are there, and bench.json says what was missing. Leaves with 0 whether or not the
    targets are met: the table says which are.
    """
    from ..controllers.bench import BenchConfig, run_bench, write_bench, write_bench_docs
    from ..terrain import resolve_vehicle

    config = BenchConfig.quick() if quick else BenchConfig()
    with StageBars() as tell:
        made = run_bench(
            resolve_vehicle(vehicle), config, command=_command(vehicle, output, docs, quick), progress=tell
        )
    write_bench(output, made)
    if docs is not None:
        write_bench_docs(docs, made)
    _print_targets(made["targets"])
    met = [target["met"] for target in made["targets"] if target["met"] is not None]
    facts: dict[str, object] = {
        "targets": f"{sum(met)} of {len(met)} met",
        "data": output / "bench.json",
        "page": output / "bench.md",
    }
    print_facts(facts | {f"not measured, {name}": reason for name, reason in made["absent"].items()})


def _print_targets(targets: Sequence[Mapping[str, Any]]) -> None:
    from ..controllers.bench.page import figure

    listed = table("Targets", ["", "target", "reached", "at the bound", ""])
    before = ""
    for target in targets:
        if target["group"] != before:
            if before:
                listed.add_section()
            before = target["group"]
            listed.add_row(f"[bold]{before}[/bold]", "", "", "", "")
        met = {True: "met", False: "[red]missed[/red]", None: "not measured"}[target["met"]]
        unit = "" if target["unit"] == "x" else f" {target['unit']}"
        wanted = f"{'≥' if target['sense'] == 'at least' else '≤'} {figure(target['target'])}{unit}"
        listed.add_row(target["name"], wanted, figure(target["reached"]), figure(target["ceiling"]), met)
    out.print(listed)


def _command(vehicle: str, output: Path, docs: Path | None, quick: bool) -> str:
    """Return what was typed, without folders that lie outside of where it was typed."""
    named = [] if vehicle == "m113" else [f"--vehicle {vehicle}"]
    folders = [] if output.is_absolute() else [f"--output {output}"]
    folders += [] if docs is None or docs.is_absolute() else [f"--docs {docs}"]
    return " ".join(["grouser bench", *named, *folders, *(["--quick"] if quick else [])])
