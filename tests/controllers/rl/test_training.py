"""A tiny training: repeatable, resumed to the same weights, judged on the way, torch's threads left as they were."""

from __future__ import annotations

import json
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pytest
import torch

from grouser.controllers import Policy, PolicyDriver, Recipe, TrainingPlan, TrainingResult, load_policy, train_policy
from grouser.controllers.rl import read_curve
from grouser.controllers.rl.checkpoint import read_checkpoint
from grouser.envs import Simulator, rollout
from grouser.envs.paths import straight
from grouser.terrain import ArtifactError, ConfigurationError, InvalidInputError, TrackedVehicle, named

SETTINGS: dict[str, Any] = {
    "action_mode": "twist",
    "reference_speed": 4.0,
    "random_start": True,
    "time_limit": 2.0,
}
PPO = Recipe(
    "ppo",
    "path-tracking",
    600,
    n_envs=4,
    env_kwargs=SETTINGS,
    eval_env_kwargs={"random_start": False},
    policy_kwargs={"net_arch": [12, 8], "log_std_init": -0.5},
    hyperparameters={"n_steps": 32, "batch_size": 64, "n_epochs": 2, "learning_rate": "lin_1e-2", "gamma": 0.9},
)
SAC = Recipe(
    "sac",
    "path-tracking",
    160,
    n_envs=2,
    normalize=True,
    env_kwargs=SETTINGS,
    policy_kwargs={"net_arch": [8], "activation": "relu"},
    hyperparameters={"learning_starts": 40, "batch_size": 16, "buffer_size": 120, "train_freq": 2},
)
PLACE = {"backend": "physics", "path": "straight"}
PLAN = TrainingPlan(PPO, PLACE, seed=3)


@pytest.fixture
def four_threads() -> Iterator[int]:
    """Torch with another number of threads than training takes."""
    before = torch.get_num_threads()
    torch.set_num_threads(4)
    yield 4
    torch.set_num_threads(before)


@pytest.fixture(scope="module")
def trained() -> tuple[TrainingResult, list[tuple[int, int]]]:
    said: list[tuple[int, int]] = []
    return train_policy(PLAN, progress=lambda done, total, _: said.append((done, total))), said


def weights(policy: Policy) -> dict[str, bytes]:
    found = {name: array.tobytes() for name, array in policy.weights.items()}
    return (
        found
        if policy.normalizer is None
        else found | {name: array.tobytes() for name, array in policy.normalizer.to_tensors().items()}
    )


