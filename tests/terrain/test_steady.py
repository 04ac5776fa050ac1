"""Steady motion: balanced, the same to either side, where a simulated vehicle stays, and refused where there is none."""

import math
from dataclasses import replace

import numpy as np
import pytest

from grouser.envs import BeltCommand, Simulator, VehicleState
from grouser.terrain import (
    ForceBackend,
    InvalidInputError,
    PhysicsBackend,
    RigidTerrain,
    ShearGrid,
    SteadyMotion,
    Terrain,
    TrackedVehicle,
    make_backend,
    mirror_forces,
    named,
    reference_forces,
    steady_motion,
    steady_turn,
    straight_thrust,
    tightest_turn,
)
from grouser.terrain.validation import ReferenceBackend

M113 = TrackedVehicle.preset("m113")
W = M113.weight


def block(terrain: Terrain, **options: object) -> ForceBackend:
    return make_backend("physics", mode=terrain.mode, vehicle=M113, **options)


@pytest.mark.parametrize("ground", ["asphalt", "ice", "dry-sand", "heavy-clay-25"])
@pytest.mark.parametrize(("speed", "radius"), [(1.0, 3.0), (3.0, -20.0), (10.0, 200.0)])
def test_forces_are_mass_times_the_centripetal_acceleration(ground: str, speed: float, radius: float) -> None:
    terrain = named(ground)
    turn = steady_turn(block(terrain), terrain, speed, radius)
    vx, vy, omega, ax, ay = turn.row[:5]
    assert math.hypot(vx, vy) == pytest.approx(speed, rel=1e-14)
    assert omega == pytest.approx(speed / radius, rel=1e-12)
    assert (ax, ay) == pytest.approx((-omega * vy, omega * vx), rel=1e-14)
    np.testing.assert_array_equal(turn.row[7:], terrain.parameters)
    independent = reference_forces(M113, terrain.mode, turn.row)
    expected = 11300 * np.array([-omega * vy, omega * vx, 0.0])
    np.testing.assert_allclose(independent, expected, rtol=0, atol=1e-9 * W)
    np.testing.assert_allclose(turn.forces, independent, rtol=0, atol=1e-9 * W)
    assert (turn.v_right - turn.v_left) * radius > 0  # the outer belt is the faster


def test_a_turn_to_the_right_is_the_mirror_image() -> None:
    terrain = named("asphalt")
    left, right = (steady_turn(block(terrain), terrain, 4.0, radius) for radius in (15.0, -15.0))
    np.testing.assert_allclose(block(terrain).interface.mirror(left.row), right.row, rtol=0, atol=1e-9)
    np.testing.assert_allclose(mirror_forces(left.forces), right.forces, rtol=0, atol=1e-9 * W)


def test_the_straight_run_thrusts_against_rolling_resistance() -> None:
    terrain = named("dry-sand")
    run = steady_turn(block(terrain, cells=(256, 1)), terrain, 3.0, math.inf)
    assert run.v_left == pytest.approx(run.v_right, abs=1e-12)
    assert (run.radius, run.yaw_rate) == (math.inf, 0.0)
    resistance = terrain.parameters[2] * W * run.v_left / math.hypot(run.v_left, 0.1)
    assert straight_thrust(M113, terrain, 3.0, run.v_left, 0.1) == pytest.approx(resistance, rel=1e-5)  # cells


@pytest.mark.parametrize(("ratio", "printed"), [(1.0, 0.20073), (2.0, 0.53300)])
@pytest.mark.parametrize("name", ["physics", "exact"])
def test_for_a_vanishing_k_the_slip_is_that_of_steeds_and_merritt(name: str, ratio: float, printed: float) -> None:
    line = replace(M113, track_width=1e-6, tread=2.667 / ratio)
    backend = make_backend(name, mode="rigid", vehicle=line, cells=(800, 1), soft_speed=0.0)
    turn = steady_turn(backend, RigidTerrain(0.7, 0.0, 1e-6), 1e-3, 10.0)
    slips = 2 * np.array(turn.sliding) / (turn.yaw_rate * 2.667)
    np.testing.assert_allclose(slips, [-printed, printed], rtol=0, atol=1e-5)


def test_a_simulated_vehicle_stays_in_the_steady_turn() -> None:
    terrain = named("asphalt")
    turn = steady_turn(block(terrain), terrain, 5.0, 25.0)
    vx, vy, omega, ax, ay, left, right = turn.row[:7]
    start = VehicleState(vx=vx, vy=vy, yaw_rate=omega, ax=ax, ay=ay, v_left=left, v_right=right)
    simulator = Simulator(M113, block(terrain), terrain, state=start)
    for _ in range(100):
        simulator.step(BeltCommand(left, right))
    end = simulator.get_state()
    assert (end.vx, end.vy, end.yaw_rate) == pytest.approx((vx, vy, omega), abs=1e-8)


def test_the_belts_of_a_turn_lead_back_to_it() -> None:
    terrain = named("upland-sandy-loam")
    turn = steady_turn(block(terrain), terrain, 4.0, 12.0)
    again = steady_motion(block(terrain), terrain, turn.v_left, turn.v_right)
    np.testing.assert_allclose(again.row, turn.row, rtol=0, atol=1e-8)
    assert (again.speed, again.radius) == pytest.approx((4.0, 12.0))
    assert again.side_slip == pytest.approx(turn.side_slip)


