"""The interface log tells the truth: what the block received, what it returned, what that did to the vehicle."""

import itertools
import json
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from grounds import stepped

from grouser.envs import INTEGRATORS, STATE_NAMES, Integrator, InterfaceLog, Simulator, VehicleState, rollout
from grouser.surrogate import Surrogate
from grouser.terrain import (
    OUTPUT_NAMES,
    ConfigurationError,
    FloatArray,
    ForceBackend,
    GuardedBackend,
    Mode,
    PhysicsBackend,
    Terrain,
    TrackedVehicle,
    make_backend,
    named,
)

M113 = TrackedVehicle.preset("m113")
GROUNDS: dict[str, Terrain] = {"rigid": named("asphalt"), "soil": named("lete-sand")}
every_ground = pytest.mark.parametrize("mode", ["rigid", "soil"])
every_integrator = pytest.mark.parametrize("integrator", INTEGRATORS)


def belts(time: float) -> tuple[float, float]:
    """A start, a slalom, a pivot turn and a stop."""
    if time < 2.0:
        return 4.0, 4.0 + 2.0 * math.sin(4.0 * time)
    return (3.0, -3.0) if time < 2.7 else (0.0, 0.0)


@pytest.fixture
def drive(scripted: Any) -> Callable[..., InterfaceLog]:
    def make(mode: Mode = "rigid", backend: str | ForceBackend = "physics", **options: Any) -> InterfaceLog:
        simulator = Simulator(M113, backend, options.pop("ground", GROUNDS[mode]), **options)
        return rollout(simulator, scripted(belts), 3.5)

    return make


Drive = Callable[..., InterfaceLog]


def same_bits(a: FloatArray, b: FloatArray) -> bool:
    """Whether two arrays are equal bit by bit; a comparison whose failure pytest does not explain byte by byte."""
    return a.shape == b.shape and a.tobytes() == b.tobytes()


@every_ground
def test_shapes_columns_and_types(drive: Drive, mode: Mode) -> None:
    log = drive(mode)
    assert len(log) == 350
    assert log.mode == log.interface.mode == mode
    assert log.inputs.shape == (350, {"rigid": 10, "soil": 11}[mode])
    assert log.forces.shape == (350, len(OUTPUT_NAMES))
    assert log.states.shape == (351, len(STATE_NAMES)) == (351, 11)
    assert log.commands.shape == (350, 2)
    assert log.divisions.shape == log.ood_score.shape == log.fallback_weight.shape == (350,)
    arrays = (log.inputs, log.forces, log.states, log.commands, log.ood_score, log.fallback_weight)
    assert {array.dtype for array in arrays} == {np.dtype(np.float64)}
    assert np.issubdtype(log.divisions.dtype, np.integer)


@every_ground
@every_integrator
def test_the_forces_are_those_of_the_inputs_bit_by_bit(drive: Drive, mode: Mode, integrator: Integrator) -> None:
    log, block = drive(mode, integrator=integrator), PhysicsBackend(M113, mode)
    assert np.abs(log.forces).max(axis=0) == pytest.approx([5e4, 5e4, 5e4], rel=0.9)
    one_by_one = np.array([block.forces(row) for row in log.inputs])
    assert same_bits(one_by_one, log.forces)
    assert same_bits(block.forces(log.inputs), log.forces)
    assert same_bits(block.forces_and_jacobian(log.inputs)[0], log.forces)


@pytest.mark.parametrize("name", ["native", "torch"])
def test_the_forces_are_those_of_the_inputs_with_a_network(
    drive: Drive, make_surrogate: Callable[[Mode], Surrogate], name: str
) -> None:
    backend = make_backend(name, mode="rigid", artifact=make_surrogate("rigid"))
    log = drive("rigid", backend)
    scale = np.abs(log.forces).max(axis=0)
    one_by_one = np.array([backend.forces(row) for row in log.inputs])
    np.testing.assert_allclose(one_by_one / scale, log.forces / scale, rtol=0, atol=5e-6)


