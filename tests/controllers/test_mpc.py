from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from grouser.controllers import SOLVERS, MPCConfig, PathTrackingMPC, SlipParameters, identify_slip
from grouser.envs.paths import make_path, straight
from grouser.envs.rollout import rollout
from grouser.envs.simulator import Simulator
from grouser.envs.state import BeltCommand, VehicleState
from grouser.terrain import ConfigurationError, InvalidInputError, TrackedVehicle, named

M113 = TrackedVehicle.preset("m113")
PATH = make_path("iso-3888-1", M113)


@cache
def slip_on(ground):
    return identify_slip(M113, named(ground))


def mpc_on(ground="asphalt", path=PATH, solver=None, **settings):
    return PathTrackingMPC(path, M113, slip_on(ground), MPCConfig(**settings), solver=solver)


def drive(mpc, ground="asphalt", duration=30.0, start=None):
    simulator = Simulator(M113, "physics", named(ground), state=start or VehicleState.rolling(mpc.config.speed))
    return rollout(simulator, mpc, duration, until=lambda state: state.x > PATH.length - 2.0)


def violation(log, spare):
    assert PATH.corridor is not None
    x, y, heading = (log.state(name) for name in ("x", "y", "heading"))
    return PATH.corridor.violations(x, y, heading, M113.contact_length, M113.overall_width + 2 * spare).max()


class Failing:
    """Fails the solves of the given numbers, with a point that must never be applied."""

    def __init__(self, mpc, numbers):
        self.problem, self.numbers, self.count = mpc.problem, numbers, 0

    def __call__(self, parameters, guess):
        solution = self.problem(parameters, guess)
        self.count += 1
        if self.count - 1 in self.numbers:
            wrong = np.full_like(solution.inputs, 9.9)
            return replace(solution, inputs=wrong, success=False, status="Maximum_Iterations_Exceeded")
        return solution


def failing_mpc(numbers, **settings):
    return mpc_on(solver=Failing(mpc_on(**settings), numbers), **settings)


@pytest.mark.parametrize(("ground", "spare"), [("asphalt", 0.2), ("lete-sand", 0.2), ("ice", 0.1)])
def test_iso_lane_change_is_driven_inside_the_corridor_and_every_solve_is_recorded(ground, spare):
    mpc = mpc_on(ground)
    log = drive(mpc, ground)
    assert log.state("x")[-1] > PATH.length - 2.0
    assert violation(log, 0.0) == 0.0
    assert violation(log, spare) == 0.0
    assert len(mpc.records) == math.ceil(len(log) / 10)
    assert [record.time for record in mpc.records] == pytest.approx(log.state("time")[:-1:10])
    for record in mpc.records:
        assert record.success
        assert record.status == "Solve_Succeeded"
        assert record.command == record.first_move
        assert record.fallback_action is None
        assert record.iterations > 0
        assert record.solve_time > 0
    assert mpc.deadline_misses == sum(record.solve_time > mpc.deadline for record in mpc.records)


def test_two_drives_have_equal_bits():
    mpc = mpc_on()
    first, records = drive(mpc, duration=6.0), mpc.records
    second = drive(mpc, duration=6.0)
    third = drive(mpc_on(), duration=6.0)
    assert np.array_equal(first.states, second.states)
    assert np.array_equal(first.states, third.states)
    assert records == mpc.records


@pytest.mark.parametrize("solver", SOLVERS)
def test_every_solver_finds_the_same_move(solver):
    start = VehicleState.rolling(5.0, x=30.0, y=0.3)
    assert _first_move(solver, start) == pytest.approx(_first_move("ipopt", start), abs=1e-3)


def _first_move(solver, start):
    mpc = PathTrackingMPC(PATH, M113, slip_on("asphalt"), MPCConfig(solver=solver))
    command = mpc.command(start)
    assert mpc.records[-1].success
    return command


@pytest.mark.parametrize("solver", SOLVERS)
def test_warm_start_takes_fewer_iterations(solver):
    config = MPCConfig(solver=solver)
    warm = PathTrackingMPC(PATH, M113, slip_on("asphalt"), config)
    log = drive(warm, duration=2.0, start=VehicleState.rolling(5.0, x=25.0))
    cold = PathTrackingMPC(PATH, M113, slip_on("asphalt"), config)
    iterations = []
    for row in log.states[:-1:10]:
        cold.reset()
        cold.command(VehicleState(*row))
        iterations.append(cold.records[-1].iterations)
    assert sum(record.iterations for record in warm.records) < sum(iterations)


def test_returns_to_the_path_from_rest_beside_it():
    path = straight()
    mpc = mpc_on(path=path)
    log = drive(mpc, duration=10.0, start=VehicleState(y=1.5, heading=0.8))
    assert all(record.success for record in mpc.records)
    assert abs(log.state("y")[-1]) < 0.02
    assert log.state("vx")[-1] == pytest.approx(5.0, abs=0.05)


