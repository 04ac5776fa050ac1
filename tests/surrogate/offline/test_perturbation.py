"""Rows beside the trajectory carry the teacher's own forces."""

from dataclasses import asdict, replace

import numpy as np
import pytest

from grouser.surrogate.offline.dataset import Dataset
from grouser.surrogate.offline.perturbation import perturbed_rows, teacher_of
from grouser.terrain import ConfigurationError, FloatArray, PhysicsBackend, TrackedVehicle

VELOCITIES = ["vx", "vy", "yaw_rate", "v_left", "v_right"]


def columns(dataset: Dataset, names: list[str] | tuple[str, ...]) -> list[int]:
    return [dataset.interface.index(name) for name in names]


def copies_of(rows: FloatArray, dataset: Dataset) -> list[FloatArray]:
    return np.split(rows, len(rows) // len(dataset.inputs))


@pytest.fixture
def four(dataset: Dataset) -> tuple[FloatArray, FloatArray]:
    return perturbed_rows(dataset, 4, np.random.default_rng(0))


def test_forces_are_those_of_the_physics_on_these_rows(dataset: Dataset, four: tuple[FloatArray, FloatArray]) -> None:
    inputs, forces = four
    assert inputs.shape == (4 * len(dataset.inputs), dataset.interface.size)
    physics = PhysicsBackend(TrackedVehicle.preset("m113"), dataset.manifest.mode)
    np.testing.assert_array_equal(forces, physics.forces(inputs))


def test_the_terrain_stays_and_every_velocity_moves(dataset: Dataset, four: tuple[FloatArray, FloatArray]) -> None:
    terrain = columns(dataset, dataset.interface.parameter_names)
    velocities = columns(dataset, VELOCITIES)
    for copy in copies_of(four[0], dataset):
        np.testing.assert_array_equal(copy[:, terrain], dataset.inputs[:, terrain])
        assert np.all(copy[:, velocities] != dataset.inputs[:, velocities])


def test_half_of_the_copies_take_their_accelerations_from_another_row(
    dataset: Dataset, four: tuple[FloatArray, FloatArray]
) -> None:
    accelerations = columns(dataset, ["ax", "ay"])
    logged = dataset.inputs[:, accelerations]
    shuffled = 0
    for copy in copies_of(four[0], dataset):
        if np.array_equal(copy[:, accelerations], logged):
            continue
        shuffled += 1
        assert np.mean(np.any(copy[:, accelerations] != logged, axis=1)) > 0.9
        # The same pairs in another order: ax and ay of one row stay together.
        np.testing.assert_array_equal(
            copy[np.lexsort(copy[:, accelerations].T)][:, accelerations], logged[np.lexsort(logged.T)]
        )
    assert shuffled == 2


def test_moves_lie_between_a_centimetre_and_a_metre_a_second(rigid: Dataset) -> None:
    rows, _ = perturbed_rows(rigid, 8, np.random.default_rng(1))
    moves = rows[:, columns(rigid, VELOCITIES)] - np.tile(rigid.inputs[:, columns(rigid, VELOCITIES)], (8, 1))
    moves[:, 2] *= rigid.vehicle.contact_length / 2
    # Each row has one spread s, log-uniform from .01 to 1 m/s: the mean of s² is (1 − 1e-4)/(2 ln 100).
    np.testing.assert_allclose(np.mean(moves**2, axis=0), (1 - 1e-4) / (2 * np.log(100)), rtol=0.15)
    row_spread = np.sqrt(np.mean(moves**2, axis=1))
    assert 0.05 < np.median(row_spread) < 0.2
    assert row_spread.max() < 4


def test_the_generator_decides(rigid: Dataset) -> None:
    first, again, other = (perturbed_rows(rigid, 2, np.random.default_rng(seed))[0] for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_no_copies_are_no_rows(dataset: Dataset) -> None:
    inputs, forces = perturbed_rows(dataset, 0, np.random.default_rng(0))
    assert inputs.shape == (0, dataset.interface.size)
    assert forces.shape == (0, 3)


def test_the_dataset_is_left_alone(rigid: Dataset) -> None:
    before = rigid.inputs.copy()
    perturbed_rows(rigid, 2, np.random.default_rng(0))
    np.testing.assert_array_equal(rigid.inputs, before)


@pytest.mark.parametrize("contact", ["continuous", "per_wheel"])
def test_the_teacher_is_the_backend_of_the_manifest(rigid: Dataset, contact: str) -> None:
    vehicle = replace(rigid.vehicle, mass=9000.0, cg_offset=0.2)
    backend = PhysicsBackend(vehicle, "rigid", cells=(2, 1), contact=contact, soft_speed=0.05)  # type: ignore[arg-type]
    manifest = replace(rigid.manifest, vehicle=vehicle.to_dict(), backend=backend.describe())
    other = Dataset(manifest, rigid.records, rigid.inputs, rigid.forces, rigid.run_index)
    assert teacher_of(other).describe() == backend.describe()
    inputs, forces = perturbed_rows(other, 1, np.random.default_rng(0))
    np.testing.assert_array_equal(forces, backend.forces(inputs))


def test_a_teacher_that_nobody_knows_is_refused(rigid: Dataset) -> None:
    manifest = replace(rigid.manifest, backend={**asdict(rigid.manifest)["backend"], "backend": "phisics"})
    other = Dataset(manifest, rigid.records, rigid.inputs, rigid.forces, rigid.run_index)
    with pytest.raises(ConfigurationError, match="physics"):
        perturbed_rows(other, 1, np.random.default_rng(0))
