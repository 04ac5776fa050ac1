"""The order of the tick's integrators against SciPy's Radau, memory and belts held in every tick, over a drive."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from grouser.envs import BeltCommand, Integrator, Simulator, VehicleState, advance_belts
from grouser.terrain import FloatArray, PhysicsBackend, Terrain, TrackedVehicle, named

M113 = TrackedVehicle.preset("m113")
TICKS = (0.01, 0.005, 0.0025)
CONTROL_PERIOD, DURATION, SPEED = 0.1, 0.6, 6.0


def commands() -> list[BeltCommand]:
    """A turn that grows in, at a speed at which explicit Euler is stable too."""
    halves = [0.8 * math.sin(math.pi * n * CONTROL_PERIOD / DURATION) for n in range(round(DURATION / CONTROL_PERIOD))]
    return [BeltCommand(SPEED - half, SPEED + half) for half in halves]


def radau_ticks(backend: PhysicsBackend, terrain: Terrain, tick: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Bodies (n + 1, 3) of the drive with every tick solved to 1e-10, and the memory and V_mid that each held."""
    scale = np.array([M113.mass, M113.mass, M113.yaw_inertia])
    body, memory, belts = np.array([SPEED, 0.0, 0.0]), np.zeros(2), (SPEED, SPEED)
    bodies, memories, middles = [body], [], []
    for command in commands():
        for _ in range(round(CONTROL_PERIOD / tick)):
            middle = advance_belts(M113, belts, command, tick / 2)
            held = np.array([*memory, *middle, *terrain.parameters])

            def rates(_: float, y: FloatArray, held: FloatArray = held) -> FloatArray:
                turning = np.array([y[2] * y[1], -y[2] * y[0], 0.0])
                total: FloatArray = backend.forces(np.concatenate([y, held])) / scale + turning
                return total

            memories.append(memory)
            middles.append(middle)
            body = solve_ivp(rates, (0.0, tick), body, method="Radau", rtol=1e-10, atol=1e-13).y[:, -1]
            memory = backend.forces(np.concatenate([body, held]))[:2] / M113.mass
            belts = advance_belts(M113, belts, command, tick)
            bodies.append(body)
    return np.array(bodies), np.array(memories), np.array(middles)


@pytest.mark.parametrize("ground", ["asphalt", "lete-sand"])
def test_observed_order_with_memory_and_belts_held(ground: str) -> None:
    terrain = named(ground)
    backend = PhysicsBackend(M113, terrain.mode)
    errors: dict[Integrator, list[float]] = {"implicit": [], "sdirk2": [], "euler": []}
    for tick in TICKS:
        bodies, memories, middles = radau_ticks(backend, terrain, tick)
        assert np.ptp(bodies[:, 2]) > 0.1, "the drive has to turn"
        for integrator, found in errors.items():
            simulator = Simulator(
                M113, backend, terrain, tick=tick, integrator=integrator, state=VehicleState.rolling(SPEED)
            )
            squares = []
            for exact, (ax, ay), (left, right) in zip(bodies[1:], memories, middles, strict=True):
                # Belts that stand at their command stay there: V_mid is what each integrator is given.
                state = replace(simulator.get_state(), ax=ax, ay=ay, v_left=left, v_right=right)
                simulator.set_state(state)
                state = simulator.step(BeltCommand(left, right)).state
                squares.append(np.sum((np.array([state.vx, state.vy, state.yaw_rate]) - exact) ** 2))
            found.append(math.sqrt(float(np.mean(squares))))
    orders = {name: np.polyfit(np.log(TICKS), np.log(found), 1)[0] for name, found in errors.items()}
    assert orders["implicit"] >= 0.9
    assert orders["sdirk2"] >= 1.8
    assert orders["euler"] == pytest.approx(1.0, abs=0.15)
    # Of the promised order, not above it by a reference that shares the method.
    assert orders["implicit"] <= 1.2
    assert orders["sdirk2"] <= 2.3
    assert errors["sdirk2"][0] < errors["implicit"][0] / 10