def test_without_a_folder_the_library_makes_none_of_its_own(
    tmp_path: FilePath, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    train_policy(replace(PLAN, recipe=replace(PPO, n_timesteps=128)))
    assert not list(tmp_path.glob("SB3-*"))


class Stopped(Exception):
    """A training that was interrupted."""


def interrupted(plan: TrainingPlan, folder: FilePath, after: int) -> None:
    """Train into a folder until some steps are done."""

    def stop(done: int, total: int, note: str) -> None:
        if done >= after:
            raise Stopped

    with pytest.raises(Stopped):
        train_policy(plan, folder, progress=stop)


def test_equal_plans_give_equal_weights_whatever_the_threads(trained: Any, four_threads: int) -> None:
    torch.rand(7)
    np.random.default_rng().random(3)
    again = train_policy(replace(PLAN, threads=2))
    assert weights(again.policy) == weights(trained[0].policy)
    assert torch.get_num_threads() == four_threads


def test_another_seed_gives_other_weights(trained: Any) -> None:
    short = replace(PLAN, recipe=PPO.changed({"n_timesteps": 128}))
    first, second = (weights(train_policy(replace(short, seed=seed)).policy) for seed in (3, 4))
    assert first != second


def test_the_number_of_threads_is_restored_after_a_failure(four_threads: int) -> None:
    with pytest.raises(ConfigurationError, match="action_mode"):
        train_policy(replace(PLAN, environment={**PLACE, "action_mod": "twist"}))
    assert torch.get_num_threads() == four_threads


def test_steps_are_rounded_up_to_whole_rollouts_and_reported(trained: Any) -> None:
    result, said = trained
    assert result.steps == 640
    assert [done for done, _ in said] == [128, 256, 384, 512, 600]
    assert {total for _, total in said} == {600}


def test_a_policy_knows_its_task_and_how_it_was_trained(trained: Any, tmp_path: FilePath) -> None:
    policy = load_policy(trained[0].policy.save(tmp_path / "policy.safetensors"))
    assert policy.environment["id"] == "grouser/PathTracking-v0"
    assert policy.environment["arguments"] == {**PLACE, **SETTINGS, "vehicle": "m113", "terrain": "asphalt"}
    assert policy.environment["settings"]["control_period"] == 0.1
    assert policy.environment["backend"]["backend"] == "physics"
    assert {key: policy.recipe[key] for key in PPO.to_json()} == json.loads(json.dumps(PPO.to_json()))
    assert (policy.recipe["seed"], policy.recipe["steps"]) == (3, 640)
    assert set(policy.recipe["versions"]) >= {"grouser", "torch", "stable-baselines3"}


def test_a_trained_policy_drives_a_bare_simulator(trained: Any) -> None:
    vehicle, asphalt = TrackedVehicle.preset("m113"), named("asphalt")
    driver = PolicyDriver(trained[0].policy, straight(), asphalt)
    log = rollout(Simulator(vehicle, "physics", asphalt), driver, 1.0)
    assert np.abs(log.commands).max() <= vehicle.training_speed


@pytest.mark.parametrize("recipe", [PPO, SAC, replace(SAC, algorithm="tqc")], ids=["ppo", "sac", "tqc"])
def test_the_library_and_the_actor_agree_after_training(recipe: Recipe) -> None:
    policy = train_policy(replace(PLAN, recipe=recipe.changed({"n_timesteps": 128}))).policy
    rows = np.random.default_rng(0).uniform(-3.0, 3.0, (300, 19)).astype(np.float32)
    expected, _ = policy.to_sb3().predict(policy.normalize(rows), deterministic=True)
    np.testing.assert_allclose(policy.act(rows), expected, atol=1e-5)


def test_statistics_are_those_of_the_library(tmp_path: FilePath) -> None:
    policy = train_policy(replace(PLAN, recipe=SAC.changed({"n_timesteps": 60}))).policy
    assert policy.normalizer is not None
    environment = policy.environment_spec().make_vec_env(2)
    wrapped = policy.normalizer.wrap(environment)
    rows: Any = np.random.default_rng(0).uniform(-3.0, 3.0, (50, 19)).astype(np.float32)
    expected: Any = wrapped.normalize_obs(rows)
    assert np.array_equal(expected, policy.normalize(rows))
    assert not np.array_equal(policy.normalize(rows), rows)


@pytest.mark.parametrize("recipe", [PPO, SAC], ids=["ppo", "sac"])
def test_an_interrupted_training_ends_at_the_same_weights(recipe: Recipe, tmp_path: FilePath) -> None:
    third = recipe.n_timesteps // 3
    plan = TrainingPlan(
        recipe, PLACE, seed=5, checkpoint_every=third, eval_every=third, eval_episodes=2, eval_environment=PLACE
    )
    whole = train_policy(plan, tmp_path / "whole")
    assert weights(train_policy(plan).policy) == weights(whole.policy)
    interrupted(plan, tmp_path / "parts", after=2 * third)
    steps = read_checkpoint(tmp_path / "parts" / "checkpoint.safetensors")[1]["steps"]
    assert 0 < steps < whole.steps
    # Whatever has been drawn in between.
    torch.rand(5)
    resumed = train_policy(plan, tmp_path / "parts", resume=True)
    assert weights(resumed.policy) == weights(whole.policy)
    assert resumed.curve == whole.curve
    for name in ("policy.safetensors", "best.safetensors", "evaluations.jsonl", "run.json"):
        assert (tmp_path / "parts" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_the_best_policy_of_the_curve_is_kept(tmp_path: FilePath) -> None:
    plan = replace(PLAN, eval_every=128, eval_episodes=3, eval_environment={"backend": "exact"})
    result = train_policy(plan, tmp_path)
    returns = [entry["return_mean"] for entry in result.curve]
    assert [entry["steps"] for entry in result.curve] == [128, 256, 384, 512, 640]
    assert read_curve(tmp_path) == list(result.curve)
    best = load_policy(tmp_path / "best.safetensors")
    assert best.recipe["steps"] == result.curve[int(np.argmax(returns))]["steps"]
    assert result.best is not None
    assert best.content_hash == result.best.content_hash
    assert list((tmp_path / "tensorboard").iterdir())


def test_judging_does_not_change_what_is_learned(trained: Any, tmp_path: FilePath) -> None:
    judged = train_policy(replace(PLAN, eval_every=128, eval_episodes=2))
    assert weights(judged.policy) == weights(trained[0].policy)


def test_a_policy_is_kept_with_every_checkpoint(tmp_path: FilePath) -> None:
    train_policy(replace(PLAN, checkpoint_every=256), tmp_path)
    kept = sorted((tmp_path / "policies").iterdir())
    assert [load_policy(file).recipe["steps"] for file in kept] == [256, 512]


@pytest.fixture(scope="module")
def stopped(tmp_path_factory: pytest.TempPathFactory) -> FilePath:
    folder = tmp_path_factory.mktemp("stopped") / "run"
    interrupted(replace(PLAN, checkpoint_every=128), folder, after=256)
    return folder


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"seed": 4}, "seed 3 there, 4 asked"),
        ({"checkpoint_every": 256}, "checkpoint_every 128 there, 256 asked"),
        ({"recipe": PPO.changed({"gamma": 0.95})}, r"recipe\.hyperparameters\.gamma 0.9 there, 0.95 asked"),
        ({"recipe": PPO.changed({"ent_coef": 0.01})}, r"ent_coef null there, 0.01 asked"),
        ({"environment": {**PLACE, "terrain": "ice"}}, r'terrain "asphalt" there, "ice" asked'),
        ({"environment": {**PLACE, "backend": "exact"}}, r'backend "physics" there, "exact" asked'),
    ],
)
def test_resuming_with_another_configuration_is_refused(stopped: FilePath, changes: Any, message: str) -> None:
    plan = replace(PLAN, checkpoint_every=128)
    with pytest.raises(ConfigurationError, match=message):
        train_policy(replace(plan, **changes), stopped, resume=True)


