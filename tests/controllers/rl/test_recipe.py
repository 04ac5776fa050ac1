"""Recipes: what a file may say, and what is refused by its nearest name."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

from grouser.controllers import Recipe
from grouser.controllers.rl import environment_ids, read_value, recipe_text, shipped_recipes, short_name
from grouser.terrain import ConfigurationError, InvalidInputError

SMALL = """
algorithm: ppo
environment: path-tracking
n_timesteps: 1_000
n_envs: 2
env_kwargs: {time_limit: 4.0}
policy_kwargs: {net_arch: [8, 8], log_std_init: -1}
learning_rate: 3e-4
clip_range: lin_0.2
"""


def write(folder: Path, text: str) -> Path:
    file = folder / "recipe.yml"
    file.write_text(text, encoding="utf-8")
    return file


def test_a_file_is_read_as_it_is_written(tmp_path: Path) -> None:
    recipe = Recipe.load(write(tmp_path, SMALL))
    assert (recipe.algorithm, recipe.environment) == ("ppo", "grouser/PathTracking-v0")
    assert (recipe.n_timesteps, recipe.n_envs, recipe.normalize) == (1000, 2, False)
    assert recipe.architecture.net_arch == (8, 8)
    assert recipe.hyperparameters == {"learning_rate": 3e-4, "clip_range": "lin_0.2"}
    assert recipe.name == "ppo-path-tracking"


SHIPPED = [
    (name, short_name(id))
    for name in shipped_recipes()
    for id in environment_ids()
    if name.endswith(f"-{short_name(id)}")
]


@pytest.mark.parametrize(("name", "environment"), SHIPPED)
def test_a_shipped_recipe_is_whole_and_called_after_what_it_says(name: str, environment: str) -> None:
    recipe = Recipe.shipped(name.removesuffix(f"-{environment}"), environment)
    assert recipe.name == name
    assert recipe_text(name).splitlines()


def test_a_linear_schedule_falls_from_its_start_to_zero(tmp_path: Path) -> None:
    clip = Recipe.load(write(tmp_path, SMALL)).arguments()["clip_range"]
    assert [clip(remaining) for remaining in (1.0, 0.5, 0.0)] == pytest.approx([0.2, 0.1, 0.0])


def test_a_key_is_changed_wherever_it_stands(tmp_path: Path) -> None:
    recipe = Recipe.load(write(tmp_path, SMALL))
    changed = recipe.changed({"n_envs": 4, "gamma": 0.9, "policy_kwargs.activation": "relu", "env_kwargs.grade": 0.1})
    assert (changed.n_envs, changed.hyperparameters["gamma"]) == (4, 0.9)
    assert changed.policy_kwargs == {"net_arch": [8, 8], "log_std_init": -1, "activation": "relu"}
    assert changed.env_kwargs == {"time_limit": 4.0, "grade": 0.1}
    assert recipe.changed({}) == recipe


@pytest.mark.parametrize(
    ("text", "value"),
    [("3e-4", 3e-4), ("1e5", 1e5), ("true", True), ("[64, 64]", [64, 64]), ("lin_1e-3", "lin_1e-3"), ("2", 2)],
)
def test_a_value_is_read_as_in_a_file(text: str, value: Any) -> None:
    assert read_value(text) == value
    assert type(read_value(text)) is type(value)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("learning_rat: 1", "learning_rat.*did you mean 'learning_rate'"),
        ("n_env: 4", "did you mean 'n_envs'"),
        ("buffer_size: 10", "unknown key of a ppo recipe 'buffer_size'"),
        ("policy_kwargs: {net_arc: [8]}", "did you mean 'net_arch'"),
        ("policy_kwargs: {activation: tahn}", "did you mean 'tanh'"),
        ("normalize: {norm_ob: true}", "did you mean 'norm_obs'"),
        ("algorithm: pop", "did you mean 'ppo'"),
        ("environment: path-trackin", "did you mean 'path-tracking'"),
        ("use_sde: true", "use_sde"),
    ],
)
def test_an_unknown_key_is_refused_with_the_nearest_one(tmp_path: Path, line: str, message: str) -> None:
    key = line.split(":")[0]
    text = "\n".join(each for each in SMALL.splitlines() if not each.startswith(f"{key}:")) + f"\n{line}\n"
    with pytest.raises(ConfigurationError, match=message):
        Recipe.load(write(tmp_path, text))


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("n_timesteps", 0),
        ("n_envs", 1.5),
        ("learning_rate", -1.0),
        ("learning_rate", float("nan")),
        ("learning_rate", "lin_fast"),
        ("gamma", 1.1),
        ("batch_size", "many"),
        ("policy_kwargs.net_arch", [8, 0]),
        ("policy_kwargs.net_arch", "8,8"),
        ("env_kwargs", 3),
    ],
)
def test_an_impossible_value_is_refused_by_name(tmp_path: Path, key: str, value: Any) -> None:
    with pytest.raises(InvalidInputError, match=key.split(".")[-1]):
        Recipe.load(write(tmp_path, SMALL)).changed({key: value})


@pytest.mark.parametrize("text", ["", "- a\n- b\n", "a: [", "!!python/object/apply:os.getcwd []"])
def test_what_is_no_recipe_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises((InvalidInputError, ConfigurationError), match=r"recipe\.yml"):
        Recipe.load(write(tmp_path, text))


def test_a_missing_file_and_a_missing_recipe_are_named(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="none"):
        Recipe.load(tmp_path / "none.yml")
    with pytest.raises(ConfigurationError, match="no recipe is shipped for her-sac on path-tracking"):
        Recipe.shipped("her-sac", "path-tracking")


def test_a_missing_library_is_named_with_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = write(tmp_path, SMALL)
    monkeypatch.setitem(sys.modules, "yaml", None)
    with pytest.raises(ConfigurationError, match=r"grouser\[rl\]"):
        Recipe.load(file)
