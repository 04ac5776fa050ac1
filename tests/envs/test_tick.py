"""One tick of the body: backward Euler, SDIRK2 and explicit Euler by closed forms, Newton, division, divergence."""

import cmath
import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from grouser.envs import INTEGRATORS, BeltCommand, Integrator, Simulator, VehicleState
from grouser.terrain import (
    FloatArray,
    ForceBackend,
    PhysicsBackend,
    RigidTerrain,
    SimulationDivergedError,
    Terrain,
    TrackedVehicle,
    named,
)

Make = Callable[..., ForceBackend]
M113 = TrackedVehicle.preset("m113")
GROUND = RigidTerrain(0.7)
IDLE = BeltCommand(0.0, 0.0)
GAMMA = 1.0 - 1.0 / math.sqrt(2.0)


def amplification(integrator: Integrator, z: complex) -> complex:
    """Stability function of the method: y⁺ = R(z) y for ẏ = λ y, z = hλ."""
    if integrator == "implicit":
        return 1.0 / (1.0 - z)
    if integrator == "sdirk2":
        return (1.0 + (1.0 - 2.0 * GAMMA) * z) / (1.0 - GAMMA * z) ** 2
    return 1.0 + z


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("rate", [0.5, 30.0, 150.0])
def test_straight_decay_under_a_linear_force(viscous: Make, integrator: Integrator, rate: float) -> None:
    simulator = Simulator(
        M113, viscous(rate=rate), GROUND, integrator=integrator, state=VehicleState(vx=3.0, yaw_rate=0.0)
    )
    factor = amplification(integrator, -rate * 0.01).real
    for n in range(1, 8):
        state = simulator.step(IDLE).state
        assert state.vx == pytest.approx(3.0 * factor**n, abs=2e-11 * n)
        assert (state.vy, state.yaw_rate) == (0.0, 0.0)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_decay_in_a_turning_frame(viscous: Make, integrator: Integrator) -> None:
    """With ω constant, Vx + iVy obeys V̇ = −(rate + iω)V: the ω-coupling and its signs."""
    rate, yaw_rate = 2.0, 0.8
    simulator = Simulator(
        M113,
        viscous(rate=rate, yaw_decay=0.0),
        GROUND,
        integrator=integrator,
        state=VehicleState(vx=3.0, vy=-0.5, yaw_rate=yaw_rate),
    )
    factor = amplification(integrator, -(rate + 1j * yaw_rate) * 0.01)
    for n in range(1, 30):
        state = simulator.step(IDLE).state
        expected = (3.0 - 0.5j) * factor**n
        assert (state.vx, state.vy) == pytest.approx((expected.real, expected.imag), abs=2e-11 * n)
        assert state.yaw_rate == pytest.approx(yaw_rate, abs=1e-15)
    exact = (3.0 - 0.5j) * cmath.exp(-(rate + 1j * yaw_rate) * 0.29)
    bound = {"implicit": 0.02, "sdirk2": 2e-5, "euler": 0.02}[integrator]
    assert abs(complex(state.vx, state.vy) - exact) < bound


@pytest.mark.parametrize("terrain", [RigidTerrain(0.7, 0.03, 0.025), named("lete-sand")], ids=["rigid", "soil"])
@pytest.mark.parametrize(("integrator", "order"), [("implicit", 1), ("sdirk2", 2), ("euler", 1)])
def test_order_of_convergence(terrain: Terrain, integrator: Integrator, order: int) -> None:
    """Against Radau, the belts at their commands and the CG on the ground, so that the memory has no say."""
    vehicle = replace(M113, cg_height=0.0)
    backend = PhysicsBackend(vehicle, terrain.mode)
    body, belts, duration = (3.0, 0.2, 0.3), (2.5, 3.8), 0.2
    scale = np.array([vehicle.mass, vehicle.mass, vehicle.yaw_inertia])

    def rates(_: float, y: FloatArray) -> FloatArray:
        q = backend.forces(np.array([*y, 0.0, 0.0, *belts, *terrain.parameters])) / scale
        total: FloatArray = q + np.array([y[2] * y[1], -y[2] * y[0], 0.0])
        return total

    exact = solve_ivp(rates, (0.0, duration), body, method="Radau", rtol=1e-10, atol=1e-12).y[:, -1]
    errors = []
    for ticks in (80, 160, 320, 640):
        start = VehicleState(vx=body[0], vy=body[1], yaw_rate=body[2], v_left=belts[0], v_right=belts[1])
        simulator = Simulator(vehicle, backend, terrain, tick=duration / ticks, integrator=integrator, state=start)
        for _ in range(ticks):
            state = simulator.step(BeltCommand(*belts)).state
        errors.append(float(np.linalg.norm(np.array([state.vx, state.vy, state.yaw_rate]) - exact)))
    observed = np.log2(np.array(errors[:-1]) / errors[1:])
    assert observed[-1] == pytest.approx(order, abs=0.15)
    assert observed == pytest.approx(order, abs=0.4)
    assert errors[-1] < {1: 2e-3, 2: 2e-5}[order]


