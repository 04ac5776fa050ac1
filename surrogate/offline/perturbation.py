"""Rows beside the logged ones: what the block answers where trajectories do not go by themselves.

Along a trajectory the block's accelerations of the last tick give its forces away, Q ≈ m a, and a network learns just
that. In closed loop it then holds every force that it has and lets the vehicle drift. The block has no state, so that
it can be asked beside the trajectory, where the shortcut fails.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from ...terrain import FloatArray, ForceBackend, make_backend, physics_options
from .dataset import Dataset

#: Limits of the log-uniform spread of the perturbation, in m/s.
SMALLEST_SPREAD: Final = 0.01
LARGEST_SPREAD: Final = 1.0


def teacher_of(dataset: Dataset) -> ForceBackend:
    """Return the backend that a dataset's forces came from."""
    return make_backend(
        dataset.manifest.backend["backend"],
        mode=dataset.manifest.mode,
        vehicle=dataset.vehicle,
        **physics_options(dataset.manifest.backend),
    )


def perturbed_rows(dataset: Dataset, copies: int, generator: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Return perturbed copies of a dataset's rows with the teacher's forces for them.

    Body velocities and belt speeds move by normal draws whose spread is drawn log-uniformly, row by row; every other
    copy takes its accelerations from another row.

    Parameters
    ----------
    dataset : Dataset
        Rows to start from; a teacher that is registered.
    copies : int
        Copies of each row.
    generator : numpy.random.Generator
        Source of every draw.

    Returns
    -------
    inputs : ndarray, shape (copies · n, d)
    forces : ndarray, shape (copies · n, 3)
    """
    vehicle, table = dataset.vehicle, dataset.interface
    velocities = [table.index(name) for name in ("vx", "vy", "yaw_rate", "v_left", "v_right")]
    # A yaw rate moves the ends of the contact length as much as a velocity moves the whole of it.
    unit = np.array([1.0, 1.0, 2.0 / vehicle.contact_length, 1.0, 1.0])
    inputs = []
    for copy in range(copies):
        rows = dataset.inputs.copy()
        spread = np.exp(generator.uniform(np.log(SMALLEST_SPREAD), np.log(LARGEST_SPREAD), size=(len(rows), 1)))
        rows[:, velocities] += spread * unit * generator.standard_normal((len(rows), len(velocities)))
        if copy % 2 == 1:
            accelerations = [table.index(name) for name in ("ax", "ay")]
            rows[:, accelerations] = rows[generator.permutation(len(rows))][:, accelerations]
        inputs.append(rows)
    together = np.concatenate(inputs) if inputs else np.empty((0, table.size))
    return together, teacher_of(dataset).forces(together) if len(together) else np.empty((0, 3))
