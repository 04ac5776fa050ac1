"""The whole braking study, by name: ``make slow``."""

import itertools

import pytest

from grouser.envs import BeltCommand, Simulator, VehicleState
from grouser.terrain import GRAVITY, RigidTerrain, TrackedVehicle, vehicle_names

FRICTION = (0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1.0)
SHEAR_MODULUS = (0.005, 0.01, 0.02, 0.04, 0.06)
CASES = list(itertools.product(vehicle_names(), FRICTION, SHEAR_MODULUS, ("implicit", "sdirk2")))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "mu", "k", "integrator"), CASES)
def test_a_braked_vehicle_comes_to_rest_and_stays_there(name: str, mu: float, k: float, integrator: str) -> None:
    vehicle = TrackedVehicle.preset(name)
    speed = min(5.0, vehicle.training_speed)
    ground = RigidTerrain(mu, 0.03, k)
    simulator = Simulator(
        vehicle,
        "physics",
        ground,
        integrator=integrator,  # type: ignore[arg-type]
        state=VehicleState.rolling(speed),
    )
    for _ in range(round((speed / (mu * GRAVITY) + 5.0) / simulator.tick)):
        simulator.step(BeltCommand(0.0, 0.0))
    state = simulator.get_state()
    assert max(abs(state.vx), abs(state.vy), abs(state.yaw_rate)) < 1e-6
    at_rest = state.x
    for _ in range(3000):
        record = simulator.step(BeltCommand(0.0, 0.0))
        assert abs(record.forces[0]) < 1e-3 * vehicle.weight
    assert abs(record.state.x - at_rest) < 1e-6
