"""A dataset of drives that somebody else drove: states that controllers visit, with the teacher's forces for them."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from ...envs.log import InterfaceLog
from ...terrain import (
    GRAVITY,
    MOTION_SIZE,
    ArtifactError,
    ConfigurationError,
    ForceBackend,
    GrouserError,
    InvalidInputError,
    ParameterRanges,
    TrackedVehicle,
    make_backend,
    parameter_ranges,
    terrain_type,
)
from .dataset import MANIFEST_NAME, write_dataset
from .manifest import Manifest, RunRecord
from .run_file import Run, write_run

#: Maneuver of every ingested run.
VISITED: Final = "visited"
_PARTS_NAME: Final = "visited-parts"


@dataclass(frozen=True, eq=False)
class OriginLog:
    """A log and where it comes from.

    Parameters
    ----------
    origin : str
        In words, such as the file's name.
    log : InterfaceLog
        One drive.
    """

    origin: str
    log: InterfaceLog


def ingest_logs(logs: Sequence[OriginLog], folder: Path, *, ranges: str = "wide", teacher: str = "physics") -> Manifest:
    """Make a dataset of drives, each a run with the maneuver ``"visited"``.

    The inputs are those that the drive visited; the forces are the teacher's for them, whoever drove. A drive on a
    surrogate is welcome: its ax and ay are the surrogate's forces over the mass, where a network shows what it makes
    of itself. The excitation of a run names its origin, the backend that drove and, if it has one, its artifact.

    Parameters
    ----------
    logs : sequence of OriginLog
        Drives of one vehicle and mode with one tick and integrator, each on level ground that is alike everywhere.
    folder : Path
        Gets the dataset; it must not hold one.
    ranges : {"wide", "paper"}
        Terrain ranges, which every ground lies in.
    teacher : str
        Backend that is asked for the forces.

    Returns
    -------
    Manifest
        With the longest run as ``samples_per_run``, no transient, and seed 0.

    Raises
    ------
    InvalidInputError
        If there is no log, a log is empty or comes twice, or its ground slopes, changes, or differs between tracks.
    ConfigurationError
        If the logs differ in vehicle, mode, tick or integrator, a ground lies outside the ranges, or the folder holds
        a dataset.
    ArtifactError
        If a log does not say what it was driven with.
    """
    if not logs:
        raise InvalidInputError("there are no logs to ingest")
    if (folder / MANIFEST_NAME).exists():
        raise ConfigurationError(f"{folder} holds a dataset; choose a new folder or remove it")
    manifest, backend = _recipe(logs, ranges, teacher)
    box = parameter_ranges(ranges, manifest.mode)
    _check_different(logs)
    parts = folder / _PARTS_NAME
    shutil.rmtree(parts, ignore_errors=True)
    runs = [_visited_run(index, entry, box, backend) for index, entry in enumerate(logs)]
    parts.mkdir(parents=True)
    try:
        complete = write_dataset(folder, manifest, list(_written(runs, parts, manifest.recipe_hash)))
    finally:
        shutil.rmtree(parts)
    return complete


def _written(runs: Sequence[Run], parts: Path, recipe: str) -> Iterator[Path]:
    for run in runs:
        path = parts / f"run-{run.record.run:06d}.parquet"
        write_run(path, run, recipe)
        yield path


def _recipe(logs: Sequence[OriginLog], ranges: str, teacher: str) -> tuple[Manifest, ForceBackend]:
    first = logs[0]
    vehicle, tick, integrator = _driven_with(first)
    for entry in logs[1:]:
        if entry.log.mode != first.log.mode or _driven_with(entry) != (vehicle, tick, integrator):
            raise ConfigurationError(
                f"{entry.origin} and {first.origin} differ in vehicle, mode, tick or integrator: make a dataset of each"
            )
    backend = make_backend(teacher, mode=first.log.mode, vehicle=vehicle)
    manifest = Manifest(
        mode=backend.mode,
        vehicle=vehicle.to_dict(),
        ranges=ranges,
        backend=backend.describe(),
        integrator=integrator,
        tick=tick,
        transient=0.0,
        samples_per_run=max(1, *(len(entry.log) for entry in logs)),
        runs=len(logs),
        seed=0,
    )
    return manifest, backend


def _driven_with(entry: OriginLog) -> tuple[TrackedVehicle, float, str]:
    meta = entry.log.meta
    try:
        return TrackedVehicle.from_dict(dict(meta["vehicle"])), float(meta["tick"]), str(meta["integrator"])
    except (KeyError, TypeError, ValueError, GrouserError) as error:
        raise ArtifactError(f"{entry.origin} does not name its vehicle, tick and integrator: {error}") from error


def _check_different(logs: Sequence[OriginLog]) -> None:
    """Refuse a drive that comes twice: its copies would fall on two sides of a split."""
    seen: dict[str, str] = {}
    for entry in logs:
        digest = hashlib.sha256(np.ascontiguousarray(entry.log.inputs).tobytes()).hexdigest()
        if digest in seen:
            raise InvalidInputError(f"{entry.origin} and {seen[digest]} hold the same drive")
        seen[digest] = entry.origin


def _visited_run(index: int, entry: OriginLog, ranges: ParameterRanges, teacher: ForceBackend) -> Run:
    log, origin = entry.log, entry.origin
    if not len(log):
        raise InvalidInputError(f"{origin} is empty")
    try:
        inputs = teacher.interface.check(log.inputs)
    except InvalidInputError as error:
        raise InvalidInputError(f"{origin}: {error}") from error
    theta = inputs[:, MOTION_SIZE:]
    if not np.array_equal(log.gravity, np.tile((0.0, 0.0, GRAVITY), (len(log), 1))):
        raise InvalidInputError(f"{origin} was driven on a slope: a dataset's rows are those of level ground")
    if not np.array_equal(log.right_theta, theta):
        raise InvalidInputError(f"{origin} has another ground under each track: a dataset's rows have one")
    if not np.array_equal(theta, np.tile(theta[0], (len(theta), 1))):
        raise InvalidInputError(f"{origin} was driven over changing ground: a run of a dataset has one")
    terrain = terrain_type(teacher.mode)(*theta[0].tolist())
    if not ranges.contains(terrain):
        raise ConfigurationError(f"{origin} was driven on {terrain}, outside of the ranges")
    record = RunRecord(
        run=index,
        maneuver=VISITED,
        terrain=dict(zip(teacher.interface.parameter_names, theta[0].tolist(), strict=True)),
        excitation={"origin": origin, **_driver_backend(log.meta.get("backend"))},
        samples=len(log),
        divided_ticks=int(np.sum(log.divisions > 1)),
    )
    return Run(record, inputs, teacher.forces(inputs))


def _driver_backend(description: object) -> dict[str, str]:
    named = description if isinstance(description, Mapping) else {}
    return {key: named[key] for key in ("backend", "artifact") if isinstance(named.get(key), str)}
