"""The exact-path block: a walk over the ground integrated numerically, the soft block on straight runs, symmetries."""

import json
import math
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from belt_path import walked_distance
from hypothesis import example, given, settings
from hypothesis import strategies as st

from grouser.surrogate.offline.dataset import load_dataset
from grouser.surrogate.offline.generate import DataConfig, generate_dataset
from grouser.terrain import (
    CONTACTS,
    MODES,
    NUMPY,
    SHEAR_PATHS,
    ConfigurationError,
    Contact,
    ExactBackend,
    FloatArray,
    InvalidInputError,
    Mode,
    PhysicsBackend,
    ShearGrid,
    TrackedVehicle,
    block_forces,
    casadi_namespace,
    interface,
    make_backend,
    mirror_forces,
    parameter_ranges,
    physics_options,
    reference_forces,
    reverse_forces,
    torch_namespace,
)
from grouser.terrain.block import exact_displacement

M113 = TrackedVehicle.preset("m113")
GOLDEN = np.array([3, 0.2, 0.3, 0, 0, 2.5, 3.8, 0.7, 0, 0.05])
# Float64 implementations of the same sums: the design promises 1e-9 of the output's standard deviation.
PARITY = 1e-9
# Round-off of 640 cell forces, each of at most W/640, and their arms of at most 1.8 m.
ROUND_OFF = 1e-12 * M113.weight * np.array([1.0, 1.0, 2.0])

States = Callable[..., FloatArray]
every_mode = pytest.mark.parametrize("mode", MODES)
every_contact = pytest.mark.parametrize("contact", CONTACTS)


def assert_parity(actual: FloatArray, expected: FloatArray) -> None:
    np.testing.assert_array_less(np.abs(actual - expected) / expected.std(axis=0), PARITY)


def longest_times(vehicle: TrackedVehicle, x: FloatArray, soft_speed: float) -> FloatArray:
    """Longest time on the ground under each track, with continuous contact, shape (n, 2)."""
    speed = np.hypot(x[:, 5:7], soft_speed)
    return np.asarray(vehicle.contact_length / 2 * (1 + np.abs(x[:, 5:7]) / speed) / speed)


# The published state


def test_the_published_state_to_five_figures() -> None:
    fine = ExactBackend(M113, "rigid", cells=(104, 64), soft_speed=0.0)
    assert fine.forces(GOLDEN) == pytest.approx([7449.3, -23585.7, 38735.8], rel=1e-5)


def test_it_is_not_the_soft_blocks() -> None:
    soft, exact = (kind(M113, "rigid", soft_speed=0.0).forces(GOLDEN) for kind in (PhysicsBackend, ExactBackend))
    assert soft[0] / exact[0] == pytest.approx(8138.6 / 7449.3, rel=2e-3)  # both as printed, at the default grid


# Displacement


def displacement(x: float, y: float, motion: tuple[float, float, float], belt: float, time: float) -> float:
    vx, vy, omega = motion
    return float(exact_displacement(NUMPY, vx - omega * y - belt, vy + omega * x, omega, np.float64(belt), time))


def reach(y: float, motion: tuple[float, float, float], belt: float, x: float, time: float) -> float:
    """Length in m that round-off is measured by: what the velocities cover in the time, added up."""
    vx, vy, omega = motion
    return (abs(vx) + abs(vy) + abs(belt) + abs(omega) * (abs(x) + abs(y))) * time


speeds = st.floats(-10, 10)
turns = st.one_of(st.floats(-4, 4), st.floats(-1e-3, 1e-3), st.floats(-1e-9, 1e-9), st.just(0.0))


