"""The structured surrogate's equations against the cell-integrated block, and what holds whatever the network says."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import casadi
import numpy as np
import pytest
import torch

from grouser.surrogate import NUMPY_NETWORK, Surrogate, torch_network
from grouser.surrogate.track_model import FEATURES, SIDES, TrackState, track_forces, track_state
from grouser.terrain import (
    GRAVITY,
    MODES,
    ConfigurationError,
    FloatArray,
    Mode,
    ShearGrid,
    TrackedVehicle,
    interface,
    mirror_forces,
    reference_forces,
)

Make = Callable[..., Surrogate]
Rows = Callable[..., tuple[FloatArray, Any]]

VEHICLES = ("m113", "marder", "ugv", "maxxii", "warthog")
GROUND: dict[Mode, tuple[float, ...]] = {"rigid": (0.7, 0.05, 0.03), "soil": (4000.0, 0.5, 0.08, 0.02)}
every_vehicle = pytest.mark.parametrize("name", VEHICLES)
every_mode = pytest.mark.parametrize("mode", MODES)
M113 = TrackedVehicle.preset("m113")


def quadrature(vehicle: TrackedVehicle, mode: Mode, x: FloatArray) -> FloatArray:
    """Forces of the shear points alone: a network that says nothing."""
    tracks = [track_forces(NUMPY_NETWORK, vehicle, mode, x, side, lambda _: 0.0) for side in SIDES]
    return np.concatenate([left + right for left, right in zip(*tracks, strict=True)], axis=-1)


def states(vehicle: TrackedVehicle, mode: Mode, x: FloatArray) -> list[TrackState]:
    return [track_state(NUMPY_NETWORK, vehicle, mode, x, side) for side in SIDES]


def available(vehicle: TrackedVehicle, mode: Mode, x: FloatArray) -> FloatArray:
    """Σ S_i of both tracks, shape (n, 1)."""
    total: FloatArray = np.sum([state.strengths for state in states(vehicle, mode, x)], axis=(0, -1))
    return total[:, None]


def rolling_rows(vehicle: TrackedVehicle, mode: Mode, count: int, seed: int) -> FloatArray:
    """Straight free rolling at any belt speed, under accelerations that lift no wheel: no slip anywhere."""
    generator = np.random.default_rng(seed)
    speed = generator.uniform(-1.0, 1.0, count) * vehicle.training_speed
    still, lean = np.zeros(count), generator.normal(0.0, 0.3, (2, count))
    return np.column_stack([speed, still, still, *lean, speed, speed, np.tile(GROUND[mode], (count, 1))])


def block(vehicle: TrackedVehicle, mode: Mode, x: FloatArray) -> FloatArray:
    """The block's integral, where the integrand is a polynomial: two grids leave no error of second order."""
    coarse, fine = (reference_forces(vehicle, mode, x, grid=ShearGrid(n, n, contact=vehicle.contact)) for n in (8, 16))
    return (4 * fine - coarse) / 3


# --- the quadrature against the block


@pytest.mark.parametrize("offset", [0.0, 0.12])
@every_mode
@every_vehicle
def test_a_small_slip_shears_exactly_as_under_the_block(name: str, mode: Mode, offset: float) -> None:
    preset = TrackedVehicle.preset(name)
    vehicle = replace(preset, cg_offset=offset * preset.contact_length)
    # So narrow that the yawing of a track about itself, of order b²/L², is nothing.
    narrow = replace(vehicle, track_width=1e-4 * preset.contact_length)
    generator, x = np.random.default_rng(1), rolling_rows(vehicle, mode, 60, 0)
    # Slip velocities that shear the ground by a millionth of K: what is not linear is of that order.
    slip = 1e-6 * x[:, -1] * np.hypot(x[:, 5], vehicle.soft_speed) / vehicle.contact_length
    slipping = x.copy()
    slipping[:, [0, 1, 6]] += slip[:, None] * generator.normal(size=(60, 3))
    slipping[:, 2] += slip * generator.normal(size=60) * 2 / vehicle.contact_length
    for each, outputs in ((vehicle, slice(0, 2)), (narrow, slice(0, 3))):
        found, expected = (
            (forces(each, mode, slipping) - forces(each, mode, x))[:, outputs] for forces in (quadrature, block)
        )
        assert np.all(np.abs(found - expected) <= 2e-5 * np.abs(expected).max(axis=0))


