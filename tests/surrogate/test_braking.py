"""Every shipped structured surrogate brakes to a stand, on every named ground, where physics does."""

import math

import pytest

from grouser.envs import BeltCommand, Simulator, VehicleState
from grouser.terrain import TrackedVehicle, make_backend, named, terrain_names

# Stop distance within 1 % of physics, and then at rest to what float32 resolves.
DISTANCE, SPEED = 0.01, 1e-6


def braked(vehicle: TrackedVehicle, backend: str, terrain: str) -> VehicleState:
    """State 6 s after the belts were told to stop at 5 m/s, or at the training speed if that is less."""
    ground = named(terrain)
    speed = min(5.0, vehicle.training_speed)
    simulator = Simulator(
        vehicle,
        make_backend(backend, mode=ground.mode, vehicle=vehicle),
        ground,
        state=VehicleState.rolling(speed),
    )
    for _ in range(600):
        simulator.step(BeltCommand(0.0, 0.0))
    return simulator.get_state()


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", ["m113", "ugv"])
@pytest.mark.parametrize("terrain", terrain_names())
def test_the_brake_ends_where_physics_ends_and_at_rest(vehicle: str, terrain: str) -> None:
    preset = TrackedVehicle.preset(vehicle)
    native, physics = (braked(preset, backend, terrain) for backend in ("native", "physics"))
    assert native.x == pytest.approx(physics.x, rel=DISTANCE)
    assert math.hypot(native.vx, native.vy) < SPEED
    assert abs(native.yaw_rate) < SPEED
