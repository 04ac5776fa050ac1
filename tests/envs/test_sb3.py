"""The batch as stable-baselines3 takes it."""

import math
import subprocess
import sys
from typing import Any

import gymnasium
import numpy as np
import pytest

from grouser.envs import ActionDelay, ObservationNoise, PathTrackingEnv
from grouser.envs.sb3 import make_sb3_vec_env
from grouser.terrain import ConfigurationError, InvalidInputError

pytest.importorskip("stable_baselines3")
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor, VecNormalize

PATH, SPEED = "grouser/PathTracking-v0", "grouser/SpeedTracking-v0"
COARSE: dict[str, Any] = {"backend": "physics", "backend_options": {"cells": (2, 1)}}


def make(name: str = PATH, count: int = 3, **options: Any) -> Any:
    return make_sb3_vec_env(name, count, **(COARSE | options))


def drive(env: Any, steps: int) -> list[Any]:
    generator = np.random.default_rng(1)
    trace = [env.reset().copy()]
    for _ in range(steps):
        trace.append(env.step(generator.uniform(-1.0, 1.0, (env.num_envs, 2)).astype(np.float32)))
    return trace


def test_is_what_a_loop_over_single_environments_is() -> None:
    ours = make(time_limit=0.5, seed=9)
    theirs = DummyVecEnv([lambda: PathTrackingEnv(time_limit=0.5, **COARSE) for _ in range(3)])
    theirs.seed(9)
    trace, expected = drive(ours, 12), drive(theirs, 12)
    assert trace[0].tobytes() == expected[0].tobytes()
    for (observations, rewards, dones, infos), wanted in zip(trace[1:], expected[1:], strict=True):
        assert observations.tobytes() == wanted[0].tobytes()
        assert rewards == pytest.approx(wanted[1], rel=1e-6)  # theirs are float32
        assert dones.tolist() == wanted[2].tolist()
        for info, single, done in zip(infos, wanted[3], dones, strict=True):
            if not done:
                assert info == {}
                continue
            assert info["terminal_observation"].tobytes() == single["terminal_observation"].tobytes()
            assert info["TimeLimit.truncated"] is single["TimeLimit.truncated"] is True
            assert info["cross_track_error"] == single["cross_track_error"]


def test_statistics_are_those_counted_by_hand() -> None:
    env = make(SPEED, 4, time_limit=0.7, seed=0)
    returns, lengths, counted, times = np.zeros(4), np.zeros(4, int), 0, []
    for _, rewards, dones, infos in drive(env, 30)[1:]:
        returns += rewards
        lengths += 1
        for index in np.flatnonzero(dones):
            episode = infos[index]["episode"]
            assert episode["r"] == pytest.approx(returns[index], abs=1e-12)
            assert episode["l"] == lengths[index] == 7
            times.append(episode["t"])
            returns[index] = lengths[index] = 0
            counted += 1
    assert counted == 16
    assert times == sorted(times)


def test_an_end_that_is_no_time_limit() -> None:
    env = make(count=2, seed=0)
    env.reset()
    env._batch.fleet.numbers[0, 1] = math.nan
    _, rewards, dones, infos = env.step(np.zeros((2, 2), np.float32))
    assert dones.tolist() == [False, True]
    assert rewards[1] == -1.0 - 2.5**2
    assert infos[1]["diverged"] is True
    assert infos[1]["TimeLimit.truncated"] is False
    assert infos[0] == {}


def test_learns_without_a_warning() -> None:
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        env = make(SPEED, 8, time_limit=1.0, seed=0, threads=2)
        model = PPO("MlpPolicy", VecNormalize(env), n_steps=16, batch_size=32, n_epochs=2, seed=0, device="cpu")
        model.learn(400)
        assert model.ep_info_buffer is not None
        assert {entry["l"] for entry in model.ep_info_buffer} == {10}
        mean, _ = evaluate_policy(PPO("MlpPolicy", env, seed=0, device="cpu"), env, n_eval_episodes=3)
        assert isinstance(mean, float)
        assert 0.0 < mean < 20.0
    finally:
        torch.set_num_threads(threads)


def test_seeds_and_options_hold_for_one_reset() -> None:
    env = make(count=2, path="straight")
    assert list(env.seed(3)) == [3, 4]
    first = env.reset()
    second = env.reset()
    env.seed(3)
    assert env.reset().tobytes() == first.tobytes()
    assert env.reset().tobytes() == second.tobytes()
    env.set_options({"lateral_offset": 1.0})
    env.reset()
    assert [info["cross_track_error"] for info in env.reset_infos] == pytest.approx([1.0, 1.0])
    env.reset()
    assert abs(env.reset_infos[0]["cross_track_error"]) < 0.5