@pytest.mark.parametrize("terrain", [RigidTerrain(1.0, 0.03, 0.005), named("snow-us")], ids=["rigid", "soil"])
def test_a_tick_is_solved_to_tolerance_in_a_few_steps(terrain: Terrain, weave: Any) -> None:
    simulator = Simulator(M113, "physics", terrain)
    states = [simulator.get_state()]
    _, records = weave(simulator, 400)
    states += [record.state for record in records]
    h, m, inertia = 0.01, M113.mass, M113.yaw_inertia
    for (a, b), record in zip(itertools.pairwise(states), records, strict=True):
        if record.divisions > 1:
            continue
        qx, qy, mz = record.forces.tolist()
        residual = (
            b.vx - a.vx - h * (qx / m + b.yaw_rate * b.vy),
            b.vy - a.vy - h * (qy / m - b.yaw_rate * b.vx),
            b.yaw_rate - a.yaw_rate - h * mz / inertia,
        )
        assert sum(map(abs, residual)) <= 1e-11
        assert record.iterations <= 12
    assert np.mean([record.divisions == 1 for record in records]) > 0.95
    # Three to five on average; abrupt commands on the stiffest ground are the dearest.
    assert np.mean([record.iterations for record in records]) <= 5


def test_a_vehicle_that_stands_costs_no_step() -> None:
    assert Simulator(M113, "physics", GROUND).step(IDLE).iterations == 0


def test_a_wrong_jacobian_is_corrected_on_the_way(viscous: Make) -> None:
    """Of a linear force in one direction Broyden's method knows all after one step."""
    backend = viscous(rate=70.0, jacobian_scale=0.0)
    record = Simulator(M113, backend, GROUND, state=VehicleState(vx=1.0)).step(IDLE)
    assert (record.iterations, record.divisions) == (2, 1)
    assert record.state.vx == pytest.approx(1 / 1.7, abs=1e-11)


def test_the_forces_of_the_last_tick_are_the_first_guess(viscous: Make) -> None:
    """With a memory of the very acceleration to come, one step mends what rounding left, without any slopes."""
    backend, start = viscous(rate=70.0, jacobian_scale=0.0), VehicleState(vx=3.0, vy=-0.5)
    remembered = replace(start, ax=-70.0 * 3.0 / 1.7, ay=70.0 * 0.5 / 1.7)
    record = Simulator(M113, backend, GROUND, state=remembered).step(IDLE)
    assert (record.state.vx, record.state.vy) == pytest.approx((3.0 / 1.7, -0.5 / 1.7), abs=1e-11)
    assert (record.iterations, record.divisions) == (1, 1)
    forgetful = Simulator(M113, backend, GROUND, state=start).step(IDLE)
    assert (forgetful.state.vx, forgetful.state.vy) == pytest.approx((3.0 / 1.7, -0.5 / 1.7), abs=2e-11)
    assert forgetful.iterations > 1


