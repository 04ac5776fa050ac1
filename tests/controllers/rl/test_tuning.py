"""A search goes on where it was left, and is of one plan."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from grouser.controllers import Recipe, TrainingPlan
from grouser.controllers.rl import tune, tuning
from grouser.controllers.rl.tuning import suggest
from grouser.terrain import ConfigurationError, InvalidInputError

PPO = Recipe("ppo", "path-tracking", 32, n_envs=1, env_kwargs={"time_limit": 1.0})
PLAN = TrainingPlan(PPO, {"backend": "physics", "path": "straight"}, eval_episodes=1)


def test_a_search_goes_on_where_it_was_left(tmp_path: Path) -> None:
    pytest.importorskip("optuna")
    told: list[tuple[int, int, float]] = []
    first = tune(PLAN, tmp_path, trials=1, progress=lambda *words: told.append(words))
    second = tune(PLAN, tmp_path, trials=2, progress=lambda *words: told.append(words))
    assert (first.trials, second.trials) == (1, 2)
    assert [words[:2] for words in told] == [(1, 1), (2, 2)]
    assert second.return_mean >= first.return_mean
    assert second.recipe == PPO.changed(second.overrides)
    with pytest.raises(ConfigurationError, match="another recipe"):
        tune(replace(PLAN, recipe=PPO.changed({"n_envs": 4})), tmp_path, trials=3)


@pytest.mark.parametrize("algorithm", ["ppo", "sac", "tqc"])
def test_whatever_is_suggested_is_a_recipe(algorithm: str) -> None:
    optuna = pytest.importorskip("optuna")
    study: Any = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=0))
    recipe = replace(PPO, algorithm=algorithm)
    for _ in range(20):
        changed = recipe.changed(suggest(study.ask(), recipe))
        if algorithm == "ppo":
            assert changed.hyperparameters["batch_size"] <= changed.hyperparameters["n_steps"] * changed.n_envs


def test_there_must_be_a_trial(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="trials"):
        tune(PLAN, tmp_path, trials=0)


def test_a_missing_library_is_named_with_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "optuna", None)
    with pytest.raises(ConfigurationError, match=r"grouser\[tune\]"):
        tune(PLAN, tmp_path, trials=1)


def test_trials_that_diverge_are_passed_over_and_said_of_a_search_of_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("optuna")

    def diverge(*args: Any, **kwargs: Any) -> Any:
        raise ValueError("Expected parameter loc to satisfy the constraint Real()")

    monkeypatch.setattr(tuning, "train_policy", diverge)
    with pytest.raises(ConfigurationError, match="each of 2 trials diverged"):
        tune(PLAN, tmp_path, trials=2)
