"""One run of a dataset: as arrays, as a table, and as a Parquet file of one row group."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...terrain import OUTPUT_NAMES, ArtifactError, FloatArray, Mode, interface
from .manifest import RunRecord, parse_record
from .parquet import import_parquet, read_parquet


@dataclass(frozen=True, eq=False)
class Run:
    """One run's record with its samples: ``inputs`` (n, d) and ``forces`` (n, 3)."""

    record: RunRecord
    inputs: FloatArray
    forces: FloatArray


def write_run(path: Path, run: Run, recipe: str = "") -> None:
    """Write one run as a Parquet file of one row group, aside and renamed; ``recipe`` is its dataset's recipe hash."""
    parquet = import_parquet()
    aside = path.with_name(path.name + ".part")
    table = run_table(run)
    try:
        parquet.write_table(
            table.replace_schema_metadata({**table.schema.metadata, "recipe": recipe}),
            aside,
            row_group_size=max(1, len(run.inputs)),
        )
        os.replace(aside, path)
    finally:
        aside.unlink(missing_ok=True)


def read_run(path: Path, mode: Mode, recipe: str = "") -> Run:
    """Read a file of :func:`write_run`.

    Raises
    ------
    ArtifactError
        If it is not such a file, or both it and the caller name a recipe and they differ.
    """
    table = read_parquet(lambda: import_parquet().read_table(path), path)
    metadata = table.schema.metadata or {}
    if b"run" not in metadata:
        raise ArtifactError(f"{path} is not a run of a dataset: it has no run record")
    stated = metadata.get(b"recipe", b"").decode(errors="replace")
    if stated and recipe and stated != recipe:
        raise ArtifactError(
            f"{path} is a run of another dataset: its vehicle, mode, ranges or another part of its recipe differ; "
            "remove it and call the same command again"
        )
    return run_from_table(table, read_record(partial(json.loads, metadata[b"run"]), str(path)), mode)


def run_table(run: Run) -> Any:
    """Return a run as a pyarrow table, its record in the metadata."""
    import pyarrow

    names = (*interface("rigid" if "mu" in run.record.terrain else "soil").names, *OUTPUT_NAMES)
    values = np.concatenate([run.inputs, run.forces], axis=1)
    arrays = {"run": np.full(len(values), run.record.run, dtype=np.int32)}
    arrays |= {name: np.ascontiguousarray(values[:, i]) for i, name in enumerate(names)}
    metadata = {"run": json.dumps(asdict(run.record), sort_keys=True)}
    return pyarrow.table(arrays).replace_schema_metadata(metadata)


def run_from_table(table: Any, record: RunRecord, mode: Mode) -> Run:
    """Return the run that a pyarrow table holds.

    Raises
    ------
    ArtifactError
        If a column is missing, or holds what is no number.
    """
    names = interface(mode).names
    missing = [name for name in (*names, *OUTPUT_NAMES) if name not in table.column_names]
    if missing:
        raise ArtifactError(f"run {record.run} lacks the columns {', '.join(missing)}")

    def block(columns: Sequence[str]) -> FloatArray:
        return np.stack([np.asarray(table.column(name), dtype=np.float64) for name in columns], axis=1)

    try:
        return Run(record, block(names), block(OUTPUT_NAMES))
    except (TypeError, ValueError) as error:
        raise ArtifactError(f"run {record.run} holds samples that are not numbers: {error}") from error


def read_record(read: Callable[[], dict[str, Any]], source: str) -> RunRecord:
    """Return the run record that ``read`` gives as a mapping; errors name the source.

    Raises
    ------
    ArtifactError
        If it is none.
    """
    try:
        return parse_record(read())
    except (KeyError, TypeError, ValueError) as error:
        raise ArtifactError(f"{source} has a row that is not a run record: {error}") from error
