"""Curriculum in the scenes: what may change between two episodes, and what may not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from grouser.envs import VehicleState
from grouser.terrain import ConfigurationError, InvalidInputError

PARKING: dict[str, Any] = {"parked_vehicles": 5, "start_spread": 3.0, "walls": False, "position_tolerance": 2.0}
OFFROAD: dict[str, Any] = {
    "road_points": 5,
    "bend": 0.2,
    "obstacles": 2,
    "patches": 3,
    "patch_terrains": ("snow-sweden",),
    "lateral_spread": 2.0,
    "lowest_start_speed": 0.1,
}
RANDOMIZE: dict[str, Any] = {"randomize": {"terrain": "wide", "yaw_inertia": (0.5, 2.0)}}
ACTION = np.array([0.5, 0.4], np.float32)

both_scenes = pytest.mark.parametrize(
    ("make", "changes"), [("make_parking", PARKING), ("make_offroad", OFFROAD)], indirect=["make"]
)


@pytest.fixture
def make(request: pytest.FixtureRequest) -> Any:
    """Of the scene that a test names, with obstacles to be seen."""
    build = request.getfixturevalue(request.param)
    taken = {"parked_vehicles": 2} if request.param == "make_parking" else {}
    return lambda **settings: build("physics", **(taken | settings))


def same(one: Any, other: Any) -> bool:
    np.testing.assert_equal(one, other)
    return True


@both_scenes
def test_from_the_next_reset_it_is_an_environment_made_so(make: Any, changes: dict[str, Any]) -> None:
    changed, made = make(), make(**changes, **RANDOMIZE)
    changed.reset(seed=0)
    changed.reconfigure(**changes, **RANDOMIZE)
    assert changed.config == made.config
    assert same(changed.reset(seed=1), made.reset(seed=1))
    assert same(changed.step(ACTION), made.step(ACTION))
    assert same(changed.reset(), made.reset())


@both_scenes
def test_the_running_episode_goes_on(make: Any, changes: dict[str, Any]) -> None:
    changed, other = make(), make()
    for env in (changed, other):
        env.reset(seed=0)
        env.step(ACTION)
    changed.reconfigure(**changes, **RANDOMIZE)
    assert same(changed.step(ACTION), other.step(ACTION))


@both_scenes
@pytest.mark.parametrize(
    "key", ["control_period", "scene_period", "top_speed", "observe_terrain", "observed_obstacles", "collision_weight"]
)
def test_what_the_environment_was_made_with_stays(make: Any, changes: dict[str, Any], key: str) -> None:
    env = make()
    before = env.config
    with pytest.raises(ConfigurationError, match=f"{key} holds for the life .* another environment"):
        env.reconfigure(**changes, **{key: 1})
    assert env.config is before


def test_a_tolerance_is_that_of_the_episode(make_parking: Any) -> None:
    env, beside = make_parking("physics"), VehicleState(x=-2.0, y=13.0, heading=np.pi / 2)
    still = np.zeros(2, np.float32)
    env.reset(seed=0, options={"state": beside, "spot": 6})
    env.reconfigure(position_tolerance=1.5)
    assert not env.step(still)[4]["is_success"]
    env.reset(seed=0, options={"state": beside, "spot": 6})
    observation, _, terminated, _, info = env.step(still)
    assert info["is_success"]
    assert terminated
    assert env.compute_terminated(observation["achieved_goal"], observation["desired_goal"], info)


@pytest.mark.parametrize(("before", "after"), [(0, 3), (3, 0)])
def test_obstacles_are_seen_or_not_for_life(make_parking: Any, before: int, after: int) -> None:
    env = make_parking("physics", parked_vehicles=before)
    with pytest.raises(ConfigurationError, match=f"parked_vehicles cannot change from {before} to {after}"):
        env.reconfigure(parked_vehicles=after)
    assert env.config.parked_vehicles == before


def test_an_unknown_key_gets_the_nearest_name(make_offroad: Any) -> None:
    with pytest.raises(ConfigurationError, match="did you mean 'obstacles'"):
        make_offroad("physics").reconfigure(obstacle=3)


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"obstacles": -1}, InvalidInputError),
        ({"obstacle_size": (1.0, 9.0)}, InvalidInputError),
        ({"patch_terrains": ("ice",)}, ConfigurationError),
        ({"patch_terrains": ("snow-sweden",), "randomize": {"terrain": ("ice",)}}, ConfigurationError),
    ],
)
def test_impossible_values_change_nothing(make_offroad: Any, change: dict[str, Any], error: type[Exception]) -> None:
    env = make_offroad("physics")
    before, (first, _) = env.config, env.reset(seed=0)
    ground = env.ground.parameters.copy()
    with pytest.raises(error):
        env.reconfigure(**change)
    assert env.config is before
    assert same(env.reset(seed=0)[0], first)
    assert same(env.ground.parameters, ground)
