"""Curriculum: what may change between the episodes of a living environment, and what may not."""

from typing import Any

import gymnasium
import numpy as np
import pytest

import grouser  # noqa: F401 - registers the environments
from grouser.envs import SpeedTrackingEnv
from grouser.terrain import ConfigurationError, InvalidInputError

PATH, SPEED = "grouser/PathTracking-v0", "grouser/SpeedTracking-v0"
COARSE: dict[str, Any] = {"backend": "physics", "backend_options": {"cells": (2, 1)}}
CHANGES: dict[str, dict[str, Any]] = {
    PATH: {"lateral_spread": 1.0, "heading_spread": 0.5, "random_start": True, "randomize": {"terrain": "wide"}},
    SPEED: {"lowest_speed": 2.0, "highest_speed": 3.0, "effort": 0.9, "randomize": {"yaw_inertia": (0.5, 2.0)}},
}
both_tasks = pytest.mark.parametrize("name", [PATH, SPEED])


def make(name: str, **settings: Any) -> Any:
    return gymnasium.make(name, **(COARSE | settings)).unwrapped


@both_tasks
@pytest.mark.parametrize("engine", ["compiled", "python"])
def test_from_the_next_reset_it_is_an_environment_made_so(name: str, engine: str) -> None:
    changed, made = make(name, engine=engine), make(name, engine=engine, **CHANGES[name])
    changed.reset(seed=0)
    changed.reconfigure(**CHANGES[name])
    assert changed.config == made.config
    first, info = changed.reset(seed=1)
    expected, wanted = made.reset(seed=1)
    assert first.tobytes() == expected.tobytes()
    assert info == wanted
    action = np.array([0.5, 0.4], np.float32)
    assert changed.step(action)[0].tobytes() == made.step(action)[0].tobytes()


@both_tasks
def test_the_running_episode_goes_on(name: str) -> None:
    changed, other = make(name), make(name)
    action = np.array([0.5, 0.4], np.float32)
    for env in (changed, other):
        env.reset(seed=0)
        env.step(action)
    changed.reconfigure(**CHANGES[name])
    ours, theirs = changed.step(action), other.step(action)
    assert ours[0].tobytes() == theirs[0].tobytes()
    assert ours[1] == theirs[1]


@both_tasks
def test_a_batch_is_reconfigured_as_a_single_environment_is(name: str) -> None:
    batch: Any = gymnasium.make_vec(name, 2, "vector_entry_point", **COARSE)
    batch.reset(seed=0)
    batch.reconfigure(**CHANGES[name])
    observations, infos = batch.reset(seed=5)
    env = make(name, **CHANGES[name])
    for row in range(2):
        expected, wanted = env.reset(seed=5 + row)
        assert observations[row].tobytes() == expected.tobytes()
        assert {key: values[row] for key, values in infos["randomization"].items() if key[0] != "_"} == wanted[
            "randomization"
        ]


@both_tasks
@pytest.mark.parametrize("key", ["control_period", "action_change_weight", "observe_terrain", "time_limit", "grade"])
def test_what_the_engine_was_made_with_stays(name: str, key: str) -> None:
    env = make(name)
    before = env.config
    with pytest.raises(ConfigurationError, match=f"{key} holds for the life .* another environment"):
        env.reconfigure(lowest_start_speed=0.1, **{key: 0.2})
    assert env.config is before


def test_an_unknown_key_gets_the_nearest_name() -> None:
    with pytest.raises(ConfigurationError, match="did you mean 'lateral_spread'"):
        make(PATH).reconfigure(lateral_spred=0.1)


@pytest.mark.parametrize(
    "change", [{"highest_speed": 1.0, "lowest_speed": 2.0}, {"highest_speed": 99.0}, {"effort": 0.0}]
)
def test_impossible_values_change_nothing(change: dict[str, Any]) -> None:
    env = SpeedTrackingEnv(**COARSE)
    before, first = env.config, env.reset(seed=0)[0]
    with pytest.raises(InvalidInputError):
        env.reconfigure(**change)
    assert env.config is before
    assert env.reset(seed=0)[0].tobytes() == first.tobytes()
