"""Whether a dataset is what its manifest says: files, physical bounds, recipe, teacher, memory, split."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...terrain import (
    NUMPY,
    OUTPUT_NAMES,
    ArtifactError,
    FloatArray,
    ForceBackend,
    GrouserError,
    Mode,
    ParameterRanges,
    TrackedVehicle,
    parameter_ranges,
)
from ...terrain.block import shear_strength
from ..normalizer import Normalizer
from .dataset import Dataset, read_dataset, sample_columns
from .finding import Finding, attempted, counted, refused
from .generate import draw_run
from .ingest import VISITED
from .perturbation import teacher_of
from .split_verification import identical_runs, verify_balance, verify_default_split

#: Relative bound of what must agree to rounding.
ROUNDING: Final = 1e-12
#: Relative bound of physical limits, above the rounding of sums.
_SLACK: Final = 1e-9
# A float32 teacher answers a batch and a single row differently by a few units in the last place.
_RESOLUTIONS: Final = 16.0


def verify_dataset(folder: Path) -> list[Finding]:
    """Return the findings on a dataset's folder; what cannot be read at all is a single failed one.

    Raises
    ------
    ConfigurationError
        If pyarrow is not installed.
    """
    try:
        dataset, content_hash = read_dataset(folder)
        columns = _columns(folder, dataset)
        vehicle, ranges = dataset.vehicle, parameter_ranges(dataset.manifest.ranges, dataset.manifest.mode)
    except GrouserError as error:
        return [refused("readable", "files", error)]
    promised = dataset.manifest.content_hash
    altered = [] if content_hash == promised else [f"{content_hash[:12]}, the manifest says {promised[:12]}"]
    finite, whole = _finite(dataset)
    return [
        Finding("readable", "files", 0.0, 0.0, "1", f"{len(dataset.records)} runs, {len(dataset.inputs)} rows"),
        columns,
        counted("content hash", "dataset.json", altered, "hashes"),
        finite,
        *_recipe(dataset, vehicle),
        *_bounds(whole, vehicle, ranges),
        *_agreement(whole),
        _memory(dataset, vehicle),
        identical_runs(dataset),
        *verify_balance(dataset),
        *verify_default_split(dataset),
    ]


def _columns(folder: Path, dataset: Dataset) -> Finding:
    expected = {"run": "int32"} | dict.fromkeys((*dataset.interface.names, *OUTPUT_NAMES), "double")
    found, group_runs = sample_columns(folder)
    bad = [f"{name} is {found.get(name, 'missing')}" for name in expected if found.get(name) != expected[name]]
    bad += [f"{name} is one too many" for name in found if name not in expected]
    for record, runs in zip(dataset.records, group_runs, strict=True):
        if runs != {record.run}:
            bad.append(f"run in the rows of run {record.run}")
    return counted("columns and types", "samples.parquet", bad, "columns")


def _finite(dataset: Dataset) -> tuple[Finding, Dataset]:
    """Return whether all values are finite, and the dataset reduced to rows that are."""
    values = np.isfinite(np.concatenate([dataset.inputs, dataset.forces], axis=1))
    names = (*dataset.interface.names, *OUTPUT_NAMES)
    rows, columns = np.nonzero(~values)
    bad = [f"{names[column]} in row {row}" for row, column in zip(rows.tolist(), columns.tolist(), strict=True)]
    kept = values.all(axis=1)
    reduced = Dataset(
        dataset.manifest, dataset.records, dataset.inputs[kept], dataset.forces[kept], dataset.run_index[kept]
    )
    return counted("finite values", "samples", bad, "values"), reduced


def _recipe(dataset: Dataset, vehicle: TrackedVehicle) -> list[Finding]:
    """Return whether runs, samples, maneuvers and draws are those that the manifest's recipe gives.

    Visited runs are as long as their drives and drawn from nothing.
    """
    manifest, records = dataset.manifest, dataset.records
    runs = [record.run for record in records]
    numbers = [run for index, run in enumerate(runs) if run != index]
    drawn = [record for record in records if record.maneuver != VISITED]
    lengths = [record.run for record in records if np.sum(dataset.run_index == record.run) != record.samples]
    lengths += [record.run for record in drawn if record.samples != manifest.samples_per_run]
    maneuvers, draws = [], []
    for record in drawn:
        terrain, maneuver = draw_run(manifest, vehicle, record.run)
        theta = dict(zip(dataset.interface.parameter_names, terrain.parameters.tolist(), strict=True))
        if record.maneuver != maneuver.name:
            maneuvers.append(f"run {record.run} is {record.maneuver}, drawn {maneuver.name}")
        elif (record.terrain, record.excitation) != (theta, maneuver.excitation):
            draws.append(record.run)
    return [
        Finding("runs of the manifest", "run table", abs(len(runs) - manifest.runs), 0.0, "runs"),
        counted("runs numbered in order", "run table", numbers, "runs"),
        counted("samples a run", "samples", sorted(set(lengths)), "runs"),
        counted("maneuver of the run", "run table", maneuvers, "runs"),
        counted("terrain and excitation drawn from the seed", "run table", draws, "runs"),
    ]


def _bounds(dataset: Dataset, vehicle: TrackedVehicle, ranges: ParameterRanges) -> list[Finding]:
    """Return whether belts, terrain and forces are within what vehicle, ranges and ground allow."""
    table, names = dataset.interface, dataset.interface.parameter_names
    theta = dataset.inputs[:, [table.index(name) for name in names]]
    belts = np.abs(dataset.inputs[:, [table.index(name) for name in ("v_left", "v_right")]])
    # Maneuvers keep to the training speed; who drove a visited run had the whole of the drive.
    fastest = vehicle.maximum_speed if _visited(dataset) else vehicle.training_speed
    recorded = {record.run: [record.terrain.get(name, np.nan) for name in names] for record in dataset.records}
    runs, of_row = np.unique(dataset.run_index, return_inverse=True)
    expected = np.array([recorded[run] for run in runs.tolist()]).reshape(-1, len(names))[of_row]
    outside = np.any((theta < ranges.low) | (theta > ranges.high), axis=1)
    differing = np.any(theta != expected, axis=1)
    force, moment = _force_shares(dataset, vehicle, theta)
    return [
        Finding("belt speed", "v_left, v_right", _largest(belts), fastest * (1 + _SLACK), "m/s"),
        counted("terrain within the declared ranges", ", ".join(names), _runs(dataset, outside), "runs"),
        counted("terrain constant and as recorded", ", ".join(names), _runs(dataset, differing), "runs"),
        Finding("force over what the ground can give", "qx, qy", _largest(force), 1 + _SLACK, "1"),
        Finding("moment over what the ground can give", "mz", _largest(moment), 1 + _SLACK, "1"),
    ]


def _force_shares(dataset: Dataset, vehicle: TrackedVehicle, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return |Q| and |Mz| over their bounds: shear strength under full contact and rolling resistance, times lever."""
    available = available_force(vehicle, dataset.manifest.mode, theta)
    lever = np.hypot(
        vehicle.contact_length / 2 + abs(vehicle.contact_center), (vehicle.tread + vehicle.track_width) / 2
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        force = np.hypot(dataset.forces[:, 0], dataset.forces[:, 1]) / available
        moment = np.abs(dataset.forces[:, 2]) / (available * lever)
    return force, moment


def available_force(vehicle: TrackedVehicle, mode: Mode, theta: FloatArray) -> FloatArray:
    """Return the force in N that no state can exceed, shape (n,), for terrain parameters of shape (n, p).

    Strength grows with the load and no more than linearly, and the loads add up to the weight: an even load is the
    most that the ground bears.
    """
    elements = 2 * vehicle.road_wheels
    area = elements * vehicle.element_length * vehicle.track_width
    strength = shear_strength(NUMPY, vehicle, mode, list(theta.T), np.full(len(theta), vehicle.weight / elements))
    available: FloatArray = strength * area + theta[:, -2] * vehicle.weight
    return available


def _agreement(dataset: Dataset) -> list[Finding]:
    """Return whether teacher and normalization give back what was logged, to rounding."""

    def recomputed(teacher: ForceBackend) -> float:
        return _largest(np.abs(teacher.forces(dataset.inputs) - dataset.forces) / _scale(dataset.forces))

    def round_trip(values: FloatArray) -> float:
        # A spread that overflows is refused by the normalizer.
        with np.errstate(over="ignore", invalid="ignore"):
            normalizer = Normalizer.fit(values)
        error = normalizer.denormalize(normalizer.normalize(values)) - values
        return _largest(np.abs(error) / normalizer.scale)

    forces_check = "forces are the teacher's", ", ".join(OUTPUT_NAMES)
    try:
        teacher = teacher_of(dataset)
    except (GrouserError, KeyError, TypeError) as error:
        cause = ArtifactError(f"the manifest's backend cannot be built: {error}")
        forces = refused(*forces_check, cause)
    else:
        limit = max(ROUNDING, _RESOLUTIONS * teacher.resolution)
        forces = attempted(*forces_check, limit, "of the largest", lambda: recomputed(teacher))
    return [
        forces,
        attempted("normalization round trip", "inputs", ROUNDING, "σ", lambda: round_trip(dataset.inputs)),
        attempted("normalization round trip", "forces", ROUNDING, "σ", lambda: round_trip(dataset.forces)),
    ]


def _memory(dataset: Dataset, vehicle: TrackedVehicle) -> Finding:
    """Return whether accelerations are the forces of the row before over the mass, in every run that the teacher drove."""
    table = dataset.interface
    logged = dataset.inputs[1:, [table.index("ax"), table.index("ay")]]
    expected = dataset.forces[:-1, :2] / vehicle.mass
    scale = _scale(expected[np.isfinite(expected).all(axis=1)])
    with np.errstate(invalid="ignore"):
        error = np.max(np.abs(logged - expected) / scale, axis=1, initial=0.0)
    # What is not finite is told elsewhere.
    judged = (dataset.run_index[1:] == dataset.run_index[:-1]) & np.isfinite(error)
    judged &= ~np.isin(dataset.run_index[1:], _visited(dataset))
    wrong = _runs(dataset, np.concatenate([[False], judged & (error > ROUNDING)]))
    detail = f"runs {', '.join(map(str, wrong[:4]))}" if wrong else ""
    return Finding(
        "acceleration is the force before over the mass",
        "ax, ay",
        _largest(error[judged]),
        ROUNDING,
        "of the largest",
        detail,
    )


def _visited(dataset: Dataset) -> list[int]:
    return [record.run for record in dataset.records if record.maneuver == VISITED]


def _runs(dataset: Dataset, rows: NDArray[np.bool_]) -> list[int]:
    return sorted(set(dataset.run_index[rows].tolist()))


def _scale(values: FloatArray) -> FloatArray:
    """Return the largest magnitude of each column; 1 where it is 0."""
    largest: FloatArray = np.max(np.abs(values), axis=0, initial=0.0)
    return np.where(largest > 0, largest, 1.0)


def _largest(values: FloatArray) -> float:
    return float(np.max(values, initial=0.0))