def test_opposite_belts_pivot_on_the_spot() -> None:
    terrain = named("asphalt")
    pivot = steady_motion(block(terrain), terrain, -2.0, 2.0)
    assert (pivot.vx, pivot.vy) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert 0 < pivot.yaw_rate < 4.0 / M113.tread
    assert pivot.sliding == pytest.approx((-pivot.sliding[1], pivot.sliding[1]))


def test_belts_at_rest_hold_the_vehicle() -> None:
    rest = steady_motion(block(named("asphalt")), named("asphalt"), 0.0, 0.0)
    assert (rest.speed, rest.yaw_rate, rest.curvature) == (0.0, 0.0, 0.0)
    pivot = SteadyMotion(np.array([0, 0, 1.0, 0, 0, -1, 1, 0.7, 0, 0.02]), np.zeros(3), 2.0)
    assert (pivot.curvature, pivot.radius) == (math.inf, 0.0)


def test_a_backend_without_its_own_jacobian_gives_the_same_turn() -> None:
    terrain = named("asphalt")
    oracle = ReferenceBackend(M113, "rigid", ShearGrid(4, 2), 0.1)
    compiled = PhysicsBackend(M113, "rigid", cells=(4, 2))
    numeric, analytic = (steady_turn(backend, terrain, 3.0, 20.0).row for backend in (oracle, compiled))
    np.testing.assert_allclose(numeric, analytic, rtol=0, atol=1e-8)


def test_a_turn_beyond_friction_is_refused_with_the_tightest_there_is() -> None:
    terrain = named("ice")
    with pytest.raises(
        InvalidInputError, match=r"no steady turn of 50 m radius at 10 m/s.*tightest that was found is 12\d"
    ):
        steady_turn(block(terrain), terrain, 10.0, 50.0)


def test_the_exact_path_is_followed_across_the_jumps_of_its_forces() -> None:
    terrain = RigidTerrain(0.7, 0.03, 0.055)
    backend = make_backend("exact", mode="rigid", vehicle=M113)
    with pytest.raises(InvalidInputError, match="no steady turn"):  # a cell passes through zero sliding just there
        steady_turn(backend, terrain, 3.0, 58.0)
    turn = steady_turn(backend, terrain, 3.0, 40.0)
    np.testing.assert_allclose(turn.forces / 11300, [*turn.row[3:5], 0.0], rtol=0, atol=1e-9)


def test_ground_that_resists_more_than_it_holds_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="resists more than it holds"):
        steady_turn(block(named("asphalt")), RigidTerrain(0.1, 0.2, 0.02), 3.0, math.inf)


def test_the_tightest_turn_is_within_friction_and_the_drive() -> None:
    terrain = named("asphalt")
    backend = block(terrain)
    fast = tightest_turn(backend, terrain, 10.0)
    assert 10.0**2 / (0.8 * 9.81) <= fast.radius < 1.2 * 10.0**2 / (0.8 * 9.81)
    slow = tightest_turn(backend, terrain, 1.0)
    assert slow.radius == pytest.approx(1.0)
    assert slow.v_left < 0
    forward = tightest_turn(backend, terrain, 1.0, inner_belt_reverses=False)
    assert forward.v_left == pytest.approx(0.0, abs=1e-3)
    assert forward.radius > slow.radius
    limited = tightest_turn(backend, terrain, 17.5)
    assert limited.v_right == pytest.approx(M113.maximum_speed, abs=1e-2)
    with pytest.raises(InvalidInputError, match="belts at"):
        tightest_turn(backend, terrain, 18.0)


@pytest.mark.parametrize(
    ("ground", "speed"), [("snow-us", 0.9), ("snow-us", 1.05), ("lete-sand", 1.43), ("clayey-soil-55", 0.9)]
)
def test_a_slow_turn_goes_on_beyond_the_rest_of_the_inner_belt(ground: str, speed: float) -> None:
    terrain = named(ground)
    tightest = tightest_turn(block(terrain), terrain, speed)
    forward = tightest_turn(block(terrain), terrain, speed, inner_belt_reverses=False)
    assert tightest.radius == pytest.approx(1.0)
    assert tightest.v_left < -0.5 < 0 <= forward.v_left
    np.testing.assert_allclose(
        reference_forces(M113, "soil", tightest.row), 11300 * np.array([*tightest.row[3:5], 0.0]), rtol=0, atol=1e-9 * W
    )


@pytest.mark.parametrize(("speed", "radius"), [(0.0, 5.0), (-1.0, 5.0), (math.nan, 5.0), (1.0, 0.0), (1.0, math.nan)])
def test_impossible_speeds_and_radii_are_refused(speed: float, radius: float) -> None:
    with pytest.raises(InvalidInputError, match=r"speed|radius"):
        steady_turn(block(named("asphalt")), named("asphalt"), speed, radius)


def test_ground_of_the_other_mode_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="rigid ground, the ground is soil"):
        steady_turn(block(named("asphalt")), named("dry-sand"), 1.0, 5.0)
    with pytest.raises(InvalidInputError, match="rigid ground, the ground is soil"):
        steady_motion(block(named("asphalt")), named("dry-sand"), 1.0, 1.0)


def test_a_belt_must_run_without_soft_speed() -> None:
    terrain = named("asphalt")
    with pytest.raises(InvalidInputError, match="no steady motion"):
        steady_motion(block(terrain, soft_speed=0.0), terrain, 0.0, 2.0)
