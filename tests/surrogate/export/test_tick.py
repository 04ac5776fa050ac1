"""The exported guard and tick against the simulator."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from exported import FALLBACK_ALONE, GUARDED, REFUSED, SURROGATE_ALONE, Exported
from exported import GuardState as ExportedGuard
from exported import VehicleState as ExportedState

from grouser.envs import BeltCommand, Simulator, VehicleState
from grouser.surrogate import GuardedSurrogate, NativeSurrogate, Surrogate
from grouser.terrain import (
    FloatArray,
    ForceBackend,
    GuardMode,
    GuardState,
    PhysicsBackend,
    RigidTerrain,
    SlopedGround,
    SoilTerrain,
)

NAMES = ("x", "y", "heading", "vx", "vy", "yaw_rate", "v_left", "v_right", "ax", "ay", "time")


@pytest.fixture
def terrain(surrogate: Surrogate) -> RigidTerrain | SoilTerrain:
    middle = (np.array(surrogate.ranges.low) + np.array(surrogate.ranges.high)) / 2
    return (RigidTerrain if surrogate.mode == "rigid" else SoilTerrain)(*middle.tolist())


def maneuver(limit: float, ticks: int) -> Iterator[BeltCommand]:
    """Away from rest, a turn, a pivot, a stop."""
    shares = ((0.3, 0.35), (0.5, 0.2), (-0.15, 0.15), (0.0, 0.0))
    for tick in range(ticks):
        left, right = shares[min(4 * tick // ticks, 3)]
        yield BeltCommand(left * limit, right * limit)


def numbers(state: VehicleState | ExportedState) -> FloatArray:
    return np.array([getattr(state, name) for name in NAMES])


def parameters(terrain: RigidTerrain | SoilTerrain) -> FloatArray:
    return np.array(terrain.parameters)


@pytest.mark.parametrize("slope", [None, (0.12, -0.05)])
def test_the_tick_is_the_simulators_on_physics(
    code: Exported, surrogate: Surrogate, terrain: RigidTerrain | SoilTerrain, slope: tuple[float, float] | None
) -> None:
    vehicle = surrogate.vehicle
    ground = terrain if slope is None else SlopedGround(terrain, *slope)
    simulator = Simulator(vehicle, PhysicsBackend(vehicle, surrogate.mode), ground)
    state: ExportedState = code.function("at_rest")()
    for command in maneuver(vehicle.training_speed, 500):
        record = simulator.step(command)
        status, exported = code.tick(
            FALLBACK_ALONE,
            command,
            parameters(terrain),
            state,
            slope=None if slope is None else np.tan(slope),
        )
        assert status == 0
        assert exported.divisions == record.divisions
        np.testing.assert_allclose(exported.row[: code.columns], record.row, rtol=0, atol=1e-9)
    np.testing.assert_allclose(numbers(state), numbers(simulator.get_state()), rtol=0, atol=1e-9)


def drive_both(
    code: Exported, backend: ForceBackend, source: int, terrain: RigidTerrain | SoilTerrain, commands: list[BeltCommand]
) -> tuple[list[VehicleState], list[ExportedGuard]]:
    """Return the simulator's states and the export's guards, once the motion is seen to agree."""
    simulator, state = Simulator(backend.vehicle, backend, terrain), code.function("at_rest")()
    states, guards = [], []
    for command in commands:
        states.append(simulator.step(command).state)
        assert code.tick(source, command, parameters(terrain), state)[0] == 0
        guards.append(ExportedGuard.from_buffer_copy(state.guard))
        np.testing.assert_allclose(numbers(state), numbers(states[-1]), rtol=0, atol=1e-4)
    return states, guards


def test_the_tick_is_the_simulators_on_the_surrogate(
    code: Exported, surrogate: Surrogate, terrain: RigidTerrain | SoilTerrain
) -> None:
    backend = NativeSurrogate(surrogate.vehicle, surrogate.mode, surrogate)
    drive_both(code, backend, SURROGATE_ALONE, terrain, list(maneuver(surrogate.vehicle.training_speed, 150)))


def test_the_guard_switches_when_the_simulators_does(
    code: Exported, surrogate: Surrogate, terrain: RigidTerrain | SoilTerrain
) -> None:
    vehicle = surrogate.vehicle
    backend = GuardedSurrogate(vehicle, surrogate.mode, surrogate)
    calm = BeltCommand(0.2 * vehicle.training_speed, 0.2 * vehicle.training_speed)
    # Faster than in training, in a curve.
    fast = BeltCommand(1.2 * vehicle.training_speed, 1.3 * vehicle.training_speed)
    commands = [calm] * 50 + [fast] * 450 + [calm] * 400
    states, guards = drive_both(code, backend, GUARDED, terrain, commands)
    modes = [state.guard.mode for state in states]
    assert GuardMode.FALLBACK in modes
    assert modes[-1] is GuardMode.PRIMARY
    for state, guard in zip(states, guards, strict=True):
        assert guard.mode == (state.guard.mode is GuardMode.FALLBACK)
        assert guard.fallback_weight == pytest.approx(state.guard.fallback_weight, abs=1e-12)


def test_single_calls_advance_the_guard_as_the_policy_does(
    code: Exported, surrogate: Surrogate, rows: FloatArray
) -> None:
    backend = GuardedSurrogate(surrogate.vehicle, surrogate.mode, surrogate)
    rows[::3, :7] *= 2.0
    scale = backend.fallback.forces(rows).std(axis=0)
    guard, expected = code.function("fresh_guard")(), GuardState()
    for row in np.repeat(rows[:40], 4, axis=0):
        detection = backend.detector.detect(row)
        expected = backend.policy.advance(expected, detection, 0.1)
        force, by_body, got = code.guarded(guard, 0.1, row)
        wanted = backend.blended_forces_and_jacobian(row, expected.fallback_weight)
        assert guard.mode == (expected.mode is GuardMode.FALLBACK)
        assert got.score == pytest.approx(detection.score, rel=1e-9)
        assert (abs(force - wanted[0]) <= 1e-5 * scale).all()
        largest = np.maximum(abs(wanted[1][:, :3]).max(axis=1, keepdims=True), scale[:, None])
        assert (abs(by_body - wanted[1][:, :3]) <= 1e-4 * largest).all()


@pytest.mark.parametrize("artifact", ["m113-rigid"])
def test_a_tick_that_cannot_be_made_leaves_the_vehicle_as_it_was(
    code: Exported, surrogate: Surrogate, terrain: RigidTerrain | SoilTerrain, exported: Callable[[str], Exported]
) -> None:
    state: ExportedState = code.function("at_rest")()
    before = bytes(state)
    theta, limit = parameters(terrain), surrogate.vehicle.maximum_speed
    assert code.tick(GUARDED, BeltCommand(limit + 0.1, 0.0), theta, state)[0] == REFUSED
    assert code.tick(GUARDED, BeltCommand(0.0, float("nan")), theta, state)[0] == REFUSED
    assert code.tick(GUARDED, BeltCommand(1.0, 1.0), theta, state, seconds=0.0)[0] == REFUSED
    assert code.tick(GUARDED, BeltCommand(1.0, 1.0), np.full(3, np.nan), state)[0] != 0
    assert bytes(state) == before
