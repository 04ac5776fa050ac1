"""Rows that fill slip space: inside the envelope, evenly over the decades, with the teacher's own forces."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from grouser.surrogate import NUMPY_NETWORK
from grouser.surrogate.offline import TrainingConfig
from grouser.surrogate.offline.dataset import Dataset
from grouser.surrogate.offline.preparation import training_rows
from grouser.surrogate.offline.space_filling import (
    BRAKING_SPEED,
    LARGEST_SLIP,
    LATERAL_SHARE,
    SMALLEST_SLIP,
    SMALLEST_SPEED,
    counts,
    slip_coordinates,
    space_filling_rows,
)
from grouser.surrogate.offline.training import train_surrogate
from grouser.surrogate.track_model import shear_points, track_state
from grouser.terrain import (
    GRAVITY,
    ConfigurationError,
    FloatArray,
    InvalidInputError,
    Mode,
    PhysicsBackend,
    TrackedVehicle,
    parameter_ranges,
    shear_capacity,
    terrain_type,
    vehicle_names,
)

M113 = TrackedVehicle.preset("m113")
COUNT = 4096


def drawn(
    vehicle: TrackedVehicle = M113, mode: Mode = "rigid", count: int = COUNT, seed: int = 0, ranges: str = "wide"
) -> tuple[FloatArray, FloatArray]:
    teacher = PhysicsBackend(vehicle, mode, cells=(2, 1))
    return space_filling_rows(vehicle, mode, parameter_ranges(ranges, mode), count, teacher, seed)


@pytest.mark.parametrize("mode", ["rigid", "soil"])
def test_the_seed_decides(mode: Mode) -> None:
    first, again, other = (drawn(mode=mode, count=500, seed=seed)[0] for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.any(np.all(first[: counts(500)[0]] == other[: counts(500)[0]], axis=1))


def test_the_global_generator_of_torch_is_left_alone() -> None:
    import torch

    before = torch.random.get_rng_state()
    drawn(count=100)
    assert torch.equal(torch.random.get_rng_state(), before)


@pytest.mark.parametrize("mode", ["rigid", "soil"])
def test_forces_are_the_teachers(mode: Mode) -> None:
    teacher = PhysicsBackend(M113, mode)
    inputs, forces = space_filling_rows(M113, mode, parameter_ranges("wide", mode), 600, teacher, 3)
    np.testing.assert_array_equal(forces, teacher.forces(inputs))
    assert inputs.shape == (600, teacher.interface.size)


@pytest.mark.parametrize("ranges", ["wide", "paper"])
@pytest.mark.parametrize("mode", ["rigid", "soil"])
@pytest.mark.parametrize("name", vehicle_names())
def test_rows_lie_inside_the_envelope(name: str, mode: Mode, ranges: str) -> None:
    vehicle, box = TrackedVehicle.preset(name), parameter_ranges(ranges, mode)
    inputs, forces = drawn(vehicle, mode, ranges=ranges)
    assert np.isfinite(inputs).all()
    assert np.isfinite(forces).all()
    top = vehicle.training_speed
    bounds = {"vx": 1.1 * top, "vy": LATERAL_SHARE * top, "yaw_rate": 2 * top / vehicle.tread}
    for column, name_ in enumerate(("vx", "vy", "yaw_rate", "ax", "ay", "v_left", "v_right")):
        assert np.abs(inputs[:, column]).max() <= bounds.get(name_, top if name_ in ("v_left", "v_right") else np.inf)
    theta = inputs[:, 7:]
    assert np.all(theta >= box.low)
    assert np.all(theta <= box.high)
    # Every parameter comes near both of its ends, also by the cube of the wide cohesion.
    assert np.all(np.ptp(theta, axis=0) > 0.99 * np.subtract(box.high, box.low))
    held = [shear_capacity(vehicle, terrain_type(mode)(*row)) / vehicle.mass for row in theta]
    assert np.all(np.hypot(inputs[:, 3], inputs[:, 4]) <= np.array(held) * (1 + 1e-12))
    # No track lifts, and the vehicle stands on its contact length.
    assert np.abs(inputs[:, 4]).max() <= GRAVITY * vehicle.tread / (2 * vehicle.cg_height) * (1 + 1e-12)
    assert np.abs(inputs[:, 3]).max() <= GRAVITY * vehicle.contact_length / (2 * vehicle.cg_height) * (1 + 1e-12)


def test_terrain_follows_the_law_of_a_run() -> None:
    box = parameter_ranges("wide", "soil")
    rows, _ = drawn(mode="soil", count=8192)
    generator = np.random.default_rng(0)
    runs = np.array([box.sample(generator).parameters for _ in range(8192)])
    shares = np.linspace(0.1, 0.9, 9)
    span = np.subtract(box.high, box.low)
    got, expected = (np.quantile(theta, shares, axis=0) / span for theta in (rows[:, 7:], runs))
    np.testing.assert_allclose(got, expected, atol=0.02)


def test_the_slip_fills_its_space() -> None:
    """Five decades of every coordinate and both signs are each as full as the next; the sixth is cut by the envelope."""
    slipping = counts(COUNT)[0]
    u = slip_coordinates(M113, drawn()[0][:slipping])
    size = np.abs(u).reshape(-1, 3)
    for coordinate in size.T:
        shares = np.histogram(np.log10(coordinate), bins=np.arange(-3, 4))[0] / coordinate.size
        assert np.all(shares[:5] > 0.15)
        assert np.all(shares[:5] < 0.21)
        assert shares[5] > 0.06
    np.testing.assert_allclose(np.mean(u > 0, axis=(0, 1)), 0.5, atol=0.02)
    # One track of every row lies in the space itself, to where only the envelope is narrower.
    inside = np.all((np.abs(u) >= 0.999 * SMALLEST_SLIP) & (np.abs(u) <= 1.001 * LARGEST_SLIP), axis=2)
    assert np.mean(inside.any(axis=1)) > 0.97
    # Pairs of decades are filled, too: no coordinate decides about another.
    along, turning = np.log10(size[:, 0]), np.log10(size[:, 2])
    joint = np.histogram2d(along, turning, bins=[np.arange(-3, 3)] * 2)[0] / len(size)
    assert joint.min() > 0.01


def test_slip_coordinates_are_those_of_the_structured_surrogate() -> None:
    """At its shear points, without yaw, the shear over K is (1 − e^(−u d/L)) along the slip, d the distance travelled."""
    rows, _ = drawn(count=400)
    rows[:, 2] = 0.0
    points = shear_points(M113)
    u = slip_coordinates(M113, rows)
    for index, side in enumerate(("left", "right")):
        state = track_state(NUMPY_NETWORK, M113, "rigid", rows, side)  # type: ignore[arg-type]
        belt = rows[:, 5 + index]
        travelled = points.half_travel - belt / np.hypot(belt, M113.soft_speed) * points.reach[2]
        shear = np.hypot(state.features[:, 2], state.features[:, 6])
        size = np.hypot(u[:, index, 0], u[:, index, 1])
        np.testing.assert_allclose(shear, -np.expm1(-size * travelled / M113.contact_length), atol=1e-9)


def test_the_last_rows_brake_and_rest() -> None:
    slipping, braking, resting = counts(COUNT)
    assert slipping + braking + resting == COUNT
    rows, forces = drawn()
    stopping, rest = rows[slipping : slipping + braking], rows[slipping + braking :]
    assert (len(stopping), len(rest)) == (round(0.10 * COUNT), round(0.02 * COUNT))
    assert np.abs(stopping[:, 5:7]).max() <= M113.soft_speed
    speed = np.linalg.norm(stopping[:, :3] * (1, 1, M113.contact_length / 2), axis=1)
    assert speed.min() >= 0.999 * SMALLEST_SPEED
    assert speed.max() <= 1.001 * BRAKING_SPEED
    decades = np.histogram(np.log10(speed), bins=np.arange(-6, 1))[0]
    assert decades.min() > 0.9 * len(stopping) / 6
    np.testing.assert_array_equal(rest[:, [0, 1, 2, 5, 6]], 0.0)
    assert np.all(np.abs(rest[:, 3:5]).max(axis=1) > 0)
    np.testing.assert_array_equal(forces[slipping + braking :], 0.0)


@pytest.mark.parametrize("count", [0, 1, 5, 50])
def test_few_rows_are_few_rows(count: int) -> None:
    inputs, forces = drawn(count=count)
    assert (inputs.shape, forces.shape) == ((count, 10), (count, 3))


def test_a_first_part_is_the_same_however_many_follow() -> None:
    few, many = drawn(count=1000)[0], drawn(count=2000)[0]
    np.testing.assert_array_equal(few[: counts(1000)[0]], many[: counts(1000)[0]])


def test_impossible_questions_are_refused() -> None:
    box = parameter_ranges("wide", "rigid")
    with pytest.raises(InvalidInputError, match="not be negative"):
        drawn(count=-1)
    with pytest.raises(InvalidInputError, match="not be negative"):
        drawn(seed=-1)
    with pytest.raises(ConfigurationError, match="soil"):
        space_filling_rows(M113, "rigid", box, 10, PhysicsBackend(M113, "soil"), 0)
    with pytest.raises(ConfigurationError, match="ugv"):
        space_filling_rows(M113, "rigid", box, 10, PhysicsBackend(TrackedVehicle.preset("ugv"), "rigid"), 0)
    with pytest.raises(InvalidInputError, match="soft_speed"):
        drawn(replace(M113, soft_speed=0.0))


# --- in a training


@pytest.mark.parametrize("value", [-1, 2.0, True])
def test_the_recipe_takes_a_whole_number(value: object) -> None:
    with pytest.raises(InvalidInputError, match="space_filling_rows"):
        TrainingConfig(space_filling_rows=value)  # type: ignore[arg-type]


def test_training_rows_are_joined_by_them(dataset: Dataset, training_config: Callable[..., TrainingConfig]) -> None:
    mode = dataset.manifest.mode
    plain = training_config(symmetries=False)
    inputs, forces = training_rows(dataset, replace(plain, space_filling_rows=300))
    before, forces_before = training_rows(dataset, plain)
    np.testing.assert_array_equal(inputs[:-300], before)
    np.testing.assert_array_equal(forces[:-300], forces_before)
    teacher = PhysicsBackend(M113, mode)
    expected = space_filling_rows(M113, mode, parameter_ranges("wide", mode), 300, teacher, plain.seed)
    np.testing.assert_array_equal(inputs[-300:], expected[0])
    np.testing.assert_array_equal(forces[-300:], expected[1])


def test_a_training_with_them_says_so(
    rigid: Dataset, training_config: Callable[..., TrainingConfig], tmp_path: Path
) -> None:
    result = train_surrogate(rigid, training_config(space_filling_rows=200, epochs=1), tmp_path / "a.safetensors")
    assert result.surrogate.recipe["space_filling_rows"] == 200
    # The guard's box is that of trajectories, not of rows that nobody drives.
    without = train_surrogate(rigid, training_config(epochs=1), tmp_path / "b.safetensors").surrogate
    np.testing.assert_array_equal(result.surrogate.detector.high, without.detector.high)