@settings(max_examples=300)
@given(st.floats(-2, 2), st.floats(-1.5, 1.5), speeds, st.floats(-3, 3), turns, speeds, st.floats(0, 30))
@example(0.3, 1.0, 2.0, 0.5, 0.0, 2.5, 1.0)
@example(0.3, 1.0, 2.0, 0.5, 1e-12, 2.5, 1.0)
@example(0.3, -1.0, -2.0, 0.5, 0.4, -2.5, 1.0)
@example(0.3, -1.0, 0.0, 0.0, 1.0, 0.0, math.pi)
def test_the_displacement_is_the_way_walked_since_the_point_touched_down(
    x: float, y: float, vx: float, vy: float, omega: float, belt: float, time: float
) -> None:
    motion = (vx, vy, omega)
    expected = walked_distance(x, y, motion, belt, time)
    # A few roundings of each term, and what the quadrature adds over half a turn.
    tolerance = 1e-13 * reach(y, motion, belt, x, min(time, math.pi / max(abs(omega), 1e-9))) + 1e-145
    assert displacement(x, y, motion, belt, time) == pytest.approx(expected, rel=1e-13, abs=tolerance)


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("omega", [0.5, -2.0])
def test_at_half_a_turn_it_stays_where_it_is(omega: float, side: float) -> None:
    half = math.pi / abs(omega)
    motion = (1.0, 0.2, omega)
    at_half = displacement(0.4, side, motion, 0.7, half)
    for longer in (1.001, 1.5, 2.0, 40.0):
        assert displacement(0.4, side, motion, 0.7, longer * half) == at_half
    before = displacement(0.4, side, motion, 0.7, half * (1 - 1e-6))
    assert 0 < abs(before - at_half) < 1e-5 * at_half  # continuous, and still changing until then


@every_contact
@pytest.mark.parametrize("belt", [0.0, 0.2])
def test_the_forces_pass_half_a_turn_without_a_jump(contact: Contact, belt: float) -> None:
    length = M113.contact_length if contact == "continuous" else M113.element_length
    speed = math.hypot(belt, 0.1)
    critical = math.pi * speed / (length / 2 * (1 - belt / speed * 0.99))  # some cell reaches half a turn about here
    rows = np.tile(np.array([0.4, 0.1, 0.0, 0, 0, belt, belt, 0.7, 0, 1.0]), (2001, 1))  # K: no saturation
    rows[:, 2] = critical * np.linspace(0.5, 1.5, len(rows))
    block = ExactBackend(M113, "rigid", contact=contact)
    forces = block.forces(rows)
    steps = np.abs(np.diff(forces, axis=0)).max(axis=0)
    # Smooth curves halve their largest step with the step; a jump keeps it.
    coarse = np.abs(np.diff(forces[::2], axis=0)).max(axis=0)
    np.testing.assert_array_less(steps, 0.6 * coarse)


def test_a_point_that_keeps_turning_in_place_is_sheared_by_the_diameter_of_its_circle() -> None:
    # No velocity of the CG, no belt: the point circles the CG, and half a turn ago it was opposite.
    for x, y in ((1.2, 0.0), (0.3, -0.9)):
        assert displacement(x, y, (0.0, 0.0, 0.8), 0.0, 100.0) == pytest.approx(2 * math.hypot(x, y), rel=1e-14)


# The block against the naive cell loop that integrates


@every_mode
@every_contact
def test_the_block_does_what_the_specification_says(
    vehicle: TrackedVehicle, mode: Mode, contact: Contact, states: States, naive: States
) -> None:
    x = states(vehicle, mode, 60)
    grid = ShearGrid(3, 2, contact, "exact")
    options: dict[str, Any] = {"along": 3, "across": 2, "contact": contact}
    expected = naive(vehicle, mode, x, **options, soft_speed=vehicle.soft_speed, path="exact")
    assert_parity(reference_forces(vehicle, mode, x, grid=grid), expected)
    assert_parity(ExactBackend(vehicle, mode, cells=(3, 2), contact=contact).forces(x), expected)


