"""Policies as files: whole, unaltered, without pickle, and the same to stable-baselines3."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys
from importlib.resources import files
from pathlib import Path as FilePath
from typing import Any

import gymnasium
import numpy as np
import pytest
from policies import WIDTH, make_policy, random_layers
from stable_baselines3.common.utils import set_random_seed

from grouser.controllers import Policy, load_policy
from grouser.controllers.rl import Architecture, EnvironmentSpec, ObservationNormalizer
from grouser.surrogate import Surrogate
from grouser.surrogate.container import pack, unpack
from grouser.terrain import ArtifactError, ConfigurationError, InvalidInputError, TrackedVehicle

FORMAT = 1


def observations(count: int = 200, size: int = 19) -> Any:
    return np.random.default_rng(4).normal(0.0, 2.0, (count, size)).astype(np.float32)


def goal_policy(algorithm: str = "her-sac") -> Policy:
    """A policy of SAC for goals, its actor only."""
    box = gymnasium.spaces.Box(-np.inf, np.inf, (3,), np.float32)
    goal = gymnasium.spaces.Box(-10.0, 10.0, (2,), np.float32)
    generator = np.random.default_rng(7)
    layers = {"actor.latent_pi.0": (7, 8), "actor.latent_pi.2": (8, 8), "actor.mu": (8, 2), "actor.log_std": (8, 2)}
    critics = {
        f"{net}.qf{index}.{layer}": shape
        for net in ("critic", "critic_target")
        for index in (0, 1)
        for layer, shape in ((0, (9, 8)), (2, (8, 8)), (4, (8, 1)))
    }
    return Policy(
        Architecture(algorithm, (8, 8), "relu"),
        random_layers(generator, layers | critics),
        gymnasium.spaces.Dict({"observation": box, "achieved_goal": goal, "desired_goal": goal}),
        gymnasium.spaces.Box(np.array([-1.0, 0.0], np.float32), np.array([1.0, 4.0], np.float32)),
        {"id": "Reach-v0", "arguments": {}},
        ObservationNormalizer(
            {"observation": generator.normal(size=3)}, {"observation": generator.uniform(0.5, 2.0, 3)}, 5.0, 1e-8
        ),
    )


def goals(count: int = 100) -> dict[str, Any]:
    generator = np.random.default_rng(9)
    sizes = {"observation": 3, "achieved_goal": 2, "desired_goal": 2}
    return {key: generator.normal(0.0, 3.0, (count, size)).astype(np.float32) for key, size in sizes.items()}


@pytest.fixture
def saved(tmp_path: FilePath) -> FilePath:
    return make_policy().save(tmp_path / "policy.safetensors")


def test_a_policy_acts_alike_to_the_bit_after_a_round_trip(tmp_path: FilePath) -> None:
    policy = make_policy(seed=3, action_mode="twist", reference_speed=4.0, random_start=True)
    loaded = load_policy(policy.save(tmp_path / "new folder" / "policy.safetensors"))
    assert np.array_equal(loaded.act(observations()), policy.act(observations()))
    assert loaded.environment == policy.environment
    assert loaded.recipe == policy.recipe
    assert loaded.architecture == policy.architecture
    assert loaded.observation_space == policy.observation_space
    assert loaded.action_space == policy.action_space
    assert loaded.content_hash == policy.content_hash


def test_a_policy_for_goals_acts_alike_to_the_bit_after_a_round_trip(tmp_path: FilePath) -> None:
    policy = goal_policy()
    loaded = load_policy(policy.save(tmp_path / "policy.safetensors"))
    assert np.array_equal(loaded.act(goals()), policy.act(goals()))
    assert loaded.observation_space == policy.observation_space


def test_equal_policies_are_equal_files_and_nothing_is_left_beside_them(tmp_path: FilePath) -> None:
    first = make_policy().save(tmp_path / "a.safetensors")
    second = load_policy(first).save(str(tmp_path / "b.safetensors"))
    assert first.read_bytes() == second.read_bytes()
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a.safetensors", "b.safetensors"]


def test_an_action_has_the_same_bits_alone_and_among_others() -> None:
    policy, rows = make_policy(seed=1), observations(65)
    alone = np.array([policy.act(row) for row in rows])
    assert np.array_equal(policy.act(rows), alone)
    assert np.array_equal(policy.act(rows[:7]), alone[:7])


def test_an_action_is_the_clipped_network_in_float64() -> None:
    policy = make_policy(seed=1)
    w = {name: array.astype(float) for name, array in policy.weights.items()}
    hidden = np.tanh(observations() @ w["mlp_extractor.policy_net.0.weight"].T + w["mlp_extractor.policy_net.0.bias"])
    raw = hidden @ w["action_net.weight"].T + w["action_net.bias"]
    actions = policy.act(observations())
    assert (np.abs(raw) > 1.0).any(axis=1).sum() > 5
    np.testing.assert_allclose(actions, np.clip(raw, -1.0, 1.0), rtol=1e-6, atol=1e-7)


def test_the_rebuilt_policy_of_the_library_acts_alike() -> None:
    policy = make_policy(seed=1)
    expected, _ = policy.to_sb3().predict(observations(), deterministic=True)
    np.testing.assert_allclose(policy.act(observations()), expected, atol=1e-5)


@pytest.mark.parametrize("algorithm", ["her-sac", "sac"])
def test_the_rebuilt_policy_for_goals_acts_alike(algorithm: str) -> None:
    policy = goal_policy(algorithm)
    expected, _ = policy.to_sb3().predict(policy.normalize(goals()), deterministic=True)
    actions = policy.act(goals())
    np.testing.assert_allclose(actions, expected, atol=1e-5)
    assert policy.action_space.contains(actions[0])


@pytest.mark.parametrize("algorithm", ["her-sac", "her-tqc"])
def test_without_critics_it_acts_alike_to_the_bit_and_its_file_is_smaller(algorithm: str, tmp_path: FilePath) -> None:
    whole = goal_policy(algorithm)
    bare = load_policy(whole.without_critics().save(tmp_path / "bare.safetensors"))
    assert (whole.has_critics, bare.has_critics) == (True, False)
    assert np.array_equal(bare.act(goals()), whole.act(goals()))
    assert sum(array.nbytes for array in bare.weights.values()) == 4 * (7 * 8 + 8 + 8 * 8 + 8 + 2 * (8 * 2 + 2))
    assert bare.recipe == whole.recipe


def test_without_critics_the_library_gets_an_actor_and_nothing_to_take_for_a_critic() -> None:
    whole, seen = goal_policy(), goals()
    bare = whole.without_critics()
    actor, policy = bare.to_sb3(), whole.to_sb3()
    assert not hasattr(actor, "critic")
    normalized = whole.normalize(seen)
    for deterministic in (True, False):
        set_random_seed(4)
        expected, _ = policy.predict(normalized, deterministic=deterministic)
        set_random_seed(4)
        actions, _ = actor.predict(normalized, deterministic=deterministic)
        assert np.array_equal(actions, expected)


def test_a_policy_that_is_one_with_its_critic_stays_whole() -> None:
    policy = make_policy()
    assert policy.has_critics
    with pytest.raises(ConfigurationError, match="one module with its critic"):
        policy.without_critics()


def test_a_policy_predicts_as_a_model_of_the_library_does() -> None:
    policy, row = make_policy(), observations(1)[0]
    action, state = policy.predict(row, state=None, episode_start=np.array([True]), deterministic=True)
    assert state is None
    assert np.array_equal(action, policy.act(row))
    with pytest.raises(ConfigurationError, match="to_sb3"):
        policy.predict(row, deterministic=False)


def test_rebuilding_leaves_the_global_generator_of_torch_alone() -> None:
    import torch

    policy = make_policy()
    torch.manual_seed(5)
    expected = torch.rand(3)
    torch.manual_seed(5)
    policy.to_sb3()
    assert torch.equal(torch.rand(3), expected)


def test_the_file_is_safetensors_with_a_json_header(saved: FilePath) -> None:
    data = saved.read_bytes()
    size = int.from_bytes(data[:8], "little")
    header = json.loads(data[8 : 8 + size])
    tensors = {name: entry for name, entry in header.items() if name != "__metadata__"}
    assert {entry["dtype"] for entry in tensors.values()} == {"F32"}
    held = sum(int(np.prod(entry["shape"])) for entry in tensors.values())
    assert held == 2 * (19 * WIDTH + WIDTH) + WIDTH * 2 + 2 + WIDTH + 1 + 2
    assert all(isinstance(value, str) for value in header["__metadata__"].values())


def test_loading_and_acting_neither_unpickle_nor_need_torch(saved: FilePath) -> None:
    script = f"""