@pytest.mark.parametrize("name", ["m113", "marder", "ugv", "maxxii"])
def test_the_yaw_moment_of_a_wide_track_at_small_slip_lacks_little(name: str) -> None:
    vehicle = TrackedVehicle.preset(name)
    x = rolling_rows(vehicle, "rigid", 60, 2)
    slip = 1e-6 * x[:, -1] * np.hypot(x[:, 5], vehicle.soft_speed) / vehicle.contact_length
    turning = x.copy()
    turning[:, 2] = 2 * slip / vehicle.contact_length
    found, expected = (
        (forces(vehicle, "rigid", turning) - forces(vehicle, "rigid", x))[:, 2] for forces in (quadrature, block)
    )
    # The track's own turning, b²/12 against L²/12 + B²/4.
    width = vehicle.track_width**2 / (vehicle.contact_length**2 + 3 * vehicle.tread**2)
    assert np.all(np.abs(found - expected) <= 1.1 * width * np.abs(expected))


@every_mode
@every_vehicle
def test_full_slip_along_a_straight_line_gives_the_whole_strength_against_it(name: str, mode: Mode) -> None:
    vehicle = TrackedVehicle.preset(name)
    generator, x = np.random.default_rng(3), rolling_rows(vehicle, mode, 60, 4)
    belts = generator.uniform(-1.0, 1.0, (60, 2)) * vehicle.training_speed
    course = generator.uniform(0.0, 2 * np.pi, 60)
    x[:, [5, 6]] = belts
    # Faster than the belts run, so that both tracks slide for good; sheared by thousands of K within a millimetre.
    x[:, [0, 1]] = 3 * vehicle.training_speed * np.column_stack([np.cos(course), np.sin(course)])
    x[:, -1] = 1e-7
    expected = np.zeros((60, 3))
    for state, belt, y in zip(states(vehicle, mode, x), belts.T, (1, -1), strict=True):
        slip = np.column_stack([x[:, 0] - belt, x[:, 1]])
        shear = -slip / np.linalg.norm(slip, axis=1, keepdims=True)
        fx = state.strengths.sum(axis=1) * shear[:, 0] + state.rolling[:, 0]
        fy = state.strengths * shear[:, 1:]
        moment = fy @ vehicle.element_centers - y * vehicle.tread / 2 * fx
        expected += np.column_stack([fx, fy.sum(axis=1), moment])
    scale = vehicle.weight * np.array([1.0, 1.0, vehicle.contact_length])
    assert np.all(np.abs(quadrature(vehicle, mode, x) - expected) <= 1e-4 * scale)
    assert np.all(np.abs(reference_forces(vehicle, mode, x) - expected) <= 1e-4 * scale)


@every_mode
@every_vehicle
def test_driven_states_leave_a_few_percent_of_the_available_shear_to_the_network(
    driving_rows: Rows, name: str, mode: Mode
) -> None:
    vehicle = TrackedVehicle.preset(name)
    x, _ = driving_rows(vehicle, mode, samples=25, seed=5)
    error = quadrature(vehicle, mode, x) - reference_forces(vehicle, mode, x)
    error /= available(vehicle, mode, x) * np.array([1.0, 1.0, vehicle.contact_length / 4])
    # Measured on tracks: root-mean-square at most 2.5, 1.4 and 4.1 %, worst 6.8, 4.1 and 12.5 %.
    assert np.all(np.sqrt(np.mean(error**2, axis=0)) <= [0.03, 0.02, 0.05])
    assert np.all(np.abs(error).max(axis=0) <= [0.09, 0.06, 0.16])


@pytest.mark.parametrize("wheels", [1, 2, 4])
def test_shear_that_starts_afresh_under_each_wheel_is_exact_at_small_slip_where_points_divide(wheels: int) -> None:
    vehicle = replace(M113, road_wheels=wheels, contact="per_wheel", cg_offset=0.2)
    x = rolling_rows(vehicle, "rigid", 30, 23)
    slip = 1e-6 * x[:, -1] * np.hypot(x[:, 5], vehicle.soft_speed) / vehicle.contact_length
    slipping = x.copy()
    slipping[:, :3] += slip[:, None] * np.random.default_rng(24).normal(size=(30, 3))
    found, expected = (
        (forces(vehicle, "rigid", slipping) - forces(vehicle, "rigid", x))[:, :2] for forces in (quadrature, block)
    )
    assert np.all(np.abs(found - expected) <= 2e-5 * np.abs(expected).max(axis=0))