@every_mode
@every_contact
@pytest.mark.parametrize("cells", [(16, 4), (7, 3), (1, 1)])
def test_compiled_forces_are_the_oracles(
    vehicle: TrackedVehicle, mode: Mode, contact: Contact, cells: tuple[int, int], states: States
) -> None:
    x = states(vehicle, mode, 300, seed=1)
    if cells == (16, 4):
        # Some cells stand beyond half a turn, else this would not compare that rule.
        angles = np.abs(x[:, 2:3]) * longest_times(vehicle, x, vehicle.soft_speed)
        assert 0.01 < np.mean(angles > math.pi) < 0.9
    expected = reference_forces(vehicle, mode, x, grid=ShearGrid(*cells, contact, "exact"))
    assert_parity(ExactBackend(vehicle, mode, cells=cells, contact=contact).forces(x), expected)


@pytest.mark.parametrize("soft_speed", [0.0, 1.0])
def test_at_other_soft_speeds_too(soft_speed: float, states: States, naive: States) -> None:
    x = states(M113, "soil", 60)
    x = x[(x[:, 5] != 0) & (x[:, 6] != 0)]
    expected = naive(M113, "soil", x, along=3, across=2, contact="continuous", soft_speed=soft_speed, path="exact")
    assert_parity(ExactBackend(M113, "soil", cells=(3, 2), soft_speed=soft_speed).forces(x), expected)


@every_mode
@every_contact
def test_casadi_and_torch_evaluate_the_same_block(mode: Mode, contact: Contact, states: States) -> None:
    casadi, torch = pytest.importorskip("casadi"), pytest.importorskip("torch")
    x = states(M113, mode, 150)
    grid = ShearGrid(4, 2, contact, "exact")
    expected = reference_forces(M113, mode, x, grid=grid)
    symbol = casadi.MX.sym("x", x.shape[1])
    function = casadi.Function("block", [symbol], [block_forces(casadi_namespace(), M113, mode, symbol, grid=grid)])
    assert_parity(np.array(function.map(len(x))(x.T)).T, expected)
    by_torch = block_forces(torch_namespace(), M113, mode, torch.from_numpy(x), grid=grid)
    assert_parity(by_torch.numpy(), expected)


# Straight runs


@every_mode
@every_contact
def test_on_a_straight_run_both_models_are_one(
    vehicle: TrackedVehicle, mode: Mode, contact: Contact, states: States
) -> None:
    x = states(vehicle, mode, 200, seed=5)
    x[:, 2] = 0.0
    assert np.abs(x[:, 1]).max() > 0.1 * vehicle.soft_speed  # with sideslip
    soft = PhysicsBackend(vehicle, mode, contact=contact).forces(x)
    exact = ExactBackend(vehicle, mode, contact=contact).forces(x)
    scale = vehicle.weight * np.array([1.0, 1.0, vehicle.contact_length])
    np.testing.assert_array_less(np.abs(exact - soft) / scale, 1e-12)  # round-off of the sums


def test_in_a_turn_they_part() -> None:
    row = GOLDEN.copy()
    soft, exact = PhysicsBackend(M113, "rigid").forces(row), ExactBackend(M113, "rigid").forces(row)
    assert np.all(np.abs(exact - soft) > 0.01 * np.abs(soft))


@pytest.mark.parametrize("omega", [1e-4, 1e-7, 1e-11, 1e-13, 1e-200])
def test_a_vanishing_yaw_rate_leads_to_the_straight_run(omega: float) -> None:
    row = np.array([3.0, 0.2, 0.0, 1, 2, 2.5, 3.8, 0.7, 0.05, 0.05])
    turning = row.copy()
    turning[2] = omega
    for evaluate in (ExactBackend(M113, "rigid").forces, oracle("rigid")):
        difference = np.abs(evaluate(turning) - evaluate(row))
        # The slope is of the order of W a rad/s and a metre.
        np.testing.assert_array_less(difference, 10 * omega * M113.weight + ROUND_OFF)


def oracle(mode: Mode, contact: Contact = "continuous") -> Callable[[FloatArray], FloatArray]:
    return lambda x: reference_forces(M113, mode, x, grid=ShearGrid(16, 4, contact, "exact"))


