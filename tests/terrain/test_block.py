"""The block's equations over NumPy, CasADi and torch, against a naive cell loop written from the specification."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from grouser.terrain import (
    CONTACTS,
    MODES,
    NUMPY,
    ConfigurationError,
    Contact,
    FloatArray,
    InvalidInputError,
    Mode,
    PhysicsBackend,
    RigidTerrain,
    ShearGrid,
    TrackedVehicle,
    block_forces,
    casadi_namespace,
    interface,
    reference_forces,
    torch_namespace,
)
from grouser.terrain.block import element_shares, rolling_direction, shear_factor, shear_strength, side_loads

M113 = TrackedVehicle.preset("m113")
# Float64 implementations of the same sums: the design promises 1e-9 of the output's standard deviation.
PARITY = 1e-9

States = Callable[..., FloatArray]


def assert_parity(actual: FloatArray, expected: FloatArray) -> None:
    np.testing.assert_array_less(np.abs(actual - expected) / expected.std(axis=0), PARITY)


def scalars(columns: list[Any]) -> FloatArray:
    return np.array([float(np.squeeze(column)) for column in columns])


# Loads


def test_lateral_acceleration_moves_load_to_the_right_track_by_h_over_b() -> None:
    left, right = side_loads(NUMPY, M113, 2.0)
    transfer = 11300 * 2.0 * 0.79 / 2.159
    assert left == pytest.approx(M113.weight / 2 - transfer, rel=1e-15)
    assert right == pytest.approx(M113.weight / 2 + transfer, rel=1e-15)


@pytest.mark.parametrize(("ay", "left"), [(40.0, 0.0), (-40.0, 1.0), (1e6, 0.0)])
def test_a_lifted_side_carries_nothing_and_the_other_everything(ay: float, left: float) -> None:
    loads = side_loads(NUMPY, M113, ay)
    np.testing.assert_array_equal(loads, [left * M113.weight, (1 - left) * M113.weight])


def test_without_acceleration_a_centred_vehicle_loads_every_element_alike() -> None:
    np.testing.assert_allclose(scalars(element_shares(NUMPY, M113, 0.0)), np.full(5, 0.2), rtol=1e-15)


@pytest.mark.parametrize("ax", [-3.0, 0.0, 4.0])
@pytest.mark.parametrize("cg_offset", [-0.2, 0.0, 0.2])
def test_the_shares_balance_at_the_centre_of_pressure(ax: float, cg_offset: float) -> None:
    v = replace(M113, cg_offset=cg_offset)
    shares = scalars(element_shares(NUMPY, v, ax))
    assert np.all(shares > 0)  # else the centre of pressure would be held back by the clip
    assert shares @ v.element_centers == pytest.approx(-0.79 * ax / 9.81, abs=1e-15)


def test_accelerating_forward_loads_the_rear() -> None:
    shares = scalars(element_shares(NUMPY, M113, 3.0))
    assert np.all(np.diff(shares) < 0)


@pytest.mark.parametrize("ax", [-40.0, -15.0, 0.0, 15.0, 40.0])
def test_elements_carry_no_tension_and_together_the_weight(vehicle: TrackedVehicle, ax: float) -> None:
    shares = scalars(element_shares(NUMPY, vehicle, ax))
    loads = np.outer(side_loads(NUMPY, vehicle, ax / 2), shares)
    assert shares.min() >= 0
    assert loads.sum() == pytest.approx(vehicle.weight, rel=1e-14)


def test_a_single_element_carries_the_whole_track() -> None:
    assert scalars(element_shares(NUMPY, replace(M113, road_wheels=1), 3.0)) == pytest.approx([1.0])


# Shear


def test_the_soft_rolling_direction_is_the_sign_of_a_running_belt_and_zero_at_rest() -> None:
    vt = np.array([-5.0, -0.1, 0.0, 0.1, 5.0])
    np.testing.assert_allclose(rolling_direction(NUMPY, vt, 0.1), vt / np.hypot(vt, 0.1), rtol=1e-15)
    np.testing.assert_array_equal(rolling_direction(NUMPY, np.array([-5.0, 5.0]), 0.0), [-1, 1])


def test_the_shear_factor_is_one_at_zero_and_smooth_through_it() -> None:
    z = np.array([0.0, 1e-300, 1e-12, 1e-4, 1.0, 50.0])
    series = [1.0, 1.0, 1 - 0.5e-12, 1 - 0.5e-4 + 1e-8 / 6, 1 - np.exp(-1.0), 0.02]
    np.testing.assert_allclose(shear_factor(NUMPY, z), series, rtol=1e-12)  # the series' next term: z^3/24


def strength(mode: Mode, parameters: list[float], load: float) -> float:
    return float(shear_strength(NUMPY, M113, mode, list(parameters), load))


def test_firm_ground_holds_by_friction_alone() -> None:
    pressure = 1e4 / (M113.element_length * 0.38)
    assert strength("rigid", [0.7, 0.0, 0.05], 1e4) == pytest.approx(0.7 * pressure, rel=1e-15)


def test_soil_holds_by_cohesion_and_friction() -> None:
    pressure = 1e4 / (M113.element_length * 0.38)
    expected = 2e3 + pressure * np.tan(0.5)
    assert strength("soil", [2e3, 0.5, 0.0, 0.05], 1e4) == pytest.approx(expected, rel=1e-15)


def test_cohesion_fades_below_five_percent_of_the_static_load() -> None:
    threshold = 0.05 * M113.weight / 10
    cohesion = [strength("soil", [2e3, 0.0, 0.0, 0.05], f * threshold) for f in (0.0, 0.25, 0.5, 1.0, 2.0)]
    np.testing.assert_allclose(cohesion, [0.0, 500.0, 1000.0, 2000.0, 2000.0], rtol=1e-14)


# The whole block against the naive loop

GRIDS = [(1, 1, "continuous"), (3, 2, "continuous"), (3, 2, "per_wheel"), (16, 4, "continuous")]


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(("along", "across", "contact"), GRIDS)
def test_the_block_does_what_the_specification_says(
    vehicle: TrackedVehicle, mode: Mode, along: int, across: int, contact: Contact, states: States, naive: States
) -> None:
    x = states(vehicle, mode, 60 if along > 3 else 200)
    grid = ShearGrid(along, across, contact)
    expected = naive(vehicle, mode, x, along=along, across=across, contact=contact, soft_speed=vehicle.soft_speed)
    assert_parity(reference_forces(vehicle, mode, x, grid=grid), expected)
    compiled = PhysicsBackend(vehicle, mode, cells=(along, across), contact=contact)
    assert_parity(compiled.forces(x), expected)


@pytest.mark.parametrize("soft_speed", [0.0, 0.01, 1.0])
def test_the_block_does_so_at_any_soft_speed(soft_speed: float, states: States, naive: States) -> None:
    x = states(M113, "soil", 300)
    if soft_speed == 0.0:
        x = x[(x[:, 5] != 0) & (x[:, 6] != 0)]
    expected = naive(M113, "soil", x, along=4, across=2, contact="continuous", soft_speed=soft_speed)
    assert_parity(reference_forces(M113, "soil", x, grid=ShearGrid(4, 2), soft_speed=soft_speed), expected)
    assert_parity(PhysicsBackend(M113, "soil", cells=(4, 2), soft_speed=soft_speed).forces(x), expected)


def test_the_default_is_sixteen_by_four_continuous_cells_at_the_vehicles_soft_speed(states: States) -> None:
    x = states(M113, "rigid", 20)
    spelled_out = reference_forces(M113, "rigid", x, grid=ShearGrid(16, 4, "continuous"), soft_speed=0.1)
    np.testing.assert_array_equal(reference_forces(M113, "rigid", x), spelled_out)


@pytest.mark.parametrize("mode", MODES)
def test_a_single_element_shears_alike_under_both_contact_options(mode: Mode, states: States) -> None:
    v = replace(M113, road_wheels=1, cg_offset=0.2)
    x = states(v, mode, 100)
    continuous, per_wheel = (reference_forces(v, mode, x, grid=ShearGrid(contact=contact)) for contact in CONTACTS)
    assert_parity(per_wheel, continuous)


def test_forces_pass_smoothly_through_standstill() -> None:
    rest = np.array([0, 0, 0, 0, 0, 0, 0, 0.7, 0.0, 0.05])
    np.testing.assert_array_equal(reference_forces(M113, "rigid", rest), np.zeros(3))
    creeping = rest.copy()
    creeping[0] = 1e-6
    stiffness = 0.7 * M113.weight * 2.667 / (2 * 0.05 * 0.1)  # mu W L/(2 K V_eps): a viscous hold
    qx = reference_forces(M113, "rigid", creeping)[0]
    assert qx == pytest.approx(-stiffness * 1e-6, rel=2e-4)  # phi_1 = 1 - z/2, z = 2.7e-4


@pytest.mark.parametrize("ax", [0.0, 3.0, 30.0])
@pytest.mark.parametrize("belt", [-3.0, 0.0, 2.9, 3.0, 4.0])
def test_a_straight_run_with_equal_belts_has_exactly_no_yaw_moment(
    vehicle: TrackedVehicle, ax: float, belt: float
) -> None:
    row = np.array([3.0, 0, 0, ax, 0, belt, belt, 0.7, 0.05, 0.03])
    for forces in (reference_forces(vehicle, "rigid", row), PhysicsBackend(vehicle, "rigid").forces(row)):
        assert forces[2] == 0.0
        assert forces[1] == 0.0


def test_rolling_resistance_pulls_each_track_against_its_belt() -> None:
    row = np.array([0, 0, 0, 0, 2.0, 3.0, -3.0, 0.7, 0.0, 0.05])
    rolling = row.copy()
    rolling[8] = 0.1
    left, right = side_loads(NUMPY, M113, 2.0)
    s = 3.0 / np.hypot(3.0, 0.1)
    difference = reference_forces(M113, "rigid", rolling) - reference_forces(M113, "rigid", row)
    expected = [-0.1 * s * (left - right), 0.0, 0.1 * s * (left + right) * 2.159 / 2]
    np.testing.assert_allclose(difference, expected, atol=1e-11 * M113.weight)  # round-off of the difference


# Other namespaces


@pytest.mark.parametrize("contact", CONTACTS)
@pytest.mark.parametrize("mode", MODES)
def test_casadi_evaluates_the_same_block(mode: Mode, contact: Contact, states: States) -> None:
    casadi = pytest.importorskip("casadi")
    x = states(M113, mode, 150)
    grid = ShearGrid(4, 2, contact)
    symbol = casadi.MX.sym("x", x.shape[1])
    function = casadi.Function("block", [symbol], [block_forces(casadi_namespace(), M113, mode, symbol, grid=grid)])
    evaluated = np.array(function.map(len(x))(x.T)).T
    assert_parity(evaluated, reference_forces(M113, mode, x, grid=grid))


@pytest.mark.parametrize("contact", CONTACTS)
@pytest.mark.parametrize("mode", MODES)
def test_torch_evaluates_the_same_block(mode: Mode, contact: Contact, states: States) -> None:
    torch = pytest.importorskip("torch")
    x = states(M113, mode, 300)
    grid = ShearGrid(8, 3, contact)
    evaluated = block_forces(torch_namespace(), M113, mode, torch.from_numpy(x), grid=grid)
    assert_parity(evaluated.numpy(), reference_forces(M113, mode, x, grid=grid))


def test_torch_and_casadi_take_one_row() -> None:
    torch, casadi = pytest.importorskip("torch"), pytest.importorskip("casadi")
    row = np.array([3, 0.2, 0.3, 1, 2, 2.5, 3.8, 0.7, 0.05, 0.05])
    expected = reference_forces(M113, "rigid", row)
    by_torch = block_forces(torch_namespace(), M113, "rigid", torch.from_numpy(row))
    by_casadi = block_forces(casadi_namespace(), M113, "rigid", casadi.DM(row))
    assert by_torch.shape == (3,)
    assert by_casadi.shape == (3, 1)
    np.testing.assert_allclose(by_torch.numpy(), expected, rtol=1e-11)
    np.testing.assert_allclose(np.array(by_casadi).ravel(), expected, rtol=1e-11)


# Input


def test_a_row_gives_what_it_gives_in_a_batch(states: States) -> None:
    x = states(M113, "soil", 50)
    batch = reference_forces(M113, "soil", x)
    assert batch.shape == (50, 3)
    assert_parity(np.array([reference_forces(M113, "soil", row) for row in x]), batch)


@pytest.mark.parametrize("shape", [(9,), (4, 11), (1, 4, 10)])
def test_another_shape_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(InvalidInputError, match="shape"):
        reference_forces(M113, "rigid", np.ones(shape))


def test_a_value_that_is_not_finite_is_refused_by_column() -> None:
    row = np.ones(10)
    row[interface("rigid").index("ay")] = np.nan
    with pytest.raises(InvalidInputError, match=r"\bay\b"):
        reference_forces(M113, "rigid", row)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize(("name", "value"), [("v_left", 0.0), ("v_right", 0.0), ("k", 0.0), ("k", -0.01)])
def test_the_oracle_refuses_what_the_compiled_block_refuses(name: str, value: float) -> None:
    row = np.array([3, 0, 0, 0, 0, 3.0, 3, *RigidTerrain(0.7).parameters])
    row[interface("rigid").index(name)] = value
    with pytest.raises(InvalidInputError):
        PhysicsBackend(M113, "rigid", soft_speed=0.0).forces(row)
    with pytest.raises(InvalidInputError):
        reference_forces(M113, "rigid", row, soft_speed=0.0)


def test_a_negative_soft_speed_is_refused() -> None:
    row = np.array([3, 0, 0, 0, 0, 3.0, 3, *RigidTerrain(0.7).parameters])
    with pytest.raises(InvalidInputError):
        reference_forces(M113, "rigid", row, soft_speed=-0.1)


@pytest.mark.parametrize("cells", [(0, 4), (16, 0), (-1, 4)])
def test_a_grid_without_cells_is_refused(cells: tuple[int, int]) -> None:
    with pytest.raises(InvalidInputError, match="cells"):
        ShearGrid(*cells)


def test_an_unknown_contact_option_is_answered_with_the_nearest() -> None:
    with pytest.raises(ConfigurationError, match="did you mean 'per_wheel'"):
        ShearGrid(contact="per-wheel")  # type: ignore[arg-type]


def test_an_unknown_mode_is_answered_with_the_nearest() -> None:
    with pytest.raises(ConfigurationError, match="did you mean 'rigid'"):
        reference_forces(M113, "ridgid", np.ones(10))  # type: ignore[arg-type]