def test_stops_at_the_end_if_asked():
    mpc = mpc_on(path=straight(40.0), stop_at_end=True)
    log = drive(mpc, duration=20.0)
    assert abs(log.state("vx")[-1]) < 0.2
    assert 37.0 < log.state("x")[-1] < 40.5


def test_heading_turns_past_a_lap_do_not_matter():
    start = VehicleState.rolling(5.0, x=30.0, y=0.2, heading=0.1)
    lap = replace(start, heading=start.heading + 4 * math.pi)
    assert mpc_on().command(lap) == pytest.approx(mpc_on().command(start), abs=1e-6)


def test_commands_keep_belt_acceleration_and_training_speed():
    mpc = mpc_on(path=straight(), speed=10.0)
    log = drive(mpc, duration=4.0, start=VehicleState(y=3.0))
    belts = log.states[:-1:10, 6:8]
    swing = M113.belt_acceleration * M113.belt_time_constant
    assert np.abs(log.commands[::10] - belts).max() <= swing + 1e-6
    assert np.abs(log.commands).max() <= M113.training_speed


def test_failed_solve_applies_the_next_move_of_the_last_good_plan():
    mpc = failing_mpc({3, 4}, on_failure="shift")
    plans = []
    solve = mpc._solver

    def watched(parameters, guess):
        solution = solve(parameters, guess)
        plans.append(solution)
        return solution

    mpc._solver = watched
    drive(mpc, duration=0.7, start=VehicleState.rolling(5.0, x=30.0))
    records = mpc.records
    assert [record.fallback_action for record in records] == [None, None, None, "shift", "shift", None, None]
    assert [record.success for record in records] == [True, True, True, False, False, True, True]
    assert records[3].status == "Maximum_Iterations_Exceeded"
    assert records[3].first_move is None
    assert records[3].command == BeltCommand(*plans[2].inputs[1, :2])
    assert records[4].command == BeltCommand(*plans[2].inputs[2, :2])


def test_shifting_ends_after_its_limit_and_then_brakes_to_rest():
    mpc = failing_mpc(set(range(2, 1000)), on_failure="shift", shift_limit=3)
    log = drive(mpc, duration=8.0)
    actions = [record.fallback_action for record in mpc.records]
    assert actions[:6] == [None, None, "shift", "shift", "shift", "brake"]
    assert set(actions[5:]) == {"brake"}
    assert mpc.records[-1].command == BeltCommand(0.0, 0.0)
    assert abs(log.state("vx")[-1]) < 0.05


def test_brake_keeps_the_ratio_of_the_belts_and_the_declared_deceleration():
    mpc = failing_mpc({1, 2}, on_failure="brake", brake_deceleration=2.0)
    drive(mpc, duration=0.3, start=VehicleState.rolling(5.0, x=30.0, y=0.3))
    before, first, second = (record.command for record in mpc.records)
    assert [record.fallback_action for record in mpc.records] == [None, "brake", "brake"]
    assert first.left / first.right == pytest.approx(before.left / before.right)
    assert max(before) - max(first) == pytest.approx(0.2)
    assert max(first) - max(second) == pytest.approx(0.2)


def test_failing_from_the_start_brakes_from_the_belts_that_the_vehicle_has():
    mpc = failing_mpc({0}, on_failure="shift")
    assert mpc.command(VehicleState.rolling(5.0)) == pytest.approx((4.8, 4.8))
    assert mpc.records[0].fallback_action == "brake"


def test_an_unconverged_casadi_iterate_is_not_applied():
    mpc = mpc_on(max_iterations=1)
    mpc.command(VehicleState.rolling(5.0, x=30.0, y=0.5))
    record = mpc.records[0]
    assert not record.success
    assert record.first_move is None
    assert record.fallback_action == "brake"


def test_another_control_period_is_refused():
    mpc = mpc_on()
    simulator = Simulator(M113, "physics", named("asphalt"), state=VehicleState.rolling(5.0))
    with pytest.raises(ConfigurationError, match="same control period"):
        rollout(simulator, mpc, 1.0, control_period=0.2)


@pytest.mark.parametrize(
    ("settings", "error", "message"),
    [
        ({"solver": "ipop"}, ConfigurationError, "ipopt"),
        ({"on_failure": "shft"}, ConfigurationError, "shift"),
        ({"lateral": -1.0}, InvalidInputError, "lateral"),
        ({"shift_limit": 20}, InvalidInputError, "shift_limit"),
    ],
)
def test_impossible_settings_are_refused(settings, error, message):
    with pytest.raises(error, match=message):
        MPCConfig(**settings)


def test_speed_above_training_speed_is_refused():
    with pytest.raises(InvalidInputError, match="speed must lie in"):
        PathTrackingMPC(PATH, M113, SlipParameters(), MPCConfig(speed=11.0))