def test_the_forces_are_the_blend_that_a_guard_logged(
    drive: Drive, make_surrogate: Callable[[Mode], Surrogate]
) -> None:
    backend = make_backend("guarded", mode="rigid", artifact=make_surrogate("rigid"))
    assert isinstance(backend, GuardedBackend)
    log = drive("rigid", backend)
    for row, forces, weight in zip(log.inputs, log.forces, log.fallback_weight, strict=True):
        np.testing.assert_array_equal(backend.blended_forces_and_jacobian(row, float(weight))[0], forces)
    assert np.isfinite(log.ood_score).all()
    assert log.fallback_rate == np.mean(log.fallback_weight > 0)


@every_ground
@pytest.mark.parametrize("name", ["physics", "native", "guarded"])
def test_the_forces_moved_the_vehicle(
    drive: Drive, make_surrogate: Callable[[Mode], Surrogate], mode: Mode, name: str
) -> None:
    """m(ΔVx/h − ω⁺Vy⁺) = Qx, m(ΔVy/h + ω⁺Vx⁺) = Qy, Iz Δω/h = Mz, to the solver's 1e-11 m/s.

    A network in float32 does not resolve more than a few of its own roundings.
    """
    options: dict[str, Any] = {} if name == "physics" else {"artifact": make_surrogate(mode)}
    log, h = drive(mode, make_backend(name, mode=mode, **options)), 0.01
    tolerance = 1e-11 if name == "physics" else 1e-6
    whole = log.divisions == 1
    assert whole.mean() > 0.99
    vx, vy, yaw_rate = (log.state(name) for name in ("vx", "vy", "yaw_rate"))
    residual = np.column_stack(
        [
            np.diff(vx) / h - yaw_rate[1:] * vy[1:] - log.forces[:, 0] / M113.mass,
            np.diff(vy) / h + yaw_rate[1:] * vx[1:] - log.forces[:, 1] / M113.mass,
            np.diff(yaw_rate) / h - log.forces[:, 2] / M113.yaw_inertia,
        ]
    )
    assert np.abs(residual[whole]).sum(axis=1).max() <= 1.01 * tolerance / h


@every_ground
def test_the_forces_moved_the_vehicle_with_explicit_euler(drive: Drive, mode: Mode) -> None:
    log, h = drive(mode, integrator="euler"), 0.01
    vx, vy, yaw_rate = (log.state(name) for name in ("vx", "vy", "yaw_rate"))
    residual = np.column_stack(
        [
            np.diff(vx) / h - yaw_rate[:-1] * vy[:-1] - log.forces[:, 0] / M113.mass,
            np.diff(vy) / h + yaw_rate[:-1] * vx[:-1] - log.forces[:, 1] / M113.mass,
            np.diff(yaw_rate) / h - log.forces[:, 2] / M113.yaw_inertia,
        ]
    )
    assert np.abs(residual).max() <= 1e-11


@every_ground
@every_integrator
def test_accelerations_are_those_of_the_previous_tick(drive: Drive, mode: Mode, integrator: Integrator) -> None:
    log = drive(mode, integrator=integrator)
    acceleration = log.forces[:, :2] / M113.mass
    assert same_bits(log.inputs[1:, 3:5], acceleration[:-1])
    assert log.inputs[0, 3:5].tolist() == [0.0, 0.0]
    # In a transient, that is not the acceleration of the same tick: this is where a missing delay would show.
    transient = np.abs(acceleration - log.inputs[:, 3:5]).max(axis=1)
    assert np.mean(transient > 1e-3) > 0.5
    assert transient.max() > 0.1
    # The state's memory after a tick is that tick's.
    memory = np.column_stack([log.state("ax"), log.state("ay")])
    assert same_bits(memory[1:], acceleration)
    assert same_bits(log.inputs[:, 3:5], memory[:-1])


@every_ground
@every_integrator
def test_the_body_is_that_of_the_ticks_end_or_with_euler_of_its_start(
    drive: Drive, mode: Mode, integrator: Integrator
) -> None:
    log = drive(mode, integrator=integrator)
    body = log.states[:, 3:6]
    expected = body[:-1] if integrator == "euler" else body[1:]
    assert same_bits(log.inputs[:, :3], expected)


