"""A policy that has hardly learned anything: trained, judged, driven."""

from pathlib import Path
from typing import Any

import pytest

from grouser.controllers import TrackingPolicy

SHORT = ("--steps", 128, "--environments", 2, "--rollout-steps", 64, "--batch-size", 64, "--epochs", 1, "--hidden", "8")


@pytest.fixture(scope="module")
def policy(call: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    file: Path = tmp_path_factory.mktemp("rl") / "policy.safetensors"
    assert "steps: 128/128" in call("rl", "train", file, "--backend", "physics", *SHORT).err
    return file


def test_training_keeps_its_recipe(policy: Path) -> None:
    made = TrackingPolicy.load(policy)
    assert (made.recipe["steps"], made.recipe["hidden"], made.recipe["seed"]) == (128, [8], 0)
    assert made.recipe["backend"]["backend"] == "physics"
    assert (made.config.action_mode, made.config.reference_speed) == ("twist", 5.0)


def test_training_on_a_surrogate_names_it(call: Any, artifact: Path, tmp_path: Path) -> None:
    file = tmp_path / "policy.safetensors"
    call("rl", "train", file, "--artifact", artifact, "--action-mode", "belts", "--observe-terrain", *SHORT)
    made = TrackingPolicy.load(file)
    assert len(made.recipe["backend"]["artifact"]) == 64
    assert made.config.action_mode == "belts"
    refused = call("rl", "evaluate", file, "--terrain", "lete-sand", code=2)
    assert "trained on another mode than soil" in refused.err


def test_evaluation_repeats_itself(call: Any, policy: Path, artifact: Path) -> None:
    options = ("--episodes", 2, "--time-limit", 3, "--seed", 4)
    first, again = (call("rl", "evaluate", policy, *options) for _ in range(2))
    assert first.out == again.out
    assert "over 2 episodes" in first.out
    assert first.out.count("time ran out") == 2
    other = call("rl", "evaluate", policy, "--backend", "native", "--artifact", artifact, *options)
    assert other.out != first.out


def test_a_policy_drives(call: Any, policy: Path, short_path: Path, tmp_path: Path) -> None:
    options = ("--controller", policy, "--path", short_path, "--time-limit", 1)
    assert "driven" in call("drive", "--backend", "physics", *options).out
    compared = call("compare", "--backends", "physics", *options, "--output", tmp_path)
    assert (tmp_path / "asphalt-policy.png").exists()
    assert "policy" in compared.out
    assert "pass --vehicle" in call("drive", "--backend", "physics", *options, "--vehicle", "marder", code=2).err


def test_a_policys_file_is_named_before_training(call: Any, tmp_path: Path) -> None:
    assert "ends in .safetensors" in call("rl", "train", tmp_path / "policy.zip", code=2).err
