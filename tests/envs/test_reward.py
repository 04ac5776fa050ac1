"""A reward of one's own: what it is shown, that every form of a task is given the same, and what it may return."""

import math
from typing import Any

import gymnasium
import numpy as np
import pytest

import grouser  # noqa: F401 - registers the environments
from grouser.envs import PathTrackingEnv, StepView
from grouser.terrain import InvalidInputError, TerrainField, named

PATH, SPEED = "grouser/PathTracking-v0", "grouser/SpeedTracking-v0"
COARSE: dict[str, Any] = {"backend": "physics", "backend_options": {"cells": (2, 1)}}


def everything(view: StepView) -> Any:
    """A number that each part of a view goes into."""
    motion = view.x + 2 * view.y + np.sin(view.heading) + view.vx * view.vy - view.yaw_rate + view.time
    belts = np.hypot(view.v_left, view.v_right) + 1e-6 * view.forces[:, 0] * view.forces[:, 1] + view.forces[:, 2]
    change = ((view.actions - view.previous_actions) ** 2).sum(axis=1)
    told = sum(view.measures.values()) + sum(view.terms.values()) + view.reward
    return np.exp(-(belts**2) / 1e12) * motion + change + told - 5 * view.broken_off + view.terminated - view.truncated


def drive(env: Any, steps: int = 12) -> Any:
    env.reset(seed=4)
    generator = np.random.default_rng(0)
    return [env.step(generator.uniform(-1, 1, env.action_space.shape).astype(np.float32)) for _ in range(steps)]


@pytest.mark.parametrize("name", [PATH, SPEED])
@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_batched_is_single_to_the_bit(name: str, mode: str) -> None:
    options = COARSE | {"reward": everything, "time_limit": 0.4}
    ours = gymnasium.make_vec(name, 3, "vector_entry_point", autoreset_mode=mode, **options)
    theirs = gymnasium.make_vec(name, 3, "sync", vector_kwargs={"autoreset_mode": mode}, **options)
    for outcome, reference in zip(drive(ours), drive(theirs), strict=True):
        assert outcome[1].tobytes() == reference[1].tobytes()


@pytest.mark.parametrize("name", [PATH, SPEED])
def test_the_python_tick_agrees(name: str) -> None:
    engines = (gymnasium.make(name, engine=engine, reward=everything, **COARSE) for engine in ("compiled", "python"))
    for outcome, reference in zip(*(drive(env) for env in engines), strict=True):
        assert outcome[1] == pytest.approx(reference[1], rel=1e-6)


@pytest.mark.parametrize("engine", ["compiled", "python"])
def test_where_the_map_ends(engine: str) -> None:
    """A vehicle that is lost has no forces and no terms, and the reward is still the function's."""
    seen: list[StepView] = []

    def lost(view: StepView) -> Any:
        seen.append(view)
        return np.where(view.broken_off, -7.0, 1.0)

    field = TerrainField("rigid", (-2.0, -2.0), 0.5, np.tile(named("asphalt").parameters, (8, 8, 1)))
    env = gymnasium.make(SPEED, terrain=field, engine=engine, reward=lost, **COARSE)
    env.reset(seed=0, options={"speed": 5.0})
    terminated, rewards = False, []
    while not terminated:
        _, reward, terminated, _, _ = env.step(np.array([0.8, 0.8], np.float32))
        rewards.append(reward)
    assert rewards == [1.0] * (len(rewards) - 1) + [-7.0]
    assert not seen[-1].forces.any()
    assert not any(values.any() for values in seen[-1].terms.values())
    assert seen[-1].reward == [-2.0]


def test_the_view_is_what_info_and_state_tell() -> None:
    seen: list[StepView] = []

    def keep(view: StepView) -> Any:
        seen.append(view)
        return view.reward

    env = PathTrackingEnv(reward=keep, **COARSE)
    outcomes = drive(env, 3)
    view, info, state = seen[-1], outcomes[-1][4], env.simulator.get_state()
    assert [view.x[0], view.vy[0], view.v_right[0], view.time[0]] == [state.x, state.vy, state.v_right, state.time]
    assert view.forces[0].tolist() == info["force"].tolist()
    assert view.measures["cross_track_error"][0] == info["cross_track_error"]
    assert {name: values[0] for name, values in view.terms.items()} == info["reward_terms"]
    assert outcomes[-1][1] == pytest.approx(sum(info["reward_terms"].values()), abs=1e-15)
    assert view.previous_actions.tolist() == seen[-2].actions.tolist()


def test_a_function_that_writes_into_its_view_harms_nobody() -> None:
    def vandal(view: StepView) -> Any:
        for array in (view.x, view.forces, view.actions, *view.terms.values(), *view.measures.values()):
            array[...] = math.nan
        return view.reward

    plain = gymnasium.make(PATH, **COARSE)
    for outcome, reference in zip(drive(gymnasium.make(PATH, reward=vandal, **COARSE)), drive(plain), strict=True):
        assert outcome[0].tobytes() == reference[0].tobytes()
        assert outcome[1] == reference[1]


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        (lambda view: 1.0, r"shape \(2,\), one for each vehicle"),
        (lambda view: view.forces, r"shape \(2, 3\)"),
        (lambda view: ["good", "bad"], "numbers"),
        (lambda view: np.array([0.0, math.nan]), "nan for vehicle 1"),
        (lambda view: None, "numbers"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_what_is_no_reward_is_refused(returned: Any, message: str) -> None:
    env = gymnasium.make_vec(PATH, 2, "vector_entry_point", reward=returned, **COARSE)
    env.reset(seed=0)
    with pytest.raises(InvalidInputError, match=message):
        env.step(np.zeros((2, 2), np.float32))