@pytest.mark.parametrize("wheels", [3, 5, 8])
def test_points_that_the_wheels_cannot_share_are_refused(wheels: int) -> None:
    vehicle = replace(M113, road_wheels=wheels, contact="per_wheel")
    with pytest.raises(ConfigurationError, match=f"1, 2 or 4 road wheels, got {wheels}"):
        quadrature(vehicle, "rigid", rolling_rows(vehicle, "rigid", 1, 0))


# --- strengths and rolling resistance


@every_vehicle
def test_rigid_strengths_sum_to_friction_times_weight_also_where_wheels_lift_off(name: str) -> None:
    vehicle = TrackedVehicle.preset(name)
    x = rolling_rows(vehicle, "rigid", 200, 6)
    x[:, 3:5] = np.random.default_rng(7).normal(0.0, 12.0, (200, 2))
    strengths = np.array([state.strengths for state in states(vehicle, "rigid", x)])
    assert np.any(strengths.sum(axis=-1) == 0)  # a track in the air
    assert np.any((strengths == 0) & (strengths.sum(axis=-1, keepdims=True) > 0))  # a wheel of a loaded track
    np.testing.assert_allclose(strengths.sum(axis=(0, 2)), 0.7 * vehicle.weight, rtol=1e-13)


@every_vehicle
def test_soil_strengths_are_the_shear_that_the_block_gives_at_full_slip(name: str) -> None:
    vehicle = TrackedVehicle.preset(name)
    x = rolling_rows(vehicle, "soil", 100, 8)
    x[:, [0, 2, 5, 6]] = 0.0
    x[:, 1] = 50.0
    x[:, -1] = 1e-6
    level = x[:1].copy()
    level[:, 3:5] = 0.0
    cohesion, angle = x[0, 7:9]
    area = 2 * vehicle.road_wheels * vehicle.element_length * vehicle.track_width
    assert available(vehicle, "soil", level).item() == pytest.approx(cohesion * area + vehicle.weight * np.tan(angle))
    x[:, 3:5] = np.random.default_rng(9).normal(0.0, 12.0, (100, 2))
    assert np.any(available(vehicle, "soil", x) < available(vehicle, "soil", level) - 1.0)  # contact lost
    np.testing.assert_allclose(-reference_forces(vehicle, "soil", x)[:, 1:2], available(vehicle, "soil", x), rtol=1e-6)


@every_mode
def test_lift_off_and_clipped_shares_are_those_of_the_block(driving_rows: Rows, mode: Mode) -> None:
    vehicle = replace(M113, cg_offset=0.2)
    x, _ = driving_rows(vehicle, mode, runs=6, samples=50, seed=10)
    x[:, 3:5] = np.random.default_rng(11).normal(0.0, 15.0, (300, 2))
    lifted = np.any([np.any(state.strengths == 0, axis=1) for state in states(vehicle, mode, x)], axis=0)
    assert 50 < np.sum(lifted) < 300
    error = quadrature(vehicle, mode, x) - reference_forces(vehicle, mode, x)
    error /= available(vehicle, mode, x) * np.array([1.0, 1.0, vehicle.contact_length / 4])
    # As on level load; a single wheel may carry a quarter of the weight, and then counts alone.
    assert np.all(np.sqrt(np.mean(error**2, axis=0)) <= [0.03, 0.03, 0.08])


@every_mode
@every_vehicle
def test_free_rolling_feels_rolling_resistance_alone(make_structured: Make, name: str, mode: Mode) -> None:
    vehicle = TrackedVehicle.preset(name)
    x = rolling_rows(vehicle, mode, 50, 12)
    x[:, 4] = 0.0
    direction = x[:, 5] / np.hypot(x[:, 5], vehicle.soft_speed)
    forces = make_structured(mode, vehicle=vehicle).reference_forces(x)
    np.testing.assert_allclose(forces[:, 0], -x[:, -2] * vehicle.weight * direction, rtol=1e-12)
    # Both sides' moments of half the resistance cancel, to round-off of the half.
    assert np.all(np.abs(forces[:, 1:]) <= 1e-12 * vehicle.weight)


