"""The compiled physics backend: parity with the oracle, analytic Jacobian, tracks, threads, copies, inputs."""

import json
import math
import pickle
from array import array
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from grouser.terrain import (
    CONTACTS,
    MODES,
    ConfigurationError,
    Contact,
    FloatArray,
    InvalidInputError,
    Mode,
    PhysicsBackend,
    ShearGrid,
    TrackedVehicle,
    assemble,
    block_forces,
    casadi_namespace,
    interface,
    reference_forces,
    torch_namespace,
)

M113 = TrackedVehicle.preset("m113")
ROW = np.array([3, 0.2, 0.3, 1, 2, 2.5, 3.8, 0.7, 0.05, 0.05])

States = Callable[..., FloatArray]


def away_from_kinks(vehicle: TrackedVehicle, x: FloatArray) -> FloatArray:
    """Rows clear of the clips of the loads, and of zero slip, through which the slope itself has a corner."""
    slips = x[:, :1] - x[:, 2:3] * vehicle.tread / 2 * np.array([1, -1]) - x[:, 5:7]
    sliding = np.abs(slips).min(axis=1) > 0.05 + np.abs(x[:, 2]) * vehicle.track_width / 2
    return np.asarray(x[sliding & (np.abs(x[:, 3]) < 3.0) & (np.abs(x[:, 4]) < 5.0)])


# Parity


@pytest.mark.parametrize("contact", CONTACTS)
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("cells", [(2, 1), (16, 4), (7, 3)])
def test_compiled_forces_are_the_oracles(
    vehicle: TrackedVehicle, mode: Mode, contact: Contact, cells: tuple[int, int], states: States
) -> None:
    x = states(vehicle, mode, 500, seed=1)
    expected = reference_forces(vehicle, mode, x, grid=ShearGrid(*cells, contact))
    actual = PhysicsBackend(vehicle, mode, cells=cells, contact=contact).forces(x)
    assert np.max(np.abs(actual - expected) / expected.std(axis=0)) < 1e-9  # the promise of the design


def test_defaults_are_sixteen_by_four_continuous_at_the_vehicles_soft_speed(states: States) -> None:
    v = TrackedVehicle.preset("maxxii")
    x = states(v, "soil", 20)
    spelled_out = PhysicsBackend(v, "soil", cells=(16, 4), contact="continuous", soft_speed=0.01)
    np.testing.assert_array_equal(PhysicsBackend(v, "soil").forces(x), spelled_out.forces(x))


# Jacobian


@pytest.mark.parametrize("contact", CONTACTS)
@pytest.mark.parametrize("mode", MODES)
def test_the_analytic_jacobian_is_the_derivative_of_the_casadi_expression(
    vehicle: TrackedVehicle, mode: Mode, contact: Contact, states: States
) -> None:
    casadi = pytest.importorskip("casadi")
    x = states(vehicle, mode, 120, seed=2)
    symbol = casadi.MX.sym("x", x.shape[1])
    force = block_forces(casadi_namespace(), vehicle, mode, symbol, grid=ShearGrid(3, 2, contact))
    function = casadi.Function("jacobian", [symbol], [casadi.jacobian(force, symbol)])
    expected = np.array([function(row) for row in x])
    _, jacobian = PhysicsBackend(vehicle, mode, cells=(3, 2), contact=contact).forces_and_jacobian(x)
    scale = np.abs(expected).max(axis=0)
    # Both are exact derivatives: round-off only, larger than that of the forces by the quotients in them.
    assert np.max(np.abs(jacobian - expected) / (scale + 1e-12 * scale.max())) < 1e-8


@pytest.mark.parametrize("velocity", [0.0, 3.0])
def test_without_any_slip_casadi_and_torch_differentiate_the_block_as_c_does(velocity: float) -> None:
    casadi, torch = pytest.importorskip("casadi"), pytest.importorskip("torch")
    row = np.array([velocity, 0, 0, 1.0, 2.0, velocity, velocity, 0.7, 0.05, 0.05])
    grid = ShearGrid(4, 2)
    _, expected = PhysicsBackend(M113, "rigid", cells=(4, 2)).forces_and_jacobian(row)
    symbol = casadi.MX.sym("x", 10)
    force = block_forces(casadi_namespace(), M113, "rigid", symbol, grid=grid)
    by_casadi = np.array(casadi.Function("jacobian", [symbol], [casadi.jacobian(force, symbol)])(row))
    by_torch = torch.autograd.functional.jacobian(
        lambda x: block_forces(torch_namespace(), M113, "rigid", x, grid=grid), torch.from_numpy(row)
    ).numpy()
    tolerance = 1e-12 * np.abs(expected).max()  # round-off of the largest entries
    np.testing.assert_allclose(by_casadi, expected, rtol=1e-9, atol=tolerance)
    np.testing.assert_allclose(by_torch, expected, rtol=1e-9, atol=tolerance)