@every_mode
def test_rest_gives_nothing(mode: Mode) -> None:
    row = np.zeros(interface(mode).size)
    row[7:] = parameter_ranges("wide", mode).high
    np.testing.assert_array_equal(ExactBackend(M113, mode).forces(row), np.zeros(3))
    np.testing.assert_array_equal(oracle(mode)(row), np.zeros(3))


# Jacobian


def away_from_kinks(vehicle: TrackedVehicle, x: FloatArray, soft_speed: float) -> FloatArray:
    """Rows clear of the clips of the loads, of zero sliding, and of a cell that reaches half a turn."""
    slips = x[:, :1] - x[:, 2:3] * vehicle.tread / 2 * np.array([1, -1]) - x[:, 5:7]
    sliding = np.abs(slips).min(axis=1) > 0.1 + np.abs(x[:, 2]) * vehicle.track_width / 2
    calm = (np.abs(x[:, 3]) < 3.0) & (np.abs(x[:, 4]) < 5.0)
    angles = np.abs(x[:, 2:3]) * longest_times(vehicle, x, soft_speed)
    return np.asarray(x[sliding & calm & np.all(angles < 0.99 * math.pi, axis=1)])


def richardson(evaluate: Callable[[FloatArray], FloatArray], x: FloatArray, column: int, width: float) -> FloatArray:
    """Central differences, their truncation of second order extrapolated away."""
    step = np.zeros(x.shape[-1])
    step[column] = width

    def slope(factor: float) -> FloatArray:
        return np.asarray((evaluate(x + factor * step) - evaluate(x - factor * step)) / (2 * factor * width))

    return (4 * slope(0.5) - slope(1.0)) / 3


@every_mode
@every_contact
def test_the_analytic_jacobian_is_the_slope_of_the_oracle(mode: Mode, contact: Contact, states: States) -> None:
    v = replace(M113, cg_offset=0.2)
    x = away_from_kinks(v, states(v, mode, 500, seed=3), v.soft_speed)
    assert len(x) > 100
    grid = ShearGrid(3, 2, contact, "exact")
    _, jacobian = ExactBackend(v, mode, cells=(3, 2), contact=contact).forces_and_jacobian(x)
    for column, name in enumerate(interface(mode).names):
        width = 1e-4 * min(np.abs(x[:, column]).max(), 10 * x[:, column].std())
        slope = richardson(lambda shifted: reference_forces(v, mode, shifted, grid=grid), x, column, width)
        scale = np.abs(jacobian[:, :, column]).max(axis=0)
        error = np.abs(jacobian[:, :, column] - slope) / np.maximum(scale, 1e-9 * scale.max())
        assert error.max() < 1e-5, name


def test_the_jacobian_holds_beyond_half_a_turn() -> None:
    row = np.array(
        [0.05, 0.02, 2.0, 0.5, 0.3, 0.01, -0.02, 0.7, 0.03, 0.6]
    )  # K so large that the shear does not saturate
    grid = ShearGrid(3, 2, "continuous", "exact")
    times = longest_times(M113, row[None], M113.soft_speed)
    assert np.all(2.0 * times > 2 * math.pi)
    _, jacobian = ExactBackend(M113, "rigid", cells=(3, 2)).forces_and_jacobian(row)
    for column, name in enumerate(interface("rigid").names):
        slope = richardson(lambda x: reference_forces(M113, "rigid", x, grid=grid), row, column, 1e-5)
        scale = np.abs(jacobian[:, column]).max()
        np.testing.assert_allclose(jacobian[:, column], slope, atol=1e-5 * scale, rtol=0, err_msg=name)


@every_mode
def test_the_jacobian_comes_with_the_same_forces(mode: Mode, states: States) -> None:
    x = states(M113, mode, 60)
    block = ExactBackend(M113, mode)
    forces, jacobian = block.forces_and_jacobian(x)
    np.testing.assert_allclose(forces, block.forces(x), rtol=0, atol=1e-12 * M113.weight)  # round-off of the sums
    assert np.all(np.isfinite(jacobian))


