"""What a network is trained on: logged rows, rows beside them and far from them, images, whitened coordinates."""

from __future__ import annotations

from typing import Final

import numpy as np

from ...terrain import FloatArray, mirror_forces, parameter_ranges, reverse_forces
from .dataset import Dataset
from .perturbation import perturbed_rows, teacher_of
from .space_filling import space_filling_rows
from .training_config import TrainingConfig

# Below this share of a column's variance a direction is rounding, not data.
_FLAT_VARIANCE: Final = 1e-8


def training_rows(train: Dataset, config: TrainingConfig) -> tuple[FloatArray, FloatArray]:
    """Return training runs' rows and forces, joined by what the recipe adds to them."""
    generator = np.random.default_rng((config.seed, len(train.inputs)))
    parts = [(train.inputs, train.forces), perturbed_rows(train, config.perturbed_copies, generator)]
    if config.space_filling_rows:
        mode, vehicle, count = train.manifest.mode, train.vehicle, config.space_filling_rows
        ranges = parameter_ranges(train.manifest.ranges, mode)
        parts.append(space_filling_rows(vehicle, mode, ranges, count, teacher_of(train), config.seed))
    inputs, forces = (np.concatenate(part) for part in zip(*parts, strict=True))
    mirror = config.family == "plain"
    return with_symmetries(train, inputs, forces, mirror=mirror) if config.symmetries else (inputs, forces)


def with_symmetries(
    dataset: Dataset, inputs: FloatArray, forces: FloatArray, *, mirror: bool = True
) -> tuple[FloatArray, FloatArray]:
    """Return rows and forces joined by their mirror images and, with a centred CG, their fore-aft reversals."""
    table = dataset.interface
    if mirror:
        inputs, forces = np.concatenate([inputs, table.mirror(inputs)]), np.concatenate([forces, mirror_forces(forces)])
    if dataset.vehicle.cg_offset == 0:
        inputs, forces = (
            np.concatenate([inputs, table.reverse(inputs)]),
            np.concatenate([forces, reverse_forces(forces)]),
        )
    return inputs, forces


def whitening(z: FloatArray) -> FloatArray:
    """Return the symmetric matrix that turns normalized rows (n, d) to unit covariance; flat directions stay."""
    variance, directions = np.linalg.eigh(np.cov(z, rowvar=False))
    gain = np.where(variance > _FLAT_VARIANCE, 1.0 / np.sqrt(np.maximum(variance, _FLAT_VARIANCE)), 1.0)
    matrix: FloatArray = (directions * gain) @ directions.T
    return matrix