@pytest.mark.parametrize("contact", CONTACTS)
@pytest.mark.parametrize("mode", MODES)
def test_every_column_of_the_jacobian_is_the_slope_of_the_oracle(mode: Mode, contact: Contact, states: States) -> None:
    x = away_from_kinks(M113, states(M113, mode, 400, seed=3))
    assert len(x) > 100
    grid = ShearGrid(3, 2, contact)
    _, jacobian = PhysicsBackend(M113, mode, cells=(3, 2), contact=contact).forces_and_jacobian(x)

    def oracle(shifted: FloatArray) -> FloatArray:
        return reference_forces(M113, mode, shifted, grid=grid)

    for i in range(x.shape[1]):
        step = np.zeros(x.shape[1])
        step[i] = 1e-5 * min(np.abs(x[:, i]).max(), 10 * x[:, i].std())

        def slope(width: float, step: FloatArray = step, i: int = i) -> FloatArray:
            return np.asarray((oracle(x + width * step) - oracle(x - width * step)) / (2 * width * step[i]))

        richardson = (4 * slope(0.5) - slope(1.0)) / 3  # truncation of fourth order, so that round-off remains
        scale = np.abs(jacobian[:, :, i]).max(axis=0)
        error = np.abs(jacobian[:, :, i] - richardson) / np.maximum(scale, 1e-9 * scale.max())
        assert error.max() < 1e-8, interface(mode).names[i]  # eps W over the step, over the least scale


def test_at_standstill_the_jacobian_is_the_viscous_hold() -> None:
    row = np.array([0, 0, 0, 0, 0, 0, 0, 1.0, 0.0, 0.005])
    forces, jacobian = PhysicsBackend(M113, "rigid").forces_and_jacobian(row)
    hold = -1.0 * M113.weight * 2.667 / (2 * 0.005 * 0.1)  # -mu W L/(2 K V_eps)
    np.testing.assert_array_equal(forces, np.zeros(3))
    assert (jacobian[0, 0], jacobian[1, 1]) == pytest.approx((hold, hold), rel=1e-12)
    assert jacobian[0, 0] / M113.mass == pytest.approx(-2.6e4, rel=0.01)  # as printed
    assert (jacobian[0, 5], jacobian[0, 6]) == pytest.approx((-hold / 2, -hold / 2), rel=1e-12)


@pytest.mark.parametrize("mode", MODES)
def test_rolling_without_slip_has_a_finite_jacobian(mode: Mode) -> None:
    theta = [0.7, 0.0, 0.05] if mode == "rigid" else [2e3, 0.5, 0.0, 0.05]
    _, jacobian = PhysicsBackend(M113, mode, soft_speed=0.0).forces_and_jacobian(
        np.array([3.0, 0, 0, 0, 0, 3, 3, *theta])
    )
    strength = 0.7 * M113.weight if mode == "rigid" else 2e3 * 2 * 0.38 * 2.667 + M113.weight * math.tan(0.5)
    stiffness = strength * 2.667 / 2 / (3.0 * 0.05)  # mean distance L/2, over Vt K
    assert jacobian[0, 0] == pytest.approx(-stiffness, rel=1e-12)
    assert np.all(np.isfinite(jacobian))


@pytest.mark.parametrize("mode", MODES)
def test_the_jacobian_comes_with_the_same_forces(mode: Mode, states: States) -> None:
    x = states(M113, mode, 100)
    block = PhysicsBackend(M113, mode)
    forces, jacobian = block.forces_and_jacobian(x)
    np.testing.assert_allclose(forces, block.forces(x), rtol=0, atol=1e-12 * M113.weight)  # round-off of the sums
    assert jacobian.shape == (100, 3, interface(mode).size)
    assert jacobian.dtype == np.float64


def test_with_a_side_lifted_its_belt_does_nothing() -> None:
    row = ROW.copy()
    row[4] = 30.0
    _, jacobian = PhysicsBackend(M113, "rigid").forces_and_jacobian(row)
    np.testing.assert_array_equal(jacobian[:, 5], np.zeros(3))
    np.testing.assert_array_equal(jacobian[:, 4], np.zeros(3))


# Batches, tracks


