"""Policies that have hardly learned anything: trained, judged, filmed, recorded, driven; and what is refused."""

import json
from pathlib import Path
from typing import Any, get_args

import pytest

from grouser.cli.rl._options import Algorithm
from grouser.controllers import load_policy
from grouser.controllers.rl import ALGORITHMS

SHORT = (
    *("--steps", 128, "--envs", 2, "-p", "n_steps=32", "-p", "batch_size=64", "-p", "n_epochs=1"),
    *("-p", "policy_kwargs.net_arch=[8]", "-e", "time_limit=2.0"),
)
BRIEF = ("-e", "time_limit=1.0")


@pytest.fixture(scope="module")
def run(call: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp("rl") / "run"
    said = call(
        *("rl", "train", "path-tracking", "-o", folder, "--backend", "physics", "--eval-backend", "exact"),
        *("--eval-episodes", 1, "--eval-every", 64, "--checkpoint-every", 64, *SHORT),
    )
    assert "steps: 128/128" in said.err
    assert "grouser rl eval" in said.out
    return folder


@pytest.fixture(scope="module")
def policy(run: Path) -> Path:
    return run / "policy.safetensors"


def test_training_keeps_its_recipe_and_where_it_was(run: Path, policy: Path) -> None:
    made = load_policy(policy)
    assert (made.recipe["n_timesteps"], made.recipe["seed"]) == (128, 0)
    assert made.recipe["policy_kwargs"]["net_arch"] == [8]
    assert made.environment["backend"]["backend"] == "physics"
    assert made.environment["settings"]["time_limit"] == 2.0
    names = {"best.safetensors", "checkpoint.safetensors", "evaluations.jsonl", "policies", "run.json", "tensorboard"}
    assert {item.name for item in run.iterdir()} == {"policy.safetensors", *names}


def test_training_on_a_surrogate_names_it(call: Any, artifact: Path, tmp_path: Path) -> None:
    where = ("--artifact", artifact, "-e", "action_mode=belts", "-e", "observe_terrain=true")
    call("rl", "train", "PathTracking-v0", "-o", tmp_path, "--eval-every", 0, *where, *SHORT)
    file = tmp_path / "policy.safetensors"
    made = load_policy(file)
    assert len(made.environment["backend"]["artifact"]) == 64
    assert made.environment["settings"]["action_mode"] == "belts"
    refused = call("rl", "eval", file, "--terrain", "lete-sand", code=2)
    assert "trained on another mode than soil" in refused.err


def test_a_training_goes_on_only_as_it_began(call: Any, run: Path, tmp_path: Path) -> None:
    again = (
        *("rl", "train", "path-tracking", "-o", run, "--backend", "physics", "--eval-backend", "exact"),
        *("--eval-episodes", 1, "--eval-every", 64, "--checkpoint-every", 64, *SHORT),
    )
    before = (run / "policy.safetensors").read_bytes()
    call(*again, "--resume")
    assert (run / "policy.safetensors").read_bytes() == before
    assert "resume it, or choose another folder" in call(*again, code=2).err
    assert "gamma 0.9 there, 0.8 asked" in call(*again, "--resume", "-p", "gamma=0.8", code=2).err


def test_evaluation_repeats_itself_and_writes_a_row_a_seed(
    call: Any, policy: Path, artifact: Path, tmp_path: Path
) -> None:
    options = ("--episodes", 3, "--seed", 4, *BRIEF)
    first, again = (call("rl", "eval", policy, *options, "-o", tmp_path / "found.json") for _ in range(2))
    assert first.out == again.out
    assert first.out.count("truncated") == 3
    found = json.loads((tmp_path / "found.json").read_text())
    assert [row["seed"] for row in found["rows"]] == [4, 5, 6]
    assert found["policy"] == load_policy(policy).content_hash
    assert found["environment"]["backend"]["backend"] == "physics"
    assert found["summary"]["episodes"] == 3
    other = call("rl", "eval", policy, "--backend", "native", "--artifact", artifact, *options)
    assert other.out != first.out


def test_what_is_set_by_e_takes_the_place_of_an_option(call: Any, policy: Path, tmp_path: Path) -> None:
    file = tmp_path / "found.json"
    call("rl", "eval", policy, "--backend", "exact", "-e", "backend=physics", "--episodes", 1, *BRIEF, "-o", file)
    assert json.loads(file.read_text(encoding="utf-8"))["environment"]["backend"]["backend"] == "physics"


def test_a_policy_drives(call: Any, policy: Path, short_path: Path, tmp_path: Path) -> None:
    options = ("--controller", policy, "--path", short_path, "--time-limit", 1)
    assert "driven" in call("drive", "--backend", "physics", *options).out
    compared = call("compare", "--backends", "physics", *options, "--output", tmp_path)
    assert (tmp_path / "asphalt-policy.png").exists()
    assert "policy" in compared.out
    assert "pass --vehicle" in call("drive", "--backend", "physics", *options, "--vehicle", "marder", code=2).err


def test_a_shipped_policy_is_judged_by_its_name(call: Any) -> None:
    options = ("--episodes", 1, *BRIEF)
    assert "m113-parking on physics, grouser/Parking-v0" in call("rl", "eval", "m113-parking", *options).out
    assert "did you mean 'm113-parking'" in call("rl", "eval", "m113-parkin", *options, code=2).err


def test_a_policy_is_filmed(call: Any, policy: Path, tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg")
    assert "frames  11" in call("rl", "video", policy, "-o", tmp_path / "drive.mp4", *BRIEF).out
    assert "ends in .mp4" in call("rl", "video", policy, "-o", tmp_path / "drive.gif", *BRIEF, code=2).err


def test_a_policy_is_recorded(call: Any, policy: Path, tmp_path: Path) -> None:
    pytest.importorskip("minari")
    options = ("-o", "grouser/path-tracking/test-v0", "--root", tmp_path, "--episodes", 2, *BRIEF)
    assert str(tmp_path / "grouser" / "path-tracking") in call("rl", "record", policy, *options).out
    assert "choose another version" in call("rl", "record", policy, *options, code=2).err


def test_a_search_writes_what_it_found(call: Any, tmp_path: Path) -> None:
    pytest.importorskip("optuna")
    call(
        *("rl", "tune", "path-tracking", "-o", tmp_path, "--backend", "physics", "--trials", 1, "--steps", 32),
        *("-p", "n_envs=1", "--eval-episodes", 1, *BRIEF),
    )
    found = json.loads((tmp_path / "best.json").read_text())
    assert "learning_rate" in found["overrides"]


def test_a_recipe_is_printed_to_be_changed(call: Any, tmp_path: Path) -> None:
    assert "ppo-path-tracking" in call("rl", "recipes").out.split()
    mine = tmp_path / "mine.yml"
    mine.write_text(call("rl", "recipes", "ppo-path-tracking").out.replace("gamma: ", "gama: "))
    refused = call("rl", "train", "path-tracking", "--recipe", mine, "-o", tmp_path / "run", code=2)
    assert "did you mean 'gamma'" in refused.err
    assert "did you mean 'ppo-path-tracking'" in call("rl", "recipes", "ppo-path-trackin", code=2).err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("path-trackin",), "did you mean 'path-tracking'"),
        (("path-tracking", "-p", "learning_rat=1"), "did you mean 'learning_rate'"),
        (("path-tracking", "-p", "learning_rate"), "-p takes KEY=VALUE"),
        (("path-tracking", "-e", "time_limt=1.0"), "did you mean 'time_limit'"),
        (("path-tracking", "--algo", "her-sac"), "no recipe is shipped for her-sac"),
    ],
)
def test_what_is_wrong_is_named_before_training(call: Any, tmp_path: Path, arguments: Any, message: str) -> None:
    refused = call("rl", "train", *arguments, "-o", tmp_path / "run", code=2)
    assert message in refused.err
    assert not (tmp_path / "run").exists()


def test_every_algorithm_can_be_asked_for() -> None:
    typed = get_args(get_args(Algorithm)[0])
    assert set(typed) == set(ALGORITHMS)
