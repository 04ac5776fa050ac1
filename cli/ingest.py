"""``grouser ingest``: a dataset of drives that were logged."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from ._console import print_facts
from ._log_file import read_log


def ingest(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG.npz...", help="Files that grouser drive --log wrote.")],
    output: Annotated[Path, typer.Argument(metavar="FOLDER", help="Gets the dataset.")],
    ranges: Annotated[
        Literal["wide", "paper"], typer.Option(help="Terrain ranges, which every log's ground must lie in.")
    ] = "wide",
    teacher: Annotated[
        str, typer.Option(metavar="NAME", help="Who gives the forces: physics, or exact, dearer and less smooth.")
    ] = "physics",
) -> None:
    """Make a dataset of logged drives, to train on the states that a controller visits.

    Each log becomes a run, labelled *visited* and with its origin. Whoever drove, the forces are the teacher's for the
    inputs of the log, so that drives on a surrogate are welcome. The logs have one vehicle, mode and tick, and each
    was driven on level ground that is alike everywhere. `grouser train --also FOLDER` joins them to maneuvers.
    """
    from ..surrogate.offline import OriginLog, ingest_logs

    entries = [OriginLog(file.name, read_log(file)) for file in logs]
    manifest = ingest_logs(entries, output, ranges=ranges, teacher=teacher)
    rows = sum(len(entry.log) for entry in entries)
    print_facts(
        {
            "dataset": output,
            "samples": f"{manifest.runs} visited runs, {rows} rows, {manifest.mode}, {manifest.ranges} ranges",
            "content hash": manifest.content_hash,
        }
    )