@pytest.mark.parametrize("mode", MODES)
def test_a_batch_equals_its_rows_to_the_bit(mode: Mode, states: States) -> None:
    x = states(M113, mode, 64)
    block = PhysicsBackend(M113, mode)
    forces, jacobian = block.forces_and_jacobian(x)
    tracks = block.track_forces(x, x)
    np.testing.assert_array_equal(block.forces(x), [block.forces(row) for row in x])
    for i, row in enumerate(x):
        single_forces, single_jacobian = block.forces_and_jacobian(row)
        assert single_forces.shape == (3,)
        np.testing.assert_array_equal(single_forces, forces[i])
        np.testing.assert_array_equal(single_jacobian, jacobian[i])
        np.testing.assert_array_equal(block.track_forces(row[None], row[None])[0], tracks[i])


@pytest.mark.parametrize("mode", MODES)
def test_forces_are_the_assembled_track_forces(vehicle: TrackedVehicle, mode: Mode, states: States) -> None:
    x = states(vehicle, mode, 100)
    block = PhysicsBackend(vehicle, mode)
    tracks = block.track_forces(x, x)
    assert tracks.shape == (100, 2, 3)
    np.testing.assert_array_equal(assemble(tracks), block.forces(x))


def test_each_track_feels_its_own_ground_and_no_other(states: States) -> None:
    x_left, x_right = states(M113, "rigid", 40), states(M113, "rigid", 40)
    x_right[:, 7:] = x_right[::-1, 7:]
    block = PhysicsBackend(M113, "rigid")
    split = block.track_forces(x_left, x_right)
    np.testing.assert_array_equal(split[:, 0], block.track_forces(x_left, x_left)[:, 0])
    np.testing.assert_array_equal(split[:, 1], block.track_forces(x_right, x_right)[:, 1])


def test_split_ground_pulls_toward_the_side_that_holds() -> None:
    ice, asphalt = np.array([3.0, 0, 0, 0, 0, 5, 5, 0.1, 0, 0.02]), np.array([3.0, 0, 0, 0, 0, 5, 5, 0.8, 0, 0.02])
    assert assemble(PhysicsBackend(M113, "rigid").track_forces(ice[None], asphalt[None]))[0, 2] > 0


def test_track_forces_ask_for_as_many_rows_on_either_side(states: States) -> None:
    x = states(M113, "rigid", 4)
    with pytest.raises(InvalidInputError, match="rows"):
        PhysicsBackend(M113, "rigid").track_forces(x, x[:3])


# Threads, copies, description


def test_four_threads_return_the_same_bits(states: States) -> None:
    x = states(M113, "soil", 400)
    block = PhysicsBackend(M113, "soil")
    expected = block.forces_and_jacobian(x)
    with ThreadPoolExecutor(4) as pool:
        for forces, jacobian in pool.map(lambda _: block.forces_and_jacobian(x), range(16)):
            np.testing.assert_array_equal(forces, expected[0])
            np.testing.assert_array_equal(jacobian, expected[1])


def test_a_pickled_backend_is_the_same_backend(states: States) -> None:
    v = replace(M113, name="mine", cg_offset=0.1)
    block = PhysicsBackend(v, "soil", cells=(3, 2), contact="per_wheel", soft_speed=0.2)
    copy = pickle.loads(pickle.dumps(block))
    x = states(v, "soil", 20)
    assert copy.vehicle == v
    assert copy.describe() == block.describe()
    np.testing.assert_array_equal(copy.forces(x), block.forces(x))


def test_the_description_is_json_and_holds_every_option() -> None:
    block = PhysicsBackend(M113, "rigid", cells=(2, 1), contact="per_wheel", soft_speed=0.2)
    assert json.loads(json.dumps(block.describe())) == {
        "backend": "physics",
        "mode": "rigid",
        "vehicle": "m113",
        "cells": [2, 1],
        "contact": "per_wheel",
        "soft_speed": 0.2,
    }


# Inputs


def test_lists_integers_and_strided_arrays_give_the_same_bits() -> None:
    block = PhysicsBackend(M113, "rigid")
    expected = block.forces(ROW)
    wide = np.zeros((3, 20))
    wide[:, ::2] = ROW
    np.testing.assert_array_equal(block.forces(ROW.tolist()), expected)
    np.testing.assert_array_equal(block.forces(wide[:, ::2]), np.tile(expected, (3, 1)))
    np.testing.assert_array_equal(block.forces(np.asfortranarray(np.tile(ROW, (3, 1)))), np.tile(expected, (3, 1)))
    whole: Any = [3, 0, 1, 0, 0, 2, 4, 1, 0, 1]
    np.testing.assert_array_equal(block.forces(whole), block.forces(np.array(whole, float)))


def test_float32_input_is_widened_and_computed_in_float64() -> None:
    block = PhysicsBackend(M113, "rigid")
    narrow: Any = ROW.astype(np.float32)
    forces = block.forces(narrow)
    assert forces.dtype == np.float64
    np.testing.assert_array_equal(forces, block.forces(narrow.astype(np.float64)))


