"""A curriculum, noise and delay as parts of a recipe: what they change, from when on, and what is refused."""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pytest

from grouser.controllers import EnvironmentSpec, Policy, Recipe, TrainingPlan, load_policy, train_policy
from grouser.controllers.rl import environment as environment_module
from grouser.controllers.rl.checkpoint import read_checkpoint
from grouser.controllers.rl.curriculum import read_stages, rehearse
from grouser.terrain import ConfigurationError, InvalidInputError

SETTINGS: dict[str, Any] = {"action_mode": "twist", "random_start": True, "time_limit": 1.5, "lateral_spread": 0.2}
STAGE = {"at": 0.5, "settings": {"lateral_spread": 0.6}}
RECIPE = Recipe(
    "ppo",
    "path-tracking",
    512,
    n_envs=4,
    env_kwargs=SETTINGS,
    policy_kwargs={"net_arch": [8]},
    hyperparameters={"n_steps": 16, "batch_size": 64, "n_epochs": 1, "learning_rate": 1e-2},
)
SAC = Recipe(
    "sac",
    "path-tracking",
    192,
    n_envs=2,
    normalize=True,
    env_kwargs=SETTINGS,
    policy_kwargs={"net_arch": [8]},
    hyperparameters={"learning_starts": 40, "batch_size": 16, "buffer_size": 120, "train_freq": 2},
)
PLACE = {"backend": "physics", "path": "straight"}
TRACKING = EnvironmentSpec("grouser/PathTracking-v0", {**PLACE, **SETTINGS})


def plan(recipe: Recipe = RECIPE, every: int = 0, **changes: Any) -> TrainingPlan:
    return TrainingPlan(recipe.changed(changes), PLACE, seed=3, checkpoint_every=every)


def weights(policy: Policy) -> dict[str, bytes]:
    found = {name: array.tobytes() for name, array in policy.weights.items()}
    statistics = {} if policy.normalizer is None else policy.normalizer.to_tensors()
    return found | {name: array.tobytes() for name, array in statistics.items()}


class Stopped(Exception):
    """A training that was interrupted."""


def stop_at(steps: int) -> Any:
    def progress(done: int, total: int, note: str) -> None:
        if done >= steps:
            raise Stopped

    return progress


def test_a_stage_changes_what_is_learned_from_its_share_of_the_steps_on(tmp_path: FilePath) -> None:
    train_policy(plan(every=128), tmp_path / "plain")
    train_policy(plan(every=128, curriculum=[STAGE]), tmp_path / "staged")
    for steps in (128, 256, 384):
        kept = (load_policy(tmp_path / run / "policies" / f"{steps:09d}.safetensors") for run in ("plain", "staged"))
        plain, staged = (weights(policy) for policy in kept)
        assert (plain == staged) == (steps <= 256)


def test_a_stage_that_changes_nothing_changes_no_weight() -> None:
    same = {"at": 0.3, "settings": {"lateral_spread": 0.2}}
    assert weights(train_policy(plan(curriculum=[same])).policy) == weights(train_policy(plan()).policy)


def test_no_noise_and_no_delay_change_no_weight_and_some_do() -> None:
    without = weights(train_policy(plan()).policy)
    assert weights(train_policy(plan(observation_noise=0.0, action_delay=0)).policy) == without
    assert weights(train_policy(plan(observation_noise=0.1)).policy) != without
    assert weights(train_policy(plan(action_delay=[1, 2])).policy) != without


@pytest.mark.parametrize("recipe", [RECIPE, SAC], ids=["ppo", "sac"])
@pytest.mark.parametrize("at", [1 / 3, 0.5], ids=["at a checkpoint", "between two"])
def test_an_interrupted_training_ends_at_the_same_weights(recipe: Recipe, at: float, tmp_path: FilePath) -> None:
    third = recipe.n_timesteps // 3
    stages = [{"at": at, "settings": {"lateral_spread": 0.6}}, {"at": 0.9, "settings": {"heading_spread": 0.3}}]
    made = plan(recipe, third, curriculum=stages, observation_noise=0.05, action_delay=[0, 2])
    whole = train_policy(made, tmp_path / "whole")
    for stop in (third + 64, 2 * third + 64):
        folder = tmp_path / f"stopped at {stop}"
        with pytest.raises(Stopped):
            train_policy(made, folder, progress=stop_at(stop))
        assert 0 < read_checkpoint(folder / "checkpoint.safetensors")[1]["steps"] < whole.steps
        resumed = train_policy(made, folder, resume=True)
        assert weights(resumed.policy) == weights(whole.policy)


