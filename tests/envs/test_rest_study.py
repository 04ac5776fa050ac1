"""Braking, being pushed and standing still, over every vehicle and the whole training box: ``make slow``."""

import itertools
import math

import pytest

from grouser.envs import BeltCommand, Simulator, VehicleState
from grouser.terrain import GRAVITY, MODES, Mode, RigidTerrain, SoilTerrain, Terrain, TrackedVehicle, parameter_ranges
from grouser.terrain import vehicle_names as names

IDLE = BeltCommand(0.0, 0.0)


def training_box(mode: Mode) -> list[Terrain]:
    """Every corner of the wide ranges, and its middle; the softest soils are those without cohesion."""
    ranges = parameter_ranges("wide", mode)
    kind = RigidTerrain if mode == "rigid" else SoilTerrain
    corners = itertools.product(*zip(ranges.low, ranges.high, strict=True))
    middle = tuple((low + high) / 2 for low, high in zip(ranges.low, ranges.high, strict=True))
    return [kind(*theta) for theta in (*corners, middle)]


GROUNDS = [
    *(RigidTerrain(mu, 0.03, k) for mu in (0.2, 0.35, 0.5, 0.7, 0.85) for k in (0.01, 0.02, 0.04)),
    *(ground for mode in MODES for ground in training_box(mode)),
]


def friction(ground: Terrain) -> float:
    """Return the least friction that the ground has, whatever the load."""
    return ground.mu if isinstance(ground, RigidTerrain) else math.tan(ground.phi)


def energy(vehicle: TrackedVehicle, state: VehicleState) -> float:
    return 0.5 * (vehicle.mass * (state.vx**2 + state.vy**2) + vehicle.yaw_inertia * state.yaw_rate**2)


def speed_left(state: VehicleState) -> float:
    return max(abs(state.vx), abs(state.vy), abs(state.yaw_rate))


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["implicit", "sdirk2"])
@pytest.mark.parametrize("ground", GROUNDS, ids=str)
@pytest.mark.parametrize("name", names())
def test_a_braked_vehicle_comes_to_rest_and_stays_there(name: str, ground: Terrain, integrator: str) -> None:
    vehicle = TrackedVehicle.preset(name)
    speed = min(5.0, vehicle.training_speed)
    state = VehicleState.rolling(speed)
    simulator = Simulator(vehicle, "physics", ground, integrator=integrator, state=state)  # type: ignore[arg-type]
    for _ in range(round((speed / (friction(ground) * GRAVITY) + 5.0) / simulator.tick)):
        simulator.step(IDLE)
    assert speed_left(simulator.get_state()) < 1e-6
    at_rest = simulator.get_state().x
    for _ in range(3000):
        record = simulator.step(IDLE)
        assert abs(record.forces[0]) < 1e-3 * vehicle.weight
    assert abs(record.state.x - at_rest) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize(
    "push", [(0.0, 0.5, 0.0), (0.3, 0.3, 0.0), (0.0, 0.2, 0.6)], ids=["lateral", "oblique", "turning"]
)
@pytest.mark.parametrize("ground", GROUNDS, ids=str)
@pytest.mark.parametrize("name", names())
def test_a_pushed_vehicle_only_loses_energy_until_it_rests(
    name: str, ground: Terrain, push: tuple[float, float, float]
) -> None:
    vehicle = TrackedVehicle.preset(name)
    vx, vy, yaw_rate = push
    simulator = Simulator(vehicle, "physics", ground, state=VehicleState(vx=vx, vy=vy, yaw_rate=yaw_rate))
    before = energy(vehicle, simulator.get_state())
    for _ in range(round((1.0 / (friction(ground) * GRAVITY) + 5.0) / simulator.tick)):
        after = energy(vehicle, simulator.step(IDLE).state)
        # The solver's tolerance of 1e-11 m/s.
        assert after <= before + 1e-10 * vehicle.mass * max(1.0, vx + vy)
        before = after
    assert speed_left(simulator.get_state()) < 1e-6


@pytest.mark.parametrize("name", names())
def test_a_vehicle_that_has_braked_holds_for_ten_minutes(name: str) -> None:
    simulator = Simulator(name, "physics", RigidTerrain(0.8, 0.03, 0.025), state=VehicleState(vx=0.5, vy=0.2))
    for _ in range(500):
        simulator.step(IDLE)
    parked = simulator.get_state()
    for _ in range(60_000):
        simulator.step(IDLE)
    state = simulator.get_state()
    assert math.dist((state.x, state.y), (parked.x, parked.y)) < 1e-6
    assert abs(state.heading - parked.heading) < 1e-6
