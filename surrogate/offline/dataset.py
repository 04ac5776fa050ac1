"""A dataset of interface logs on disk: one Parquet row group a run, a run table, and a hashed manifest."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ...terrain import (
    OUTPUT_NAMES,
    ArtifactError,
    FloatArray,
    Interface,
    Mode,
    TrackedVehicle,
    interface,
    missing_extra,
    write_json,
)
from .manifest import FORMAT_VERSION, Manifest, RunRecord, parse_manifest

MANIFEST_NAME: Final = "dataset.json"
SAMPLES_NAME: Final = "samples.parquet"
RUNS_NAME: Final = "runs.parquet"


@dataclass(frozen=True, eq=False)
class Run:
    """One run's record with its samples: ``inputs`` (n, d) and ``forces`` (n, 3)."""

    record: RunRecord
    inputs: FloatArray
    forces: FloatArray


@dataclass(frozen=True, eq=False)
class Dataset:
    """A loaded dataset.

    Parameters
    ----------
    manifest : Manifest
        What it is made of.
    records : tuple of RunRecord
        The run table.
    inputs : ndarray, shape (n, d)
        Every run's interface rows, in run order.
    forces : ndarray, shape (n, 3)
        The forces that were returned for them.
    run_index : ndarray of int, shape (n,)
        Run of each row.
    """

    manifest: Manifest
    records: tuple[RunRecord, ...]
    inputs: FloatArray
    forces: FloatArray
    run_index: NDArray[np.int64]

    @property
    def interface(self) -> Interface:
        """The interface that the inputs follow."""
        return interface(self.manifest.mode)

    @cached_property
    def vehicle(self) -> TrackedVehicle:
        """The vehicle that drove."""
        return TrackedVehicle.from_dict(dict(self.manifest.vehicle))

    def select(self, runs: Iterable[int]) -> Dataset:
        """Return the dataset reduced to some runs, in run order."""
        chosen = sorted(set(runs))
        mask = np.isin(self.run_index, chosen)
        records = tuple(record for record in self.records if record.run in set(chosen))
        return Dataset(self.manifest, records, self.inputs[mask], self.forces[mask], self.run_index[mask])


def hash_dataset(manifest: Manifest, runs: Iterable[Run]) -> str:
    """Return the SHA-256 over recipe, records and samples, in order: independent of file format and workers."""
    digest = hashlib.sha256(json.dumps(asdict(manifest) | {"content_hash": ""}, sort_keys=True).encode())
    for run in runs:
        digest.update(json.dumps(asdict(run.record), sort_keys=True).encode())
        digest.update(np.ascontiguousarray(run.inputs, dtype="<f8").tobytes())
        digest.update(np.ascontiguousarray(run.forces, dtype="<f8").tobytes())
    return digest.hexdigest()


def write_run(path: Path, run: Run) -> None:
    """Write one run as a Parquet file of one row group, aside and renamed."""
    parquet = _parquet()
    aside = path.with_name(path.name + ".part")
    parquet.write_table(_run_table(run), aside, row_group_size=max(1, len(run.inputs)))
    os.replace(aside, path)


def read_run(path: Path, mode: Mode) -> Run:
    """Read a file of :func:`write_run`.

    Raises
    ------
    ArtifactError
        If it is not such a file.
    """
    table = _read(lambda: _parquet().read_table(path), path)
    metadata = table.schema.metadata or {}
    if b"run" not in metadata:
        raise ArtifactError(f"{path} is not a run of a dataset: it has no run record")
    record = RunRecord(**json.loads(metadata[b"run"]))
    return _run_from_table(table, record, mode)


def write_dataset(folder: Path, manifest: Manifest, runs: Sequence[Path]) -> Manifest:
    """Assemble run files to a dataset; the manifest comes last, so that it marks a whole dataset.

    Returns
    -------
    Manifest
        With the content hash.
    """
    import pyarrow

    parquet = _parquet()
    digest_runs: list[RunRecord] = []

    def written() -> Iterator[Run]:
        aside = folder / (SAMPLES_NAME + ".part")
        writer = None
        try:
            for path in runs:
                run = read_run(path, manifest.mode)
                table = _run_table(run).replace_schema_metadata(None)
                writer = writer or parquet.ParquetWriter(aside, table.schema)
                writer.write_table(table, row_group_size=max(1, table.num_rows))
                digest_runs.append(run.record)
                yield run
        finally:
            if writer is not None:
                writer.close()
        os.replace(aside, folder / SAMPLES_NAME)

    content_hash = hash_dataset(manifest, written())
    rows = [_flat(record) for record in digest_runs]
    aside = folder / (RUNS_NAME + ".part")
    parquet.write_table(pyarrow.Table.from_pylist(rows), aside)
    os.replace(aside, folder / RUNS_NAME)
    complete = Manifest(**{**asdict(manifest), "content_hash": content_hash})
    write_json(folder / MANIFEST_NAME, asdict(complete))
    return complete


