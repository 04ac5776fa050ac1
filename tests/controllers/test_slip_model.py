from __future__ import annotations

import casadi
import numpy as np
import pytest

from grouser.controllers import PredictionModel, SlipParameters, identify_slip
from grouser.envs.driveline import advance_belts
from grouser.envs.simulator import Simulator
from grouser.envs.state import BeltCommand, VehicleState
from grouser.terrain import InvalidInputError, TrackedVehicle, named

M113 = TrackedVehicle.preset("m113")


def test_belts_are_the_inverse_of_twist():
    slip = SlipParameters(longitudinal_gain=0.98, yaw_gain=0.7, icr_offset=0.3)
    vx, vy, yaw_rate = slip.twist(*slip.belts(5.0, 0.4, M113.tread), M113.tread)
    assert (vx, vy, yaw_rate) == pytest.approx((5.0, -0.3 * 0.4, 0.4))


def test_icr_ahead_of_the_cg_swings_the_cg_out_of_a_left_turn():
    _, vy, yaw_rate = SlipParameters(icr_offset=0.5).twist(4.0, 6.0, 2.0)
    assert yaw_rate > 0
    assert vy < 0


@pytest.mark.parametrize(
    ("name", "value"), [("yaw_gain", 0.0), ("longitudinal_gain", -1.0), ("icr_offset", np.nan), ("yaw_lag", -0.1)]
)
def test_impossible_parameters_are_refused(name, value):
    with pytest.raises(InvalidInputError, match=name):
        SlipParameters(**{name: value})


@pytest.mark.parametrize("ground", ["asphalt", "lete-sand", "snow-us", "ice"])
def test_identified_gains_are_those_of_a_skid_steer(ground):
    slip = identify_slip(M113, named(ground))
    assert 0.3 < slip.yaw_gain < 1.0
    assert 0.9 < slip.longitudinal_gain < 1.0
    assert 0.0 < slip.yaw_lag < 1.0


def test_identification_is_deterministic():
    assert identify_slip(M113, named("asphalt")) == identify_slip("m113", named("asphalt"))


@pytest.mark.parametrize("ground", ["asphalt", "lete-sand"])
def test_identified_model_reproduces_a_turn_of_the_physics_that_it_was_not_fitted_to(ground):
    slip = identify_slip(M113, named(ground))
    command = BeltCommand(4.8, 5.2)
    simulator = Simulator(M113, "physics", named(ground), state=VehicleState.rolling(5.0))
    model = PredictionModel(M113, slip, 0.1)
    predicted = [0.0, 0.0, 0.0, 0.0, 5.0, 5.0]
    for _ in range(20):
        predicted = model.step(predicted, command)
        for _ in range(10):
            state = simulator.step(command).state
    assert predicted[3] == pytest.approx(state.yaw_rate, rel=0.02)
    assert predicted[2] == pytest.approx(state.heading, rel=0.03)
    assert np.hypot(predicted[0] - state.x, predicted[1] - state.y) < 0.1


@pytest.mark.parametrize("differences", [(), (0.0,), (1.5,)])
def test_impossible_differences_are_refused(differences):
    with pytest.raises(InvalidInputError, match="differences"):
        identify_slip(M113, named("asphalt"), differences=differences)


@pytest.mark.parametrize("lag", [0.0, 0.06, 0.2, 0.6])
def test_casadi_model_equals_its_numpy_twin(lag):
    model = PredictionModel(M113, SlipParameters(0.98, 0.7, 0.3, lag), 0.1)
    state, command = casadi.SX.sym("x", 6), casadi.SX.sym("u", 2)
    stepped = model.step([state[i] for i in range(6)], [command[0], command[1]], casadi)
    symbolic = casadi.Function("step", [state, command], [casadi.vertcat(*stepped)])
    generator = np.random.default_rng(3)
    for _ in range(50):
        x, u = generator.normal(size=6) * 3, generator.normal(size=2) * 5
        numeric = model.step(x.tolist(), u.tolist())
        np.testing.assert_allclose(np.array(symbolic(x, u), dtype=float).ravel(), numeric, rtol=1e-9, atol=1e-9)


def test_predicted_belts_are_those_of_the_driveline_within_its_linear_range():
    model = PredictionModel(M113, SlipParameters(), 0.1)
    predicted = model.step([0.0, 0.0, 0.0, 0.0, 5.0, 5.0], (4.3, 5.7))[4:]
    assert predicted == pytest.approx(advance_belts(M113, (5.0, 5.0), BeltCommand(4.3, 5.7), 0.1), abs=1e-12)


@pytest.mark.parametrize("lag", [0.0, 0.01, 0.2, 0.6])
def test_a_step_agrees_with_many_short_ones_however_short_the_lag(lag):
    slip = SlipParameters(0.98, 0.7, 0.3, lag)
    state = [0.0, 0.0, 0.3, 0.1, 5.0, 5.2]
    once = PredictionModel(M113, slip, 0.1).step(state, (4.6, 5.9))
    short = PredictionModel(M113, slip, 0.1 / 100)
    for _ in range(100):
        state = short.step(state, (4.6, 5.9))
    # Simpson's rule over a yaw rate that jumps within the step is off by some of icr_offset times the jump.
    np.testing.assert_allclose(once, state, atol=2e-3)
    np.testing.assert_allclose(once[2:], state[2:], atol=1e-12)