def test_what_sub_environments_share() -> None:
    env = make(count=3)
    assert env.get_attr("render_mode") == [None] * 3
    assert [vehicle.name for vehicle in env.get_attr("vehicle", [0, 2])] == ["m113", "m113"]
    assert env.has_attr("path")
    assert not env.has_attr("simulator")
    assert [foot.name for foot in env.get_attr("path", 1)] == ["iso-3888-1"]
    assert len(env.env_method("prepare_ground", "ice", indices=[0, 1])) == 2
    with pytest.raises(AttributeError, match="cannot be set"):
        env.set_attr("vehicle", None)
    assert list(env.get_images()) == [None] * 3
    with pytest.warns(UserWarning, match="Monitor"):
        VecMonitor(env)
    env.close()


def test_refusals() -> None:
    with pytest.raises(InvalidInputError, match="num_envs"):
        make(count=0)
    with pytest.raises(InvalidInputError, match="threads"):
        make(threads=0)
    env = make(count=2)
    env.reset()
    with pytest.raises(InvalidInputError, match=r"\[-1, 1\]"):
        env.step(np.full((2, 2), math.nan))
    with pytest.raises(InvalidInputError, match="shape"):
        env.step(np.zeros((3, 2)))


def test_without_stable_baselines_the_extra_is_named() -> None:
    script = (
        "import sys\n"
        "sys.modules['stable_baselines3'] = None\n"
        "from grouser.envs.sb3 import make_sb3_vec_env\n"
        "from grouser.terrain import ConfigurationError\n"
        "try:\n"
        "    make_sb3_vec_env('grouser/PathTracking-v0', 1, backend='physics')\n"
        "except ConfigurationError as error:\n"
        "    assert 'grouser[rl]' in str(error), error\n"
        "else:\n"
        "    raise SystemExit('made')\n"
    )
    subprocess.run([sys.executable, "-P", "-c", script], check=True)


def test_another_environment_is_refused() -> None:
    with pytest.raises((ConfigurationError, TypeError)):
        make_sb3_vec_env("CartPole-v1", 2)


@pytest.mark.parametrize("name", [PATH, SPEED])
def test_randomization_noise_and_delay_are_those_of_single_environments(name: str) -> None:
    """Terminal observations included."""
    settings: dict[str, Any] = {"time_limit": 0.5, "randomize": {"terrain": "wide", "yaw_inertia": (0.8, 1.25)}}
    ours = make(name, seed=9, observation_noise=0.05, action_delay=(0, 3), **settings)

    def single() -> Any:
        env: Any = gymnasium.make(name, **COARSE, **settings)
        return ObservationNoise(ActionDelay(env, (0, 3)), 0.05)

    theirs = DummyVecEnv([single] * 3)
    theirs.seed(9)
    trace, expected = drive(ours, 12), drive(theirs, 12)
    assert trace[0].tobytes() == expected[0].tobytes()
    for (observations, rewards, dones, infos), wanted in zip(trace[1:], expected[1:], strict=True):
        assert observations.tobytes() == wanted[0].tobytes()
        assert rewards == pytest.approx(wanted[1], rel=1e-6)  # theirs are float32
        assert dones.tolist() == wanted[2].tolist()
        for index in np.flatnonzero(dones):
            assert infos[index]["terminal_observation"].tobytes() == wanted[3][index]["terminal_observation"].tobytes()
    assert ours.reset_infos == theirs.reset_infos


def test_a_reward_of_ones_own_is_what_is_learned_from() -> None:
    env = make(SPEED, 2, seed=0, reward=lambda view: -np.abs(view.measures["speed_error"]))
    env.reset()
    rewards = env.step(np.zeros((2, 2), np.float32))[1]
    assert rewards.tolist() == (-np.abs(env._batch.measures[:, 0])).tolist()


def test_reconfigured_once_for_all() -> None:
    env = make(count=3, path="straight")
    env.reset()
    assert env.env_method("reconfigure", lateral_spread=1.0, heading_spread=0.0) == [None] * 3
    env.seed(2)
    env.reset()
    assert max(abs(info["cross_track_error"]) for info in env.reset_infos) > 0.2
    with pytest.raises(ConfigurationError, match="share one task"):
        env.env_method("reconfigure", indices=[0], lateral_spread=0.1)


def test_frames_of_the_first_few() -> None:
    pytest.importorskip("pygame")
    env = make(count=3, render_mode="rgb_array", rendered_envs=2)
    env.reset()
    assert env.render_mode == "rgb_array"
    first, second = env.get_images()
    assert first.shape == second.shape == (540, 960, 3)
    assert not np.array_equal(first, second)
    # stable-baselines3 tiles them into one picture.
    assert env.render().shape[2] == 3
    env.close()


def test_impossible_noise_and_delay_are_refused() -> None:
    with pytest.raises(InvalidInputError, match="standard deviations"):
        make(observation_noise=-0.1)
    with pytest.raises(InvalidInputError, match="control periods"):
        make(action_delay=-1)