@pytest.mark.parametrize(
    "motion",
    [(0.0, 0.0, 0.0, 0.0, 0.0), (3.0, 0.0, 0.0, 3.0, 3.0), (3.0, 0.2, 0.0, 2.5, 3.8), (3.0, 0.2, 0.3, 2.5, 3.8)],
    ids=["rest", "rolling", "straight", "turning"],
)
def test_casadi_and_torch_differentiate_the_block_as_c_does(motion: tuple[float, ...]) -> None:
    casadi, torch = pytest.importorskip("casadi"), pytest.importorskip("torch")
    vx, vy, omega, left, right = motion
    row = np.array([vx, vy, omega, 1.0, 2.0, left, right, 0.7, 0.05, 0.05])
    grid = ShearGrid(4, 2, "continuous", "exact")
    _, expected = ExactBackend(M113, "rigid", cells=(4, 2)).forces_and_jacobian(row)
    symbol = casadi.MX.sym("x", 10)
    force = block_forces(casadi_namespace(), M113, "rigid", symbol, grid=grid)
    by_casadi = np.array(casadi.Function("jacobian", [symbol], [casadi.jacobian(force, symbol)])(row))
    by_torch = torch.autograd.functional.jacobian(
        lambda x: block_forces(torch_namespace(), M113, "rigid", x, grid=grid), torch.from_numpy(row)
    ).numpy()
    tolerance = 1e-10 * np.abs(expected).max()  # round-off of the largest entries and their quotients
    np.testing.assert_allclose(by_casadi, expected, rtol=1e-9, atol=tolerance)
    np.testing.assert_allclose(by_torch, expected, rtol=1e-9, atol=tolerance)


# Symmetries, power


def rows(mode: Mode) -> st.SearchStrategy[FloatArray]:
    speed, side, turn, accel = (st.floats(-limit, limit) for limit in (10, 3, 3, 40))
    ranges = parameter_ranges("wide", mode)
    theta = (st.floats(low, high) for low, high in zip(ranges.low, ranges.high, strict=True))
    return st.tuples(speed, side, turn, accel, accel, speed, speed, *theta).map(np.array)


any_case = st.sampled_from(MODES).flatmap(lambda mode: st.tuples(st.just(mode), rows(mode), st.sampled_from(CONTACTS)))


@settings(max_examples=60)
@given(any_case)
def test_the_mirrored_vehicle_feels_the_mirrored_force(case: Any) -> None:
    mode, row, contact = case
    block = ExactBackend(M113, mode, contact=contact)
    mirrored = block.forces(interface(mode).mirror(row))
    np.testing.assert_array_less(np.abs(mirrored - mirror_forces(block.forces(row))), ROUND_OFF)


@settings(max_examples=60)
@given(any_case)
def test_driving_backward_is_driving_forward_seen_from_behind(case: Any) -> None:
    mode, row, contact = case
    block = ExactBackend(M113, mode, contact=contact)
    backward = block.forces(interface(mode).reverse(row))
    np.testing.assert_array_less(np.abs(backward - reverse_forces(block.forces(row))), ROUND_OFF)


@settings(max_examples=60)
@given(any_case)
def test_shear_opposes_sliding_so_the_ground_never_drives(case: Any) -> None:
    mode, row, contact = case
    row[interface(mode).index("fr")] = 0.0
    tracks = ExactBackend(M113, mode, contact=contact).track_forces(row, row)[0]
    dissipated = row[5:7] @ tracks[:, 0] - row[:3] @ tracks.sum(axis=0)
    assert dissipated >= -1e-11 * M113.weight  # round-off at up to 10 m/s


@settings(max_examples=60)
@given(any_case)
def test_the_shear_is_never_above_the_strength(case: Any) -> None:
    mode, row, contact = case
    row[interface(mode).index("fr")] = 0.0
    force = ExactBackend(M113, mode, contact=contact).forces(row)
    friction = row[7] if mode == "rigid" else math.tan(row[8])
    cohesion = 0.0 if mode == "rigid" else row[7] * 2 * M113.contact_length * M113.track_width
    assert np.hypot(force[0], force[1]) <= (friction * M113.weight + cohesion) * (1 + 1e-12)