@every_integrator
def test_the_belts_are_those_half_a_tick_on_or_with_euler_at_the_start(drive: Drive, integrator: Integrator) -> None:
    log = drive(integrator=integrator)
    before, after = log.states[:-1, 6:8], log.states[1:, 6:8]
    logged = log.inputs[:, 5:7]
    if integrator == "euler":
        np.testing.assert_array_equal(logged, before)
        return
    # dV/dt = clip((u − V)/T_d, ±a), written out once more.
    gap = log.commands - before
    ramp = np.abs(gap) > 4.0 * 0.2 + 4.0 * 0.005
    lag = np.abs(gap) <= 4.0 * 0.2
    assert min(ramp.mean(), lag.mean()) > 0.1
    np.testing.assert_allclose(logged[ramp], (before + np.sign(gap) * 4.0 * 0.005)[ramp], rtol=0, atol=1e-14)
    np.testing.assert_allclose(logged[lag], (log.commands - gap * math.exp(-0.005 / 0.2))[lag], rtol=0, atol=1e-14)
    moving = np.abs(after - before) > 1e-9
    assert ((logged - before) * (after - logged) > 0)[moving].all()


@every_ground
def test_theta_is_that_under_the_vehicle_at_the_start_of_the_tick(drive: Drive, mode: Mode) -> None:
    before, beyond = GROUNDS[mode], named({"rigid": "ice", "soil": "snow-us"}[mode])
    log = drive(mode, ground=stepped(before, beyond, 1.0))
    expected = np.where((log.state("x")[:-1] < 1.0)[:, None], before.parameters, beyond.parameters)
    np.testing.assert_array_equal(log.inputs[:, 7:], expected)
    assert len(np.unique(log.inputs[:, 7:], axis=0)) == 2


def test_states_follow_their_names(drive: Drive, scripted: Any) -> None:
    simulator = Simulator(M113, "physics", GROUNDS["rigid"], state=VehicleState.rolling(2.0, x=1.0, y=2.0, heading=0.5))
    initial = simulator.get_state()
    log = rollout(simulator, scripted(belts), 0.5)
    for index, state in ((0, initial), (-1, simulator.get_state())):
        for name in STATE_NAMES:
            assert log.state(name)[index] == getattr(state, name)
    assert log.state("time") == pytest.approx(np.arange(51) * 0.01, abs=1e-12)
    held = np.array([belts(time) for time in np.repeat(np.arange(5) * 0.1, 10)])
    assert log.commands == pytest.approx(held, abs=1e-6)


def test_an_unknown_state_name_is_refused_with_the_nearest(drive: Drive) -> None:
    with pytest.raises(ConfigurationError, match="did you mean 'yaw_rate'"):
        drive().state("yawrate")


@every_ground
def test_without_a_guard_scores_are_nan_and_weights_zero(drive: Drive, mode: Mode) -> None:
    log = drive(mode)
    assert np.isnan(log.ood_score).all()
    assert not log.fallback_weight.any()
    assert (log.switches, log.fallback_rate) == (0, 0.0)


@every_integrator
def test_meta_holds_what_is_needed_to_repeat_the_drive(drive: Drive, integrator: Integrator) -> None:
    meta = json.loads(json.dumps(drive(integrator=integrator).meta))
    assert TrackedVehicle.from_dict(meta["vehicle"]) == M113
    assert (meta["tick"], meta["integrator"]) == (0.01, integrator)
    assert meta["backend"] == json.loads(json.dumps(PhysicsBackend(M113, "rigid").describe()))


@pytest.mark.usefixtures("newton_alone")
def test_divided_ticks_are_marked(viscous: Callable[..., ForceBackend], scripted: Any) -> None:
    """Their inputs and forces are those of the last part, so that only ``divisions == 1`` rows balance."""
    backend = viscous(rate=30.0, jacobian_scale=0.0)
    simulator = Simulator(M113, backend, GROUNDS["rigid"], state=VehicleState(vx=1.0))
    log = rollout(simulator, scripted(lambda _: (0.0, 0.0)), 0.2, control_period=0.1)
    assert log.divisions[0] == 8
    np.testing.assert_array_equal(backend.forces(log.inputs), log.forces)
    change = np.diff(log.state("vx")) / 0.01
    for divided, actual, logged in zip(log.divisions > 1, change, log.forces[:, 0] / M113.mass, strict=True):
        assert (abs(actual - logged) > 1e-7) == divided
    assert all(a >= b for a, b in itertools.pairwise(log.divisions.tolist()))
