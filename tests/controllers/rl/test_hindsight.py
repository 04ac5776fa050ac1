"""Hindsight: infos come back as they went in, and Parking is learned from with its own reward."""

from __future__ import annotations

import copy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from grouser.controllers import Recipe, TrainingPlan, evaluate, load_policy, train_policy
from grouser.controllers.rl import environment_ids
from grouser.controllers.rl.hindsight import InfoColumns, hindsight_buffer

pytestmark = pytest.mark.filterwarnings("ignore:.*truncated.*:UserWarning")
needs_parking = pytest.mark.skipif("grouser/Parking-v0" not in environment_ids(), reason="there is no Parking-v0")


def info(step: int) -> dict[str, Any]:
    made = {"crashed": step % 3 == 0, "steps": step, "reward_terms": {"goal": -step / 7, "slip": np.float64(step)}}
    ignored = {"episode": {"r": 1.0, "t": 9.9}, "terminal_observation": np.zeros(3), "backend": "native"}
    return made | ignored | ({"diverged": True} if step == 5 else {})


def kept(step: int) -> dict[str, Any]:
    return {key: value for key, value in info(step).items() if key in ("crashed", "steps", "reward_terms", "diverged")}


def test_infos_come_back_as_they_went_in_without_what_no_reward_is_made_of() -> None:
    columns = InfoColumns(8, 2)
    for step in range(4):
        columns[step] = [info(2 * step), info(2 * step + 1)]
    rows, environments = np.array([0, 2, 2, 3]), np.array([1, 0, 1, 1])
    found = columns[rows, environments]
    assert list(found) == [kept(2 * row + environment) for row, environment in zip(rows, environments, strict=True)]
    # A copy is made where stable-baselines3 asks for one; here none is needed.
    assert copy.deepcopy(found) is found


def test_a_ring_forgets_what_it_overwrites() -> None:
    columns = InfoColumns(2, 1)
    for step in (5, 6, 7):
        columns[step % 2] = [info(step)]
    assert list(columns[np.array([0, 1]), np.array([0, 0])]) == [kept(6), kept(7)]


@needs_parking
def test_relabelled_rewards_are_those_of_the_environment() -> None:
    pytest.importorskip("highway_env")
    from grouser.controllers import EnvironmentSpec

    environment = EnvironmentSpec("grouser/Parking-v0", {"backend": "physics", "time_limit": 2.0}).make_vec_env(2)
    space, actions = environment.observation_space, environment.action_space
    buffer = hindsight_buffer()(64, space, actions, n_envs=2, env=environment)  # type: ignore[arg-type]
    environment.seed(0)
    actions.seed(0)
    observation: Any = environment.reset()
    for _ in range(25):
        action = np.array([actions.sample() for _ in range(2)])
        following, rewards, dones, infos = environment.step(action)
        buffer.add(observation, following, action, rewards, dones, infos)  # type: ignore[arg-type]
        observation = following
    # Of an episode's last step the library has the terminal observation from its info.
    valid = np.flatnonzero((buffer.ep_length > 0) & (buffer.dones == 0))
    rows, columns = np.unravel_index(valid, buffer.ep_length.shape)
    # With the goals that were desired, the reward is the one that was earned.
    again = environment.env_method(
        "compute_reward",
        buffer.next_observations["achieved_goal"][rows, columns],
        buffer.next_observations["desired_goal"][rows, columns],
        buffer.infos[rows, columns],
        indices=[0],
    )[0]
    np.testing.assert_allclose(again, buffer.rewards[rows, columns], rtol=1e-5, atol=1e-6)
    np.random.seed(0)  # noqa: NPY002 - the library draws from it
    sample = buffer.sample(32)
    assert np.isfinite(sample.rewards.numpy()).all()


@needs_parking
def test_parking_is_learned_kept_judged_and_resumed(tmp_path: Path) -> None:
    pytest.importorskip("highway_env")
    recipe = Recipe(
        "her-sac",
        "parking",
        150,
        n_envs=2,
        normalize={"norm_reward": False},
        env_kwargs={"time_limit": 2.0},
        policy_kwargs={"net_arch": [8]},
        hyperparameters={"learning_starts": 60, "batch_size": 16, "buffer_size": 100},
    )
    plan = TrainingPlan(recipe, {"backend": "physics"}, seed=1, checkpoint_every=50)
    whole = train_policy(plan, tmp_path / "whole")

    class Stopped(Exception):
        pass

    def stop(done: int, total: int, note: str) -> None:
        if done > 110:
            raise Stopped

    with pytest.raises(Stopped):
        train_policy(plan, tmp_path / "parts", progress=stop)
    resumed = train_policy(plan, tmp_path / "parts", resume=True)
    assert resumed.policy.content_hash == whole.policy.content_hash

    loaded = load_policy(tmp_path / "whole" / "policy.safetensors")
    found = evaluate(loaded, loaded.environment_spec(), episodes=2)
    assert found == evaluate(whole.policy, replace(plan).judging, episodes=2)
    assert found.success_rate is not None
    assert set(found.measures) >= {"position_error_rmse", "heading_error_rmse"}
    observation = loaded.environment_spec().make().reset(seed=0)[0]
    expected, _ = loaded.to_sb3().predict(loaded.normalize(observation), deterministic=True)
    np.testing.assert_allclose(loaded.act(observation), expected, atol=1e-5)