import pickle, sys
def refuse(*args, **kwargs):
    raise AssertionError("unpickled")
pickle.load = pickle.loads = pickle.Unpickler = refuse
import numpy as np
from grouser.controllers import load_policy
print(load_policy({str(saved)!r}).act(np.ones(19, np.float32)).tolist())
assert not {{"torch", "stable_baselines3", "yaml"}} & set(sys.modules)
"""
    done = subprocess.run([sys.executable, "-P", "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == load_policy(saved).act(np.ones(19, np.float32)).tolist()


def test_a_truncated_policy_is_refused(saved: FilePath) -> None:
    data = saved.read_bytes()
    for length in (0, 4, 8, 40, len(data) // 2, len(data) - 1):
        saved.write_bytes(data[:length])
        with pytest.raises(ArtifactError):
            load_policy(saved)


def test_a_flipped_byte_is_refused(saved: FilePath) -> None:
    data = saved.read_bytes()
    for place in {*range(64), *range(64, len(data), 97), len(data) - 1}:
        saved.write_bytes(data[:place] + bytes([data[place] ^ 0x01]) + data[place + 1 :])
        with pytest.raises(ArtifactError):
            load_policy(saved)


@pytest.mark.parametrize(("old", "new"), [("0.1", "0.2"), ("belts", "twist"), ("m113", "m114"), ("600", "601")])
def test_edited_metadata_is_refused(saved: FilePath, old: str, new: str) -> None:
    data = saved.read_bytes()
    size = int.from_bytes(data[:8], "little")
    header, body = data[8 : 8 + size], data[8 + size :]
    assert old.encode() in header
    saved.write_bytes(data[:8] + header.replace(old.encode(), new.encode(), 1) + body)
    with pytest.raises(ArtifactError, match="altered"):
        load_policy(saved)


def test_a_surrogate_is_no_policy() -> None:
    with pytest.raises(ArtifactError, match="policy"):
        load_policy(str(files("grouser.surrogate") / "artifacts" / "m113-rigid.safetensors"))


def test_a_policy_is_no_surrogate(saved: FilePath) -> None:
    with pytest.raises(ArtifactError):
        Surrogate.load(saved)


@pytest.mark.parametrize("content", [b"", b"not a policy at all, but long enough", pickle.dumps({"actor": [1.0] * 99})])
def test_any_other_file_is_refused(tmp_path: FilePath, content: bytes) -> None:
    path = tmp_path / "policy.safetensors"
    path.write_bytes(content)
    with pytest.raises(ArtifactError):
        load_policy(path)


def test_a_missing_file_and_a_folder_are_refused_by_name(tmp_path: FilePath) -> None:
    for path in (tmp_path / "none.safetensors", tmp_path):
        with pytest.raises(ArtifactError, match=path.name):
            load_policy(path)


def test_a_newer_format_is_refused(saved: FilePath) -> None:
    tensors, metadata = unpack(saved.read_bytes(), "policy", FORMAT)
    saved.write_bytes(pack(tensors, metadata | {"format_version": FORMAT + 1}))
    with pytest.raises(ArtifactError, match="upgrade"):
        load_policy(saved)


@pytest.mark.parametrize("key", ["architecture", "observation_space", "action_space", "environment", "recipe"])
def test_an_incomplete_policy_is_refused(saved: FilePath, key: str) -> None:
    tensors, metadata = unpack(saved.read_bytes(), "policy", FORMAT)
    del metadata[key]
    saved.write_bytes(pack(tensors, metadata))
    with pytest.raises(ArtifactError, match=key):
        load_policy(saved)


def test_a_missing_layer_is_refused(saved: FilePath) -> None:
    tensors, metadata = unpack(saved.read_bytes(), "policy", FORMAT)
    del tensors["policy.action_net.bias"]
    saved.write_bytes(pack(tensors, metadata))
    with pytest.raises(ArtifactError, match=r"action_net\.bias"):
        load_policy(saved)


def test_weights_of_another_architecture_are_refused_by_the_library(saved: FilePath) -> None:
    tensors, metadata = unpack(saved.read_bytes(), "policy", FORMAT)
    metadata["architecture"]["net_arch"] = [WIDTH, WIDTH]
    saved.write_bytes(pack(tensors, metadata))
    with pytest.raises(ArtifactError, match="architecture"):
        load_policy(saved).to_sb3()


@pytest.mark.parametrize(("name", "message"), [("policy.action_net.weight", "fit"), ("policy.log_std", "")])
def test_weights_that_are_not_finite_do_not_drive(saved: FilePath, name: str, message: str) -> None:
    tensors, metadata = unpack(saved.read_bytes(), "policy", FORMAT)
    tensors[name] = np.full_like(tensors[name], np.nan)
    saved.write_bytes(pack(tensors, metadata))
    if message:
        with pytest.raises(ArtifactError, match=message):
            load_policy(saved)
    else:
        # Not of the actor: exploration is the trainer's.
        assert np.isfinite(load_policy(saved).act(observations())).all()


def test_observations_of_another_length_or_kind_are_refused() -> None:
    with pytest.raises(InvalidInputError, match="19 numbers"):
        make_policy().act(np.zeros(18, np.float32))
    with pytest.raises(InvalidInputError, match="desired_goal"):
        goal_policy().act({"observation": np.zeros(3), "achieved_goal": np.zeros(2)})


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"action_mode": "twist"}, "action_mode 'belts', here 'twist'"),
        ({"observe_terrain": True}, "observe_terrain False, here True"),
        ({"reference_speed": 3.0}, "reference_speed"),
        ({"control_period": 0.2}, "control_period"),
    ],
)
def test_a_task_that_observes_or_acts_otherwise_is_refused(arguments: dict[str, Any], message: str) -> None:
    policy = make_policy()
    with pytest.raises(ConfigurationError, match=message):
        policy.require(EnvironmentSpec("grouser/PathTracking-v0", {"backend": "physics", **arguments}))


def test_another_environment_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="trained in grouser/PathTracking-v0, not in grouser/SpeedTracking-v0"):
        make_policy().require(EnvironmentSpec("grouser/SpeedTracking-v0", {"backend": "physics"}))


def test_another_ground_and_backend_are_not_another_task() -> None:
    policy = make_policy()
    spec = EnvironmentSpec("grouser/PathTracking-v0", {"backend": "native", "terrain": "lete-sand", "path": "circle"})
    assert policy.require(spec) is policy


def test_a_preset_is_judged_with_its_hull_too(tmp_path: FilePath) -> None:
    policy = load_policy(make_policy(vehicle="m113").save(tmp_path / "policy.safetensors"))
    assert policy.environment_spec().arguments["vehicle"].hull_length == TrackedVehicle.preset("m113").hull_length
