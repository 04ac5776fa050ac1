"""A dataset of interface logs on disk: one Parquet row group a run, a run table, and a hashed manifest."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ...terrain import (
    ArtifactError,
    FloatArray,
    Interface,
    TrackedVehicle,
    interface,
    write_json,
)
from .manifest import FORMAT_VERSION, Manifest, RunRecord, parse_manifest
from .parquet import import_parquet, read_parquet
from .run_file import Run, read_record, read_run, run_from_table, run_table

MANIFEST_NAME: Final = "dataset.json"
SAMPLES_NAME: Final = "samples.parquet"
RUNS_NAME: Final = "runs.parquet"


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


def write_dataset(folder: Path, manifest: Manifest, runs: Sequence[Path]) -> Manifest:
    """Assemble run files to a dataset; the manifest comes last, so that it marks a whole dataset.

    Returns
    -------
    Manifest
        With the content hash.

    Raises
    ------
    ArtifactError
        If a file is damaged, or holds another run or a run of another dataset.
    """
    import pyarrow

    parquet = import_parquet()
    digest_runs: list[RunRecord] = []

    def written() -> Iterator[Run]:
        aside = folder / (SAMPLES_NAME + ".part")
        writer = None
        try:
            for index, path in enumerate(runs):
                run = read_run(path, manifest.mode, manifest.recipe_hash)
                if run.record.run != index:
                    raise ArtifactError(
                        f"{path} holds run {run.record.run}, not run {index}; remove it and call the same command again"
                    )
                table = run_table(run).replace_schema_metadata(None)
                writer = writer or parquet.ParquetWriter(aside, table.schema)
                writer.write_table(table, row_group_size=max(1, table.num_rows))
                digest_runs.append(run.record)
                yield run
            if writer is not None:
                writer.close()
            os.replace(aside, folder / SAMPLES_NAME)
        finally:
            # Closing twice does nothing; a second failure would hide the first.
            with suppress(OSError):
                if writer is not None:
                    writer.close()
            aside.unlink(missing_ok=True)

    content_hash = hash_dataset(manifest, written())
    rows = [_flat(record) for record in digest_runs]
    aside = folder / (RUNS_NAME + ".part")
    try:
        parquet.write_table(pyarrow.Table.from_pylist(rows), aside)
        os.replace(aside, folder / RUNS_NAME)
    finally:
        aside.unlink(missing_ok=True)
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


def read_dataset(folder: Path) -> tuple[Dataset, str]:
    """Read a dataset as it is, without asking whether it is what the manifest promises.

    Returns
    -------
    dataset : Dataset
        What the files hold.
    content_hash : str
        Of what they hold; the manifest's own where nothing was altered.

    Raises
    ------
    ArtifactError
        If files are missing, unreadable, or do not fit together.
    """
    manifest = read_manifest(folder)
    parquet = import_parquet()
    rows = read_parquet(lambda: parquet.read_table(folder / RUNS_NAME).to_pylist(), folder / RUNS_NAME)
    records = [read_record(partial(_nested, row), RUNS_NAME) for row in rows]
    source = read_parquet(lambda: parquet.ParquetFile(folder / SAMPLES_NAME), folder / SAMPLES_NAME)
    if not records or source.num_row_groups != len(records):
        raise ArtifactError(
            f"{folder}: {manifest.runs} runs in the manifest, {len(records)} in {RUNS_NAME}, "
            f"{source.num_row_groups} row groups in {SAMPLES_NAME}"
        )
    groups = read_parquet(
        lambda: [source.read_row_group(i) for i in range(source.num_row_groups)], folder / SAMPLES_NAME
    )
    runs = [run_from_table(group, record, manifest.mode) for group, record in zip(groups, records, strict=True)]
    dataset = Dataset(
        manifest,
        tuple(records),
        np.concatenate([run.inputs for run in runs]),
        np.concatenate([run.forces for run in runs]),
        np.concatenate([np.full(len(run.inputs), run.record.run) for run in runs]),
    )
    return dataset, hash_dataset(manifest, runs)


def sample_columns(folder: Path) -> tuple[dict[str, str], list[set[int]]]:
    """Return the type of each column of the samples, and the values of the run column by row group.

    Raises
    ------
    ArtifactError
        If the file cannot be read.
    """
    path = folder / SAMPLES_NAME

    def read() -> tuple[dict[str, str], list[set[int]]]:
        source = import_parquet().ParquetFile(path)
        columns = {field.name: str(field.type) for field in source.schema_arrow}
        if "run" not in columns:
            return columns, [set() for _ in range(source.num_row_groups)]
        groups = [source.read_row_group(i, columns=["run"]) for i in range(source.num_row_groups)]
        return columns, [set(group.column("run").unique().to_pylist()) for group in groups]

    result: tuple[dict[str, str], list[set[int]]] = read_parquet(read, path)
    return result


def load_dataset(folder: Path) -> Dataset:
    """Load a dataset and check its content hash.

    Raises
    ------
    ArtifactError
        If files are missing, unreadable, or do not match the manifest.
    """
    dataset, found = read_dataset(folder)
    manifest = dataset.manifest
    if len(dataset.records) != manifest.runs:
        raise ArtifactError(f"{folder}: {manifest.runs} runs in the manifest, {len(dataset.records)} in {RUNS_NAME}")
    if found != manifest.content_hash:
        raise ArtifactError(
            f"{folder}: content hash {found[:12]} does not match {manifest.content_hash[:12]}: "
            "it was altered ('grouser verify' says where)"
        )
    return dataset


def _flat(record: RunRecord) -> dict[str, Any]:
    row = asdict(record)
    return row | {key: json.dumps(row[key], sort_keys=True) for key in ("terrain", "excitation")}


def _nested(row: dict[str, Any]) -> dict[str, Any]:
    return row | {key: json.loads(row[key]) for key in ("terrain", "excitation")}