def test_a_folder_with_a_training_is_not_overwritten(stopped: FilePath) -> None:
    with pytest.raises(ConfigurationError, match="resume"):
        train_policy(replace(PLAN, checkpoint_every=128), stopped)


def test_there_must_be_something_to_resume(tmp_path: FilePath) -> None:
    with pytest.raises(ConfigurationError, match="no training to resume"):
        train_policy(PLAN, tmp_path, resume=True)
    with pytest.raises(ConfigurationError, match="in a folder"):
        train_policy(PLAN, resume=True)


@pytest.mark.parametrize("damage", ["truncated", "flipped", "missing"])
def test_a_damaged_checkpoint_is_refused(stopped: FilePath, tmp_path: FilePath, damage: str) -> None:
    folder = tmp_path / "run"
    shutil.copytree(stopped, folder)
    file = folder / "checkpoint.safetensors"
    data = file.read_bytes()
    file.write_bytes(data[:-7] if damage == "truncated" else data[:-7] + bytes([data[-7] ^ 1]) + data[-6:])
    if damage == "missing":
        file.unlink()
    with pytest.raises(ArtifactError, match="checkpoint"):
        train_policy(replace(PLAN, checkpoint_every=128), folder, resume=True)


def test_a_checkpoint_holds_no_pickle(stopped: FilePath, monkeypatch: pytest.MonkeyPatch, tmp_path: FilePath) -> None:
    import pickle

    def refuse(*args: Any, **kwargs: Any) -> Any:
        raise AssertionError("unpickled")

    folder = tmp_path / "run"
    shutil.copytree(stopped, folder)
    for name in ("load", "loads", "Unpickler"):
        monkeypatch.setattr(pickle, name, refuse)
    monkeypatch.setattr(torch, "load", refuse)
    assert train_policy(replace(PLAN, checkpoint_every=128), folder, resume=True).steps == 640


def test_goals_are_relabelled_only_where_there_are_some() -> None:
    recipe = Recipe("her-sac", "path-tracking", 100, env_kwargs=SETTINGS)
    with pytest.raises(ConfigurationError, match="has none"):
        train_policy(TrainingPlan(recipe, PLACE))


def test_a_missing_library_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    with pytest.raises(ConfigurationError, match=r"grouser\[rl\]"):
        train_policy(PLAN)


@pytest.mark.parametrize(
    ("name", "value"), [("seed", -1), ("threads", 0), ("eval_every", -1), ("eval_episodes", 0), ("threads", 1.5)]
)
def test_impossible_plans_are_refused(name: str, value: Any) -> None:
    with pytest.raises(InvalidInputError, match=name):
        TrainingPlan(PPO, **{name: value})
