"""Symmetries of the block, searched for counterexamples."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grouser.terrain import (
    CONTACTS,
    MODES,
    FloatArray,
    Mode,
    PhysicsBackend,
    TrackedVehicle,
    interface,
    mirror_forces,
    parameter_ranges,
)

M113 = TrackedVehicle.preset("m113")
# Round-off of 640 cell forces, each of at most W/640, and their arms of at most 1.8 m.
ROUND_OFF = 1e-12 * M113.weight * np.array([1.0, 1.0, 2.0])
searched = settings(max_examples=60, deadline=None, derandomize=True)


def rows(mode: Mode) -> st.SearchStrategy[FloatArray]:
    speed, side, turn, accel = (st.floats(-limit, limit) for limit in (10, 3, 3, 40))
    ranges = parameter_ranges("wide", mode)
    theta = (st.floats(low, high) for low, high in zip(ranges.low, ranges.high, strict=True))
    return st.tuples(speed, side, turn, accel, accel, speed, speed, *theta).map(np.array)


any_case = st.sampled_from(MODES).flatmap(lambda mode: st.tuples(st.just(mode), rows(mode), st.sampled_from(CONTACTS)))


@searched
@given(any_case)
def test_the_mirrored_vehicle_feels_the_mirrored_force(case: Any) -> None:
    mode, row, contact = case
    block = PhysicsBackend(M113, mode, contact=contact)
    mirrored = block.forces(interface(mode).mirror(row))
    np.testing.assert_array_less(np.abs(mirrored - mirror_forces(block.forces(row))), ROUND_OFF)


@searched
@given(any_case)
def test_driving_backward_is_driving_forward_seen_from_behind(case: Any) -> None:
    mode, row, contact = case
    block = PhysicsBackend(M113, mode, contact=contact)
    vx, vy, omega, ax, ay, left, right, *theta = row
    reversed_row = np.array([-vx, vy, -omega, -ax, ay, -left, -right, *theta])
    difference = block.forces(reversed_row) - block.forces(row) * [-1, 1, -1]
    np.testing.assert_array_less(np.abs(difference), ROUND_OFF)


@searched
@given(any_case, st.floats(1e-3, 1e3))
def test_without_soft_speed_only_ratios_of_velocities_matter(case: Any, factor: float) -> None:
    mode, row, contact = case
    block = PhysicsBackend(M113, mode, contact=contact, soft_speed=0.0)
    row[5:7] += np.copysign(0.1, row[5:7])  # a stopped belt is refused
    scaled = row.copy()
    scaled[[0, 1, 2, 5, 6]] *= factor
    # Scaling rounds each velocity; a cell turns that into eps V d/(Vt K) <= eps 10 L/(0.1 * 0.005) = 1e-11.
    np.testing.assert_array_less(np.abs(block.forces(scaled) - block.forces(row)), 100 * ROUND_OFF)


@searched
@given(any_case)
def test_shear_opposes_sliding_so_the_ground_never_drives(case: Any) -> None:
    mode, row, contact = case
    row[interface(mode).index("fr")] = 0.0
    block = PhysicsBackend(M113, mode, contact=contact)
    tracks = block.track_forces(row[None], row[None])[0]
    belt_power = row[5] * tracks[0, 0] + row[6] * tracks[1, 0]
    assert belt_power - block.forces(row) @ row[:3] >= -1e-11 * M113.weight  # round-off at up to 10 m/s


@searched
@given(rows("rigid"))
def test_firm_ground_returns_no_more_than_friction(row: FloatArray) -> None:
    row[interface("rigid").index("fr")] = 0.0
    force = PhysicsBackend(M113, "rigid").forces(row)
    assert np.hypot(force[0], force[1]) <= row[7] * M113.weight * (1 + 1e-12)


@pytest.mark.parametrize("mode", MODES)
def test_the_jacobian_has_the_mirror_symmetry_too(mode: Mode, states: Any) -> None:
    table = interface(mode)
    block = PhysicsBackend(M113, mode)
    x = states(M113, mode, 100)
    _, jacobian = block.forces_and_jacobian(x)
    _, mirrored = block.forces_and_jacobian(table.mirror(x))
    expected = mirror_forces(np.swapaxes(jacobian, 1, 2))[:, table.mirror_permutation] * table.mirror_signs[:, None]
    scale = np.abs(jacobian).max(axis=(0, 1))
    assert np.all(np.abs(np.swapaxes(mirrored, 1, 2) - expected) <= 1e-11 * scale[:, None])  # round-off of the sums