# --- what holds whatever the network says


def wild_rows(mode: Mode, count: int, seed: int) -> FloatArray:
    """Motion of any size from nothing to a million, on any ground."""
    generator = np.random.default_rng(seed)
    motion = generator.choice([-1.0, 1.0], (count, 7)) * 10 ** generator.uniform(-12, 6, (count, 7))
    motion[generator.random((count, 7)) < 0.1] = 0.0
    theta = np.tile(GROUND[mode], (count, 1))
    theta[:, -1] = 10 ** generator.uniform(-4, 0, count)
    return np.column_stack([motion, theta])


@every_mode
@every_vehicle
def test_features_and_gate_are_bounded_whatever_comes(name: str, mode: Mode) -> None:
    vehicle = TrackedVehicle.preset(name)
    x = wild_rows(mode, 4000, 13)
    ordinary = np.random.default_rng(14).normal(size=(4000, 7)) * vehicle.training_speed
    for rows in (x, np.column_stack([ordinary, x[:, 7:]])):
        for state in states(vehicle, mode, rows):
            assert state.features.shape == (4000, FEATURES)
            # A shear is a direction times at most 1; what it curves by joins it, measured 0.14 beyond at most.
            assert np.all(np.abs(state.features) <= 1.25)
            assert np.all((state.gate >= 0) & (state.gate <= 1))
            assert all(np.isfinite(part).all() for part in (state.quadrature, state.strengths, state.rolling))


@every_vehicle
def test_gate_and_features_but_the_rolling_direction_vanish_without_slip(name: str) -> None:
    vehicle = TrackedVehicle.preset(name)
    x = rolling_rows(vehicle, "rigid", 50, 15)
    x[0, [0, 5, 6]] = 0.0
    for state, column in zip(states(vehicle, "rigid", x), (5, 6), strict=True):
        assert np.all(state.gate == 0)
        assert np.all(state.features[:, :-1] == 0)
        assert np.all(state.quadrature == 0)
        np.testing.assert_allclose(state.features[:, -1], x[:, column] / np.hypot(x[:, column], vehicle.soft_speed))


@pytest.mark.parametrize("seed", range(3))
@every_mode
@every_vehicle
def test_a_vehicle_at_rest_feels_no_force_at_all(make_structured: Make, name: str, mode: Mode, seed: int) -> None:
    vehicle = replace(TrackedVehicle.preset(name), cg_offset=0.05)
    surrogate = make_structured(mode, vehicle=vehicle, seed=seed)
    x = rolling_rows(vehicle, mode, 20, 16)
    x[:, [0, 5, 6]] = 0.0
    x[10:, 3:5] *= 40.0
    x[::2, -1] = 1e-3
    assert np.all(surrogate.reference_forces(x) == 0.0)
    moving = x.copy()
    moving[:, 1] = 1e-3  # the network does speak
    shear = surrogate.reference_forces(moving) - quadrature(vehicle, mode, moving)
    assert np.all(np.abs(shear).max(axis=0) > 0)


@pytest.mark.parametrize("activation", ["relu", "silu", "tanh"])
@every_mode
@every_vehicle
def test_the_mirror_image_feels_the_mirrored_force_to_the_bit(
    make_structured: Make, driving_rows: Rows, name: str, mode: Mode, activation: str
) -> None:
    vehicle = replace(TrackedVehicle.preset(name), cg_offset=0.05)
    surrogate = make_structured(mode, activation, vehicle=vehicle)
    x = np.concatenate([driving_rows(vehicle, mode, runs=3, samples=40, seed=17)[0], wild_rows(mode, 100, 18)])
    mirrored = interface(mode).mirror(x)
    forces = surrogate.reference_forces(x)
    np.testing.assert_array_equal(surrogate.reference_forces(mirrored), mirror_forces(forces))
    np.testing.assert_array_equal(
        surrogate.reference_forces(mirrored[7]), mirror_forces(surrogate.reference_forces(x[7]))
    )
    assert np.all(np.abs(forces[:120]).max(axis=0) > 0)


# --- the same equations in torch and CasADi


