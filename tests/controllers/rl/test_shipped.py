"""The shipped policies: by name, of the kind that their names say, and no others."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pytest
from policies import make_policy

from grouser.controllers import EnvironmentSpec, evaluate, load_policy, shipped_policies
from grouser.controllers.rl import environment_id, shipped
from grouser.surrogate import Surrogate
from grouser.terrain import ArtifactError, ConfigurationError, TrackedVehicle

NAMES = shipped_policies()


def observations(name: str, count: int = 50) -> Any:
    space = load_policy(name).observation_space
    space.seed(3)
    drawn = [space.sample() for _ in range(count)]
    if isinstance(drawn[0], dict):
        return {key: np.array([one[key] for one in drawn]) for key in drawn[0]}
    return np.array(drawn)


def test_there_is_one_for_tracking_and_one_for_parking() -> None:
    assert NAMES == ("m113-parking", "m113-path-tracking")


@pytest.mark.parametrize("name", NAMES)
def test_name_vehicle_and_task_agree(name: str) -> None:
    policy = load_policy(name)
    vehicle, _, task = name.partition("-")
    assert TrackedVehicle.from_dict(policy.environment["vehicle"]) == TrackedVehicle.preset(vehicle)
    assert policy.environment["id"] == environment_id(task)
    assert policy.recipe["environment"] == environment_id(task)


@pytest.mark.parametrize("name", NAMES)
def test_it_was_trained_on_the_shipped_surrogate(name: str) -> None:
    trained = load_policy(name).environment
    surrogate = Surrogate.shipped("m113", trained["mode"])
    assert trained["backend"]["backend"] == "native"
    assert trained["backend"]["artifact"] == surrogate.content_hash


@pytest.mark.parametrize("name", NAMES)
def test_it_is_small_and_its_file_is_what_saving_it_makes(name: str, tmp_path: FilePath) -> None:
    data = load_policy(name).save(tmp_path / "again.safetensors").read_bytes()
    assert data == shipped.read_shipped(name)
    assert len(data) <= 300_000


@pytest.mark.parametrize("name", NAMES)
def test_the_library_acts_alike(name: str) -> None:
    policy, seen = load_policy(name), observations(name)
    expected, _ = policy.to_sb3().predict(policy.normalize(seen), deterministic=True)
    np.testing.assert_allclose(policy.act(seen), expected, atol=1e-4)


@pytest.mark.parametrize("name", NAMES)
def test_it_drives_its_own_task_on_physics(name: str) -> None:
    policy = load_policy(name)
    found = evaluate(policy, policy.environment_spec(backend="physics", time_limit=1.0), episodes=1)
    assert found.episodes[0].length > 0


def test_the_one_for_tracking_serves_every_ground() -> None:
    policy = load_policy("m113-path-tracking")
    assert policy.environment["settings"]["observe_terrain"] is False
    for terrain in ("ice", "lete-sand"):
        policy.require(
            EnvironmentSpec(policy.environment["id"], {**policy.environment["arguments"], "terrain": terrain})
        )


def test_loading_needs_no_torch() -> None:
    script = f"""
import sys
from grouser.controllers import load_policy
for name in {NAMES}:
    load_policy(name)
assert not {{"torch", "stable_baselines3", "yaml"}} & set(sys.modules)
"""
    done = subprocess.run([sys.executable, "-P", "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("unknown", ["m113-parkin", "m113-rigid"])
def test_an_unknown_name_is_answered_with_the_nearest(unknown: str) -> None:
    with pytest.raises(ConfigurationError, match=f"unknown policy '{unknown}'; did you mean 'm113-pa"):
        load_policy(unknown)


def test_a_file_without_a_suffix_is_still_a_file(tmp_path: FilePath, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    made = make_policy()
    made.save("mine")
    assert load_policy("mine").content_hash == made.content_hash


def test_another_policy_in_its_place_is_refused_though_it_is_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    other = shipped.read_shipped("m113-path-tracking")
    monkeypatch.setattr("grouser.controllers.rl.policy.read_shipped", lambda name: other)
    with pytest.raises(ArtifactError, match="not the policy that grouser ships"):
        load_policy("m113-parking")


def test_one_that_was_not_installed_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: FilePath) -> None:
    monkeypatch.setattr(shipped, "files", lambda package: tmp_path)
    with pytest.raises(ArtifactError, match="install grouser anew"):
        load_policy("m113-parking")