# Options, copies, inputs


@every_mode
def test_it_is_made_by_its_name(mode: Mode) -> None:
    block = make_backend("exact", mode=mode, vehicle="maxxii", cells=(3, 2), contact="per_wheel", soft_speed=0.2)
    assert isinstance(block, ExactBackend)
    assert block.has_track_forces
    assert json.loads(json.dumps(block.describe())) == {
        "backend": "exact",
        "mode": mode,
        "vehicle": "maxxii",
        "cells": [3, 2],
        "contact": "per_wheel",
        "soft_speed": 0.2,
    }
    again = make_backend("exact", mode=mode, vehicle="maxxii", **physics_options(block.describe()))
    assert again.describe() == block.describe()


def test_each_contact_option_is_another_block() -> None:
    per_wheel, continuous = (
        make_backend("exact", mode="rigid", contact=contact).forces(GOLDEN) for contact in ("per_wheel", "continuous")
    )
    assert abs(per_wheel[1]) < 0.9 * abs(continuous[1])  # the shear starts afresh under each of five wheels


@pytest.mark.parametrize("name", ["v_left", "v_right"])
def test_without_soft_speed_a_stopped_belt_is_refused(name: str) -> None:
    row = GOLDEN.copy()
    row[interface("rigid").index(name)] = 0.0
    block = ExactBackend(M113, "rigid", soft_speed=0.0)
    for call in (block.forces, block.forces_and_jacobian, lambda x: block.track_forces(x, x)):
        with pytest.raises(InvalidInputError, match=f"{name}.*soft_speed 0 every belt must run"):
            call(row)
    with pytest.raises(InvalidInputError):
        reference_forces(M113, "rigid", row, grid=ShearGrid(path="exact"), soft_speed=0.0)


def test_an_unknown_path_is_answered_with_the_nearest() -> None:
    assert SHEAR_PATHS == ("soft", "exact")
    with pytest.raises(ConfigurationError, match="unknown shear path 'exakt'; did you mean 'exact'"):
        ShearGrid(path="exakt")  # type: ignore[arg-type]


def test_a_pickled_backend_is_the_same_backend(states: States) -> None:
    v = replace(M113, name="mine", cg_offset=0.1)
    block = ExactBackend(v, "soil", cells=(3, 2), contact="per_wheel", soft_speed=0.2)
    copy = pickle.loads(pickle.dumps(block))
    x = states(v, "soil", 20)
    assert type(copy) is ExactBackend
    assert copy.vehicle == v
    assert copy.describe() == block.describe()
    np.testing.assert_array_equal(copy.forces(x), block.forces(x))


@every_mode
def test_a_batch_equals_its_rows_to_the_bit(mode: Mode, states: States) -> None:
    x = states(M113, mode, 40)
    block = ExactBackend(M113, mode)
    forces, jacobian = block.forces_and_jacobian(x)
    np.testing.assert_array_equal(block.forces(x), [block.forces(row) for row in x])
    for i, row in enumerate(x):
        single = block.forces_and_jacobian(row)
        np.testing.assert_array_equal(single[0], forces[i])
        np.testing.assert_array_equal(single[1], jacobian[i])


# As a teacher


def test_it_teaches(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    config = DataConfig(teacher="exact", runs=6, samples_per_run=30, transient=0.5, seed=3)
    manifest = generate_dataset(config, tmp_path)
    assert manifest.backend["backend"] == "exact"
    data = load_dataset(tmp_path)
    exact, physics = ExactBackend(data.vehicle, "rigid"), PhysicsBackend(data.vehicle, "rigid")
    np.testing.assert_array_equal(exact.forces(data.inputs), data.forces)
    apart = np.abs(physics.forces(data.inputs) - data.forces).max(axis=0)
    assert np.all(apart > 0.01 * data.forces.std(axis=0))