def torch_forces(surrogate: Surrogate, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Forces and Jacobian in float64, by torch."""
    rows = torch.tensor(x, requires_grad=True)
    forces = surrogate.evaluate(torch_network(), rows)
    slopes = [torch.autograd.grad(forces[:, i].sum(), rows, retain_graph=True)[0] for i in range(3)]
    return forces.detach().numpy(), torch.stack(slopes, dim=1).numpy()


@every_mode
@pytest.mark.parametrize("name", ["m113", "marder", "warthog"])
def test_numpy_casadi_and_torch_agree(make_structured: Make, driving_rows: Rows, name: str, mode: Mode) -> None:
    vehicle = replace(TrackedVehicle.preset(name), cg_offset=-0.05)
    surrogate = make_structured(mode, vehicle=vehicle)
    x, _ = driving_rows(vehicle, mode, runs=4, samples=30, seed=19)
    x[60:90, 3:5] *= 10.0  # wheels off the ground
    x[90:, :7] *= 1e-9  # next to rest, on both sides of the series for small slip
    x[-1, :7] = 0.0
    expected = surrogate.reference_forces(x)
    function = surrogate.casadi()
    assert (function.size_in(0), function.size_out(0)) == ((surrogate.interface.size, 1), (3, 1))
    for found in (torch_forces(surrogate, x)[0], np.array(function(x.T)).T):
        assert np.abs((found - expected) / expected.std(axis=0)).max() < 1e-9  # measured 1e-14


@every_mode
@pytest.mark.parametrize("name", ["m113", "warthog"])
def test_derivatives_are_finite_at_rest_and_agree_in_torch_and_casadi(
    make_structured: Make, name: str, mode: Mode
) -> None:
    vehicle = TrackedVehicle.preset(name)
    surrogate = make_structured(mode, vehicle=vehicle)
    x = rolling_rows(vehicle, mode, 10, 20)
    x[:5, [0, 5, 6]] = 0.0
    _, slopes = torch_forces(surrogate, x)
    column = casadi.MX.sym("x", surrogate.interface.size)
    jacobian = casadi.Function("jacobian", [column], [casadi.jacobian(surrogate.casadi()(column), column)])
    by_casadi = np.array([np.array(jacobian(row)) for row in x])
    assert np.isfinite(slopes).all()
    assert np.isfinite(by_casadi).all()
    np.testing.assert_allclose(by_casadi, slopes, rtol=1e-9, atol=1e-9 * np.abs(slopes).max())
    # The ground resists a sliding vehicle: the more, the faster.
    assert np.all(slopes[:, [0, 1, 2], [0, 1, 2]] < 0)


def test_the_quadratures_derivative_at_rest_is_the_blocks() -> None:
    vehicle = replace(M113, cg_offset=0.2, track_width=1e-3)
    x = rolling_rows(vehicle, "rigid", 1, 21)
    x[:, [0, 5, 6]] = 0.0
    rows = torch.tensor(x, requires_grad=True)
    tracks = [track_forces(torch_network(), vehicle, "rigid", rows, side, lambda _: 0.0) for side in SIDES]
    forces = [left + right for left, right in zip(*tracks, strict=True)]
    slopes = np.array([torch.autograd.grad(each, rows, retain_graph=True)[0].numpy()[0] for each in forces])
    # Central differences over velocities that shear the ground by a millionth of K.
    step = 1e-6 * x[0, -1] * vehicle.soft_speed / vehicle.contact_length
    for column in (0, 1, 2, 5, 6):
        ahead, behind = x.copy(), x.copy()
        ahead[:, column], behind[:, column] = step, -step
        expected = (block(vehicle, "rigid", ahead) - block(vehicle, "rigid", behind))[0] / (2 * step)
        np.testing.assert_allclose(slopes[:, column], expected, rtol=1e-5, atol=1e-5 * np.abs(expected).max())


def test_gravity_is_that_of_the_block() -> None:
    x = rolling_rows(M113, "rigid", 1, 22)
    load = sum(state.rolling for state in states(M113, "rigid", x))
    direction = x[0, 5] / np.hypot(x[0, 5], M113.soft_speed)
    assert load.item() == pytest.approx(-x[0, -2] * 11300 * GRAVITY * direction)