@pytest.mark.usefixtures("newton_alone")
class TestDivision:
    """Where Broyden's method fails.

    With a Jacobian of zero, Newton's iteration is y ← y₀ + h f(y): each step shrinks the residual by z = h·rate.
    The first residual is z·v₀, so that eight steps reach z⁹ v₀; a tick converges if that is within 1e-11.
    """

    @pytest.mark.parametrize(("z", "divisions"), [(0.03, 1), (0.08, 2), (0.16, 4), (0.32, 8), (0.7, 16)])
    def test_the_tick_is_halved_until_newton_converges(self, viscous: Make, z: float, divisions: int) -> None:
        assert (z / divisions) ** 9 < 1e-11 < (2 * z / divisions) ** 9 or divisions == 1
        backend = viscous(rate=z / 0.01, jacobian_scale=0.0)
        record = Simulator(M113, backend, GROUND, state=VehicleState(vx=1.0)).step(IDLE)
        assert record.divisions == divisions
        assert record.iterations <= 8 * divisions
        assert record.state.vx == pytest.approx((1 + z / divisions) ** -divisions, abs=2e-11 * divisions)

    def test_a_right_jacobian_needs_no_division(self, viscous: Make) -> None:
        record = Simulator(M113, viscous(rate=1e4), GROUND, state=VehicleState(vx=1.0)).step(IDLE)
        assert record.divisions == 1
        assert record.state.vx == pytest.approx(1 / 101, abs=1e-11)

    def test_the_log_of_a_divided_tick_is_its_last_part(self, viscous: Make) -> None:
        backend = viscous(rate=32.0, jacobian_scale=0.0)
        record = Simulator(M113, backend, GROUND, state=VehicleState(vx=1.0)).step(IDLE)
        assert record.divisions == 8
        assert record.row[0] == record.state.vx
        np.testing.assert_array_equal(record.forces, backend.forces(record.row))
        assert record.state.ax == record.forces[0] / M113.mass
        before_last = (1 + 0.32 / 8) ** -7
        assert record.forces[0] / M113.mass == pytest.approx((record.state.vx - before_last) / (0.01 / 8), abs=1e-7)

    def test_a_divided_tick_still_takes_one_tick(self, viscous: Make) -> None:
        simulator = Simulator(M113, viscous(rate=32.0, jacobian_scale=0.0), GROUND, state=VehicleState.rolling(1.0))
        state = simulator.step(BeltCommand(1.0, 1.0)).state
        assert state.time == 0.01
        assert (state.v_left, state.v_right) == (1.0, 1.0)
        assert state.x == pytest.approx(0.005 * (1.0 + state.vx), abs=1e-15)

    def test_sdirk2_divides_too(self, viscous: Make) -> None:
        backend = viscous(rate=100.0, jacobian_scale=0.0)
        record = Simulator(M113, backend, GROUND, integrator="sdirk2", state=VehicleState(vx=1.0)).step(IDLE)
        assert record.divisions > 1
        part = amplification("sdirk2", -1.0 / record.divisions).real
        assert record.state.vx == pytest.approx(part**record.divisions, abs=1e-9)

    @pytest.mark.parametrize("integrator", ["implicit", "sdirk2"])
    def test_diverges_when_sixteenths_fail(self, viscous: Make, integrator: Integrator) -> None:
        start = VehicleState(x=1.0, vx=1.0, v_left=0.5, ax=0.25, time=7.0)
        backend = viscous(rate=16 * 60.0, jacobian_scale=0.0)
        simulator = Simulator(M113, backend, GROUND, integrator=integrator, state=start)
        with pytest.raises(SimulationDivergedError, match="sixteenth") as caught:
            simulator.step(IDLE)
        assert caught.value.state == start
        assert simulator.get_state() == start


class TestForcesThatAreNotFinite:
    @pytest.mark.parametrize("integrator", INTEGRATORS)
    @pytest.mark.parametrize("output", [0, 1, 2])
    @pytest.mark.parametrize("value", [math.nan, math.inf])
    @pytest.mark.parametrize("with_jacobian", [True, False], ids=["jacobian too", "jacobian finite"])
    def test_diverge_with_the_state_kept(
        self, poisoned: Make, integrator: Integrator, output: int, value: float, with_jacobian: bool
    ) -> None:
        start = VehicleState(vx=2.0, yaw_rate=0.1)
        backend = poisoned(output=output, value=value, jacobian_scale=value if with_jacobian else 1.0)
        simulator = Simulator(M113, backend, GROUND, integrator=integrator, state=start)
        with pytest.raises(SimulationDivergedError) as caught:
            simulator.step(IDLE)
        assert caught.value.state == start
        assert simulator.get_state() == start

    def test_diverge_where_only_the_solution_is_poisoned(self, poisoned: Make) -> None:
        start = VehicleState(vx=2.0)
        simulator = Simulator(M113, poisoned(rate=10.0, below=1.9999), GROUND, state=start)
        with pytest.raises(SimulationDivergedError):
            simulator.step(IDLE)
        assert simulator.get_state() == start

    def test_the_simulator_goes_on_after_a_divergence(self, poisoned: Make) -> None:
        simulator = Simulator(M113, poisoned(below=1.0), GROUND, state=VehicleState(vx=0.5))
        with pytest.raises(SimulationDivergedError):
            simulator.step(IDLE)
        simulator.set_state(VehicleState(vx=2.0))
        assert simulator.step(IDLE).state.vx == pytest.approx(2.0 / 1.01, abs=1e-11)
