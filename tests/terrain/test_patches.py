"""Vehicles on separate contact patches: geometry, refusals, and the block against the naive cell loop."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grouser.terrain import (
    MODES,
    NUMPY,
    SHEAR_PATHS,
    ConfigurationError,
    ExactBackend,
    FloatArray,
    InvalidInputError,
    Mode,
    PhysicsBackend,
    ShearGrid,
    ShearPath,
    TrackedVehicle,
    block_forces,
    casadi_namespace,
    make_backend,
    reference_forces,
    torch_namespace,
)
from grouser.terrain.block import shear_strength

M113 = TrackedVehicle.preset("m113")
#: Two wheels a side, 1.1 m apart, the CG 0.1 m ahead of the middle.
WHEELED = replace(
    M113, name="wheeled", road_wheels=2, contact_length=1.4, patch_length=0.3, contact="per_wheel", cg_offset=0.1
)
BACKENDS: dict[ShearPath, str] = {"soft": "physics", "exact": "exact"}
#: Three patches with gaps of a quarter of a metre.
SHORT = replace(M113, name="short", road_wheels=3, contact_length=2.0, patch_length=0.5, contact="per_wheel")
# Float64 implementations of the same sums: the design promises 1e-9 of the output's standard deviation.
PARITY = 1e-9

States = Callable[..., FloatArray]
every_mode = pytest.mark.parametrize("mode", MODES)
every_path = pytest.mark.parametrize("path", SHEAR_PATHS)
every_vehicle = pytest.mark.parametrize("vehicle", [WHEELED, SHORT], ids=lambda vehicle: vehicle.name)


def assert_parity(actual: FloatArray, expected: FloatArray) -> None:
    np.testing.assert_array_less(np.abs(actual - expected) / expected.std(axis=0), PARITY)


# Geometry


def test_two_patches_lie_at_the_ends_of_the_contact_length() -> None:
    assert WHEELED.element_length == 0.3
    assert WHEELED.element_spacing == pytest.approx(1.1, rel=1e-15)
    np.testing.assert_allclose(WHEELED.element_centers, [-0.65, 0.45], rtol=1e-14)


@given(st.integers(2, 12), st.floats(0.1, 5.0), st.floats(0.01, 1.0), st.floats(-0.49, 0.49))
def test_patches_fill_the_contact_length_from_end_to_end_at_equal_distances(
    count: int, length: float, filled: float, offset: float
) -> None:
    patch = filled * length / count
    v = replace(
        M113,
        road_wheels=count,
        contact_length=length,
        patch_length=patch,
        contact="per_wheel",
        cg_offset=offset * length,
    )
    centers = v.element_centers
    assert centers.shape == (count,)
    assert centers[0] - patch / 2 == pytest.approx(-length / 2 - v.cg_offset, abs=1e-12)
    assert centers[-1] + patch / 2 == pytest.approx(length / 2 - v.cg_offset, abs=1e-12)
    np.testing.assert_allclose(np.diff(centers), v.element_spacing, rtol=0, atol=1e-12)
    assert v.element_spacing >= patch * (1 - 1e-12)


def test_without_a_patch_length_the_elements_meet() -> None:
    assert M113.element_length == M113.element_spacing == 2.667 / 5
    assert np.all(np.abs(np.diff(M113.element_centers) - 2.667 / 5) < 1e-15)


def test_the_wheeled_preset_stands_on_its_axles() -> None:
    warthog = TrackedVehicle.preset("warthog")
    assert warthog.contact == "per_wheel"
    # The axles of the description, 0.457367 m before and behind the middle.
    np.testing.assert_allclose(warthog.element_centers, [-0.457367, 0.457367], rtol=1e-12)
    assert warthog.element_length == 0.25


@pytest.mark.parametrize("length", [0.0, -0.1, 0.71, 1.4, float("nan"), float("inf"), "0.3", True])
def test_a_patch_is_longer_than_nothing_and_at_most_an_equal_part(length: Any) -> None:
    with pytest.raises(InvalidInputError, match=r"patch_length must lie in \(0, 0\.7\]"):
        replace(WHEELED, patch_length=length)


def test_patches_that_meet_are_no_gaps() -> None:
    closed = replace(M113, patch_length=M113.contact_length / 5)
    assert closed.contact == "continuous"
    assert closed.same_block(M113)
    row = np.array([3, 0.2, 0.3, 1, 2, 2.5, 3.8, 0.7, 0.05, 0.05])
    expected = PhysicsBackend(M113, "rigid").forces(row)
    np.testing.assert_allclose(PhysicsBackend(closed, "rigid").forces(row), expected, rtol=1e-12)


# Contact


def test_continuous_contact_over_gaps_is_refused_wherever_it_is_asked_for() -> None:
    gaps = "2 patches of 0.3 m leave gaps in a contact length of 1.4 m; use contact 'per_wheel'"
    with pytest.raises(InvalidInputError, match=gaps):
        replace(WHEELED, contact="continuous")
    row = np.array([3, 0.2, 0.3, 1, 2, 2.5, 3.8, 0.7, 0.05, 0.05])
    for kind in (PhysicsBackend, ExactBackend):
        with pytest.raises(InvalidInputError, match=gaps):
            kind(WHEELED, "rigid", contact="continuous")
    with pytest.raises(InvalidInputError, match=gaps):
        make_backend("physics", mode="soil", vehicle=WHEELED, contact="continuous")
    with pytest.raises(InvalidInputError, match=gaps):
        reference_forces(WHEELED, "rigid", row, grid=ShearGrid())


def test_an_unknown_contact_option_is_answered_with_the_nearest() -> None:
    with pytest.raises(ConfigurationError, match="unknown contact option 'per-wheel'; did you mean 'per_wheel'"):
        replace(M113, contact="per-wheel")  # type: ignore[arg-type]


def test_a_backend_takes_the_vehicles_contact_option_unless_told() -> None:
    wheels = replace(M113, contact="per_wheel")
    for kind in (PhysicsBackend, ExactBackend):
        assert kind(wheels, "rigid").describe()["contact"] == "per_wheel"
        assert kind(wheels, "rigid", contact="continuous").describe()["contact"] == "continuous"
    row = np.array([3, 0.2, 0.3, 1, 2, 2.5, 3.8, 0.7, 0.05, 0.05])
    by_vehicle, by_option = reference_forces(wheels, "rigid", row), PhysicsBackend(M113, "rigid", contact="per_wheel")
    np.testing.assert_allclose(by_vehicle, by_option.forces(row), rtol=1e-11)


# The block on patches


@every_path
@every_mode
@every_vehicle
def test_the_block_does_what_the_specification_says(
    vehicle: TrackedVehicle, mode: Mode, path: ShearPath, states: States, naive: States
) -> None:
    x = states(vehicle, mode, 60)
    expected = naive(vehicle, mode, x, along=3, across=2, contact="per_wheel", soft_speed=0.1, path=path)
    assert_parity(reference_forces(vehicle, mode, x, grid=ShearGrid(3, 2, "per_wheel", path)), expected)
    assert_parity(make_backend(BACKENDS[path], mode=mode, vehicle=vehicle, cells=(3, 2)).forces(x), expected)


@every_path
@every_mode
def test_casadi_and_torch_evaluate_the_same_block(mode: Mode, path: ShearPath, states: States) -> None:
    casadi, torch = pytest.importorskip("casadi"), pytest.importorskip("torch")
    x = states(WHEELED, mode, 60)
    grid = ShearGrid(3, 2, "per_wheel", path)
    expected = reference_forces(WHEELED, mode, x, grid=grid)
    symbol = casadi.MX.sym("x", x.shape[1])
    function = casadi.Function("block", [symbol], [block_forces(casadi_namespace(), WHEELED, mode, symbol, grid=grid)])
    assert_parity(np.array(function.map(len(x))(x.T)).T, expected)
    assert_parity(block_forces(torch_namespace(), WHEELED, mode, torch.from_numpy(x), grid=grid).numpy(), expected)


def test_a_load_presses_on_the_patch_alone() -> None:
    pressure = 1e4 / (0.3 * 0.38)
    assert float(shear_strength(NUMPY, WHEELED, "rigid", [0.7, 0.0, 0.05], 1e4)) == pytest.approx(0.7 * pressure)


def test_cohesion_holds_by_the_area_of_the_patches() -> None:
    # Locked and sliding sideways fast: c A + W tan(phi), A four patches of 0.3 m by 0.38 m.
    row = np.array([0.0, 10.0, 0, 0, 0, 0, 0, 5e3, 0.3, 0.0, 0.005])
    expected = 5e3 * 4 * 0.3 * 0.38 + WHEELED.weight * np.tan(0.3)
    assert PhysicsBackend(WHEELED, "soil").forces(row)[1] == pytest.approx(-expected, rel=1e-9)


def test_a_wide_stance_resists_turning_with_the_arm_of_its_axles() -> None:
    # Pivot on the spot, locked wheels, saturated: mu W/4 a patch at its distance from the CG.
    v = replace(WHEELED, cg_offset=0.0, patch_length=0.001, track_width=0.001)
    row = np.array([0.0, 0.0, 3.0, 0, 0, 0, 0, 0.7, 0.0, 0.001])
    arm = np.hypot((1.4 - 0.001) / 2, v.tread / 2)
    moment = PhysicsBackend(v, "rigid", soft_speed=0.001).forces(row)[2]
    # The patch is a point to 1e-6 of its arm, and the shear is saturated: z = |v_s| d/(V_eps K) is about 2000.
    assert moment == pytest.approx(-0.7 * v.weight * arm, rel=1e-6)


# One block or another


@pytest.mark.parametrize(
    "changes", [{"patch_length": 0.31}, {"patch_length": None}, {"contact_length": 1.41}], ids=lambda c: next(iter(c))
)
def test_other_patches_are_another_block(changes: dict[str, Any]) -> None:
    other = replace(WHEELED, **changes)
    assert not other.same_block(WHEELED)
    assert not WHEELED.same_block(other)
    with pytest.raises(ConfigurationError, match="wheeled"):
        make_backend(PhysicsBackend(WHEELED, "rigid"), mode="rigid", vehicle=other)


def test_another_contact_option_is_another_block() -> None:
    assert not replace(M113, contact="per_wheel").same_block(M113)


def test_the_drive_is_no_part_of_the_block() -> None:
    assert replace(WHEELED, belt_acceleration=1.0, maximum_speed=10.0, yaw_inertia=1.0).same_block(WHEELED)


@pytest.mark.parametrize("vehicle", [WHEELED, M113], ids=["patches", "none"])
def test_patches_survive_the_dictionary(vehicle: TrackedVehicle) -> None:
    assert TrackedVehicle.from_dict(vehicle.to_dict()) == vehicle
    assert vehicle.to_dict()["patch_length"] == vehicle.patch_length