def test_another_curriculum_is_another_training(tmp_path: FilePath) -> None:
    train_policy(plan(every=256, curriculum=[STAGE]), tmp_path)
    with pytest.raises(ConfigurationError, match=r"recipe\.action_delay null there, 1 asked"):
        train_policy(plan(every=256, curriculum=[STAGE], action_delay=1), tmp_path, resume=True)
    with pytest.raises(ConfigurationError, match=r"recipe\.curriculum"):
        train_policy(plan(every=256), tmp_path, resume=True)


def test_environments_in_turn_are_disturbed_as_the_batch_is(monkeypatch: pytest.MonkeyPatch) -> None:
    disturbances: dict[str, Any] = {"observation_noise": 0.05, "action_delay": (0, 2)}
    batch = TRACKING.make_vec_env(3, **disturbances)
    monkeypatch.setattr(environment_module, "_has_vector_class", lambda id: False)
    in_turn = TRACKING.make_vec_env(3, **disturbances)
    assert type(in_turn) is not type(batch)
    generator = np.random.default_rng(5)
    for environment in (batch, in_turn):
        environment.seed(11)
    assert np.array_equal(batch.reset(), in_turn.reset())  # type: ignore[arg-type]
    for _ in range(40):
        actions = generator.uniform(-1.0, 1.0, (3, 2)).astype(np.float32)
        (seen, _, dones, _), (expected, _, ends, _) = batch.step(actions), in_turn.step(actions)
        assert np.array_equal(seen, expected)  # type: ignore[arg-type]
        assert np.array_equal(dones, ends)


def test_a_recipe_of_yaml_holds_them(tmp_path: FilePath) -> None:
    file = tmp_path / "mine.yml"
    file.write_text(
        "algorithm: ppo\nenvironment: path-tracking\nn_timesteps: 1000\nobservation_noise: 1e-2\naction_delay: [0, 2]\n"
        "curriculum:\n- {at: 0.25, settings: {lateral_spread: 0.4}}\n- at: 5e-1\n  settings: {heading_spread: 0.2}\n"
    )
    recipe = Recipe.load(file)
    assert [(stage.first_step(1000), dict(stage.settings)) for stage in recipe.stages] == [
        (250, {"lateral_spread": 0.4}),
        (500, {"heading_spread": 0.2}),
    ]
    assert recipe.disturbances == {"observation_noise": 0.01, "action_delay": (0, 2)}


@pytest.mark.parametrize(
    ("curriculum", "error", "message"),
    [
        ("later", InvalidInputError, "a list of stages, got 'later'"),
        ([0.5], InvalidInputError, "keys at and settings, got 0.5"),
        ([{"att": 0.5, "settings": {"a": 1}}], ConfigurationError, "did you mean 'at'"),
        ([{"settings": {"a": 1}}], InvalidInputError, "above 0 and below 1, got None"),
        ([{"at": 1.0, "settings": {"a": 1}}], InvalidInputError, "above 0 and below 1, got 1.0"),
        ([{"at": float("nan"), "settings": {"a": 1}}], InvalidInputError, "below 1, got nan"),
        ([STAGE, STAGE], InvalidInputError, "above 0.5 and below 1, got 0.5"),
        ([{"at": 0.5}], InvalidInputError, "settings of a stage .* got None"),
    ],
)
def test_what_is_no_curriculum_is_refused(curriculum: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        read_stages(curriculum)


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"curriculum": [{"at": 0.9, "settings": {"lateral_spred": 0.5}}]}, ConfigurationError, "lateral_spread"),
        ({"curriculum": [{"at": 0.9, "settings": {"time_limit": 5.0}}]}, ConfigurationError, "time_limit"),
        ({"curriculum": [{"at": 0.9, "settings": {"lateral_spread": -1.0}}]}, InvalidInputError, "lateral_spread"),
        ({"observation_noise": -0.1}, InvalidInputError, "standard deviations"),
        ({"action_delay": [2, 1]}, InvalidInputError, "delay"),
        ({"action_delay": "soon"}, InvalidInputError, "delay"),
    ],
)
def test_what_the_environment_does_not_take_is_refused_before_anything_is_learned(
    changes: dict[str, Any], error: type[Exception], message: str, tmp_path: FilePath
) -> None:
    with pytest.raises(error, match=message):
        train_policy(plan(**changes), tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_an_environment_whose_settings_stay_takes_no_curriculum() -> None:
    with pytest.raises(ConfigurationError, match="Pendulum-v1 has no settings that change"):
        rehearse(EnvironmentSpec("Pendulum-v1"), read_stages([STAGE]))