def read_manifest(folder: Path) -> Manifest:
    """Read a dataset's manifest.

    Raises
    ------
    ArtifactError
        If there is none, or it is not one.
    """
    path = folder / MANIFEST_NAME
    if not path.is_file():
        raise ArtifactError(f"{folder} is not a dataset: it has no {MANIFEST_NAME} (make one: grouser data)")
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content.get("format_version") != FORMAT_VERSION:
            raise ArtifactError(
                f"{path} has format {content.get('format_version')!r}, this version reads {FORMAT_VERSION}"
            )
        return parse_manifest(content)
    except (ValueError, TypeError, AttributeError) as error:
        if isinstance(error, ArtifactError):
            raise
        raise ArtifactError(f"{path} is not a dataset manifest: {error}") from error


def load_dataset(folder: Path) -> Dataset:
    """Load a dataset and check its content hash.

    Raises
    ------
    ArtifactError
        If files are missing, unreadable, or do not match the manifest.
    """
    manifest = read_manifest(folder)
    parquet = _parquet()
    table = _read(lambda: parquet.read_table(folder / RUNS_NAME), folder / RUNS_NAME)
    records = [_record(row) for row in table.to_pylist()]
    source = _read(lambda: parquet.ParquetFile(folder / SAMPLES_NAME), folder / SAMPLES_NAME)
    if source.num_row_groups != len(records) or len(records) != manifest.runs:
        raise ArtifactError(
            f"{folder}: {manifest.runs} runs in the manifest, {len(records)} in {RUNS_NAME}, "
            f"{source.num_row_groups} row groups in {SAMPLES_NAME}"
        )
    groups = _read(lambda: [source.read_row_group(i) for i in range(source.num_row_groups)], folder / SAMPLES_NAME)
    runs = [_run_from_table(group, record, manifest.mode) for group, record in zip(groups, records, strict=True)]
    found = hash_dataset(manifest, runs)
    if found != manifest.content_hash:
        raise ArtifactError(f"{folder}: content hash {found[:12]} does not match {manifest.content_hash[:12]}")
    return Dataset(
        manifest,
        tuple(records),
        np.concatenate([run.inputs for run in runs]),
        np.concatenate([run.forces for run in runs]),
        np.concatenate([np.full(len(run.inputs), run.record.run) for run in runs]),
    )


def _run_table(run: Run) -> Any:
    import pyarrow

    names = (*interface("rigid" if "mu" in run.record.terrain else "soil").names, *OUTPUT_NAMES)
    values = np.concatenate([run.inputs, run.forces], axis=1)
    arrays = {"run": np.full(len(values), run.record.run, dtype=np.int32)}
    arrays |= {name: np.ascontiguousarray(values[:, i]) for i, name in enumerate(names)}
    metadata = {"run": json.dumps(asdict(run.record), sort_keys=True)}
    return pyarrow.table(arrays).replace_schema_metadata(metadata)


def _run_from_table(table: Any, record: RunRecord, mode: Mode) -> Run:
    names = interface(mode).names
    missing = [name for name in (*names, *OUTPUT_NAMES) if name not in table.column_names]
    if missing:
        raise ArtifactError(f"run {record.run} lacks the columns {', '.join(missing)}")

    def block(columns: Sequence[str]) -> FloatArray:
        return np.stack([np.asarray(table.column(name), dtype=np.float64) for name in columns], axis=1)

    return Run(record, block(names), block(OUTPUT_NAMES))


def _flat(record: RunRecord) -> dict[str, Any]:
    row = asdict(record)
    return row | {key: json.dumps(row[key], sort_keys=True) for key in ("terrain", "excitation")}


def _record(row: dict[str, Any]) -> RunRecord:
    try:
        return RunRecord(**row | {key: json.loads(row[key]) for key in ("terrain", "excitation")})
    except (KeyError, TypeError, ValueError) as error:
        raise ArtifactError(f"{RUNS_NAME} has a row that is not a run record: {error}") from error


def _read(read: Any, path: Path) -> Any:
    try:
        return read()
    except (OSError, ValueError) as error:
        raise ArtifactError(f"{path} is missing or not a whole Parquet file: {error}") from error


def _parquet() -> Any:
    try:
        import pyarrow.parquet
    except ImportError as error:
        raise missing_extra("pyarrow", "torch") from error
    return pyarrow.parquet