def test_big_endian_and_read_only_input_is_taken() -> None:
    block = PhysicsBackend(M113, "rigid")
    frozen = ROW.copy()
    frozen.flags.writeable = False
    np.testing.assert_array_equal(block.forces(frozen), block.forces(ROW))
    np.testing.assert_array_equal(block.forces(ROW.astype(">f8")), block.forces(ROW))


def test_the_input_is_left_as_it_was() -> None:
    x = ROW.copy()
    PhysicsBackend(M113, "rigid").forces_and_jacobian(x)
    np.testing.assert_array_equal(x, ROW)


def test_no_rows_give_no_forces() -> None:
    block = PhysicsBackend(M113, "rigid")
    nothing = np.empty((0, 10))
    assert block.forces(nothing).shape == (0, 3)
    assert block.forces_and_jacobian(nothing)[1].shape == (0, 3, 10)
    assert block.track_forces(nothing, nothing).shape == (0, 2, 3)


Call = Callable[[PhysicsBackend, Any], Any]
CALLS: dict[str, Call] = {
    "forces": lambda block, x: block.forces(x),
    "forces_and_jacobian": lambda block, x: block.forces_and_jacobian(x),
    "track_forces left": lambda block, x: block.track_forces(x, np.tile(ROW, (np.shape(x)[0], 1))),
    "track_forces right": lambda block, x: block.track_forces(np.tile(ROW, (np.shape(x)[0], 1)), x),
}
every_call = pytest.mark.parametrize("call", CALLS.values(), ids=CALLS.keys())


@every_call
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", interface("rigid").names)
def test_a_value_that_is_not_finite_is_refused_by_column(call: Call, name: str, bad: float) -> None:
    x = np.tile(ROW, (3, 1))
    x[1, interface("rigid").index(name)] = bad
    with pytest.raises(InvalidInputError, match=rf"\b{name}\b"):
        call(PhysicsBackend(M113, "rigid"), x)


@every_call
@pytest.mark.parametrize("k", [0.0, -0.01])
def test_a_shear_modulus_that_is_not_positive_is_refused_with_its_row(call: Call, k: float) -> None:
    x = np.tile(ROW, (3, 1))
    x[1, 9] = k
    with pytest.raises(InvalidInputError, match=r"row 1.*\bk\b"):
        call(PhysicsBackend(M113, "rigid"), x)


@pytest.mark.parametrize("kind", [memoryview, lambda row: row.astype(object), lambda row: array("d", row)])
def test_other_containers_of_numbers_are_converted(kind: Callable[[FloatArray], Any]) -> None:
    block = PhysicsBackend(M113, "rigid")
    np.testing.assert_array_equal(block.forces(kind(ROW)), block.forces(ROW))


@every_call
@pytest.mark.parametrize("shape", [(3, 9), (3, 11), (1, 2, 10), (1, 1, 10), (2, 2, 10)])
def test_another_shape_is_refused(call: Call, shape: tuple[int, ...]) -> None:
    with pytest.raises(InvalidInputError, match="shape"):
        call(PhysicsBackend(M113, "rigid"), np.ones(shape))


@pytest.mark.parametrize("given", [None, 3.0, "row", ["a"] * 10, [[1.0] * 10, [1.0] * 9], object()])
def test_what_is_not_numbers_is_refused(given: Any) -> None:
    with pytest.raises(InvalidInputError):
        PhysicsBackend(M113, "rigid").forces(given)


def test_the_columns_of_the_other_mode_are_refused_by_name() -> None:
    with pytest.raises(InvalidInputError, match=r"soil.*\bphi\b"):
        PhysicsBackend(M113, "soil").forces(ROW)


@pytest.mark.parametrize(
    "options",
    [
        {"cells": (0, 4)},
        {"cells": (16, 0)},
        {"cells": (1.5, 2)},
        {"cells": (16,)},
        {"cells": (10**6, 1)},
        {"soft_speed": -0.1},
        {"soft_speed": math.nan},
    ],
)
def test_impossible_options_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(InvalidInputError, match=r"cells|soft_speed"):
        PhysicsBackend(M113, "rigid", **options)


def test_more_wheels_than_the_compiled_block_holds_are_refused() -> None:
    with pytest.raises(InvalidInputError, match="wheels"):
        PhysicsBackend(replace(M113, road_wheels=65), "rigid")


def test_an_unknown_contact_option_or_mode_is_answered_with_the_nearest() -> None:
    with pytest.raises(ConfigurationError, match="did you mean 'per_wheel'"):
        PhysicsBackend(M113, "rigid", contact="per_wheels")  # type: ignore[arg-type]
    with pytest.raises(ConfigurationError, match="did you mean 'rigid'"):
        PhysicsBackend(M113, "rigit")  # type: ignore[arg-type]
