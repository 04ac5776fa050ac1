"""Environments of highway-env with a tracked vehicle in them."""

from __future__ import annotations

import copy
import warnings
from typing import Any

import gymnasium
import highway_env
import numpy as np
import pytest

from grouser.envs import PathTrackingEnv
from grouser.envs.highway import TrackedHighwayVehicle, tracked_vehicle_class, use_tracked_vehicle
from grouser.terrain import ConfigurationError

CONTINUOUS = {"action": {"type": "ContinuousAction"}}
MANY = {
    "action": {"type": "MultiAgentAction", "action_config": {"type": "ContinuousAction"}},
    "controlled_vehicles": 2,
}


@pytest.fixture
def marder() -> type[TrackedHighwayVehicle]:
    return tracked_vehicle_class("physics", "marder")


def make(id: str, config: dict[str, Any] | None = None) -> gymnasium.Env[Any, Any]:
    gymnasium.register_envs(highway_env)
    with warnings.catch_warnings():
        # Gymnasium tells of a newer version of some.
        warnings.simplefilter("ignore", DeprecationWarning)
        return gymnasium.make(id, config=config or {}, disable_env_checker=True)


@pytest.mark.parametrize(
    ("id", "config"),
    [
        ("parking-v0", {}),
        ("racetrack-v0", {}),
        ("highway-v0", CONTINUOUS | {"vehicles_count": 3}),
        ("parking-v0", MANY),
    ],
    ids=["parking", "racetrack", "highway", "two agents"],
)
def test_drives_and_moves_as_the_simulator_does(
    id: str, config: dict[str, Any], marder: type[TrackedHighwayVehicle]
) -> None:
    env = use_tracked_vehicle(make(id, config), marder)
    env.reset(seed=1)
    env.action_space.seed(1)
    host: Any = env.unwrapped
    for _ in range(4):
        env.step(env.action_space.sample())
    for vehicle in host.controlled_vehicles:
        assert type(vehicle) is marder
        assert vehicle in host.road.vehicles
    assert vehicle.state.time == pytest.approx(host.time)


def test_its_actions_accelerate_and_steer(marder: type[TrackedHighwayVehicle]) -> None:
    env = use_tracked_vehicle(make("parking-v0"), marder)
    env.reset(seed=0)
    host: Any = env.unwrapped
    before = host.vehicle.heading
    for _ in range(5):
        env.step(np.array([0.4, 0.5], np.float32))
    # 0.4 of 5 m/s² over 1 s.
    assert host.vehicle.state.v_left + host.vehicle.state.v_right == pytest.approx(2 * 2.0, rel=0.05)
    assert host.vehicle.heading > before


def test_vehicles_beside_it_are_named_by_the_configuration() -> None:
    path = f"{TrackedHighwayVehicle.__module__}.{TrackedHighwayVehicle.__qualname__}"
    env = make("highway-v0", {"other_vehicles_type": path, "vehicles_count": 3})
    env.reset(seed=0)
    for _ in range(2):
        env.step(env.action_space.sample())
    host: Any = env.unwrapped
    assert [type(each) for each in host.road.vehicles[1:]] == [TrackedHighwayVehicle] * 3


def test_a_copied_environment_goes_its_own_way_to_the_same_place(marder: type[TrackedHighwayVehicle]) -> None:
    env = use_tracked_vehicle(make("parking-v0"), marder)
    env.reset(seed=1)
    twin = copy.deepcopy(env.unwrapped)
    action = np.array([0.6, 0.3], np.float32)
    one, other = env.step(action), twin.step(action)
    np.testing.assert_equal(one[0], other[0])
    # Its next vehicles are tracked as well.
    twin.reset(seed=2)
    assert type(twin.vehicle) is marder  # type: ignore[attr-defined]


def test_the_seed_of_the_action_space_survives_resets(marder: type[TrackedHighwayVehicle]) -> None:
    env = use_tracked_vehicle(make("parking-v0"), marder)
    draws = []
    for _ in range(2):
        env.reset(seed=0)
        env.unwrapped.action_space.seed(3)
        env.reset(seed=0)
        draws.append(env.unwrapped.action_space.sample())
    assert draws[0].tolist() == draws[1].tolist()


def test_meta_actions_are_refused() -> None:
    with pytest.raises(ConfigurationError, match="ContinuousAction"):
        use_tracked_vehicle(make("highway-v0"))


def test_another_environment_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="highway-env"):
        use_tracked_vehicle(PathTrackingEnv("physics"))
