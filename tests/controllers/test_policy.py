"""Policies as files, and driven without their environment."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pytest
from grounds import stepped

from grouser.controllers import PolicyDriver, TrackingPolicy
from grouser.envs import BeltCommand, Path, PathTrackingEnv, Simulator, TickRecord, TrackingConfig, rollout
from grouser.envs.observation import observation_size
from grouser.envs.paths import make_path, straight
from grouser.surrogate import BoxMahalanobisDetector, DenseNetwork, Normalizer, Surrogate, random_network
from grouser.surrogate.container import pack, unpack
from grouser.terrain import (
    ArtifactError,
    FloatArray,
    Ground,
    PhysicsBackend,
    TrackedVehicle,
    named,
    parameter_ranges,
)

M113 = TrackedVehicle.preset("m113")
ASPHALT, ICE, SAND = named("asphalt"), named("ice"), named("lete-sand")


def make_policy(seed: int = 0, terrain: Ground = ASPHALT, drive: float = 0.0, **settings: Any) -> TrackingPolicy:
    """A small random policy; ``drive`` is added to what it asks of both actions."""
    config = TrackingConfig(**settings)
    network = random_network((observation_size(terrain.mode, config), 16, 2), "tanh", np.random.default_rng(seed))
    biases = (network.biases[0], network.biases[1] + np.float32(drive))
    recipe = {"steps": 600, "hidden": [16], "backend": {"backend": "physics"}}
    return TrackingPolicy(DenseNetwork("tanh", network.weights, biases), M113, config, recipe)


def observations(count: int = 200, size: int = 19) -> Any:
    return np.random.default_rng(4).normal(0.0, 2.0, (count, size)).astype(np.float32)


@pytest.fixture
def saved(tmp_path: FilePath) -> FilePath:
    return make_policy().save(tmp_path / "policy.safetensors")


def test_a_policy_acts_alike_to_the_bit_after_a_round_trip(tmp_path: FilePath) -> None:
    policy = make_policy(seed=3, action_mode="twist", reference_speed=4.0, random_start=True)
    path = policy.save(tmp_path / "new folder" / "policy.safetensors")
    loaded = TrackingPolicy.load(path)
    for observation in observations():
        assert np.array_equal(loaded.act(observation), policy.act(observation))
    assert loaded.config == policy.config
    assert loaded.vehicle == policy.vehicle
    assert loaded.recipe == policy.recipe
    assert loaded.network.widths == policy.network.widths


def test_equal_policies_are_equal_files_and_nothing_is_left_beside_them(tmp_path: FilePath) -> None:
    first = make_policy().save(tmp_path / "a.safetensors")
    second = TrackingPolicy.load(first).save(str(tmp_path / "b.safetensors"))
    assert first.read_bytes() == second.read_bytes()
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a.safetensors", "b.safetensors"]


def test_the_file_is_safetensors_with_a_json_header(saved: FilePath) -> None:
    data = saved.read_bytes()
    size = int.from_bytes(data[:8], "little")
    header = json.loads(data[8 : 8 + size])
    assert {entry["dtype"] for name, entry in header.items() if name != "__metadata__"} == {"F32"}
    held = sum(np.prod(entry["shape"]) for name, entry in header.items() if name != "__metadata__")
    assert held == 19 * 16 + 16 + 16 * 2 + 2
    assert len(data) == 8 + size + 4 * held
    assert all(isinstance(value, str) for value in header["__metadata__"].values())


def test_loading_neither_unpickles_nor_needs_torch(saved: FilePath) -> None:
    script = f"""
import pickle, sys
def refuse(*args, **kwargs):
    raise AssertionError("unpickled")
pickle.load = pickle.loads = pickle.Unpickler = refuse
import numpy as np
from grouser.controllers import TrackingPolicy
print(TrackingPolicy.load({str(saved)!r}).act(np.ones(19, np.float32)).tolist())
assert not {{"torch", "stable_baselines3"}} & set(sys.modules)
"""
    done = subprocess.run([sys.executable, "-P", "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    expected = TrackingPolicy.load(saved).act(np.ones(19, np.float32))
    assert json.loads(done.stdout) == expected.tolist()


def test_a_truncated_policy_is_refused(saved: FilePath) -> None:
    data = saved.read_bytes()
    for length in (0, 4, 8, 40, len(data) // 2, len(data) - 1):
        saved.write_bytes(data[:length])
        with pytest.raises(ArtifactError):
            TrackingPolicy.load(saved)


def test_a_flipped_byte_is_refused(saved: FilePath) -> None:
    data = saved.read_bytes()
    for place in {*range(64), *range(64, len(data), 61), len(data) - 1}:
        saved.write_bytes(data[:place] + bytes([data[place] ^ 0x20]) + data[place + 1 :])
        with pytest.raises(ArtifactError):
            TrackingPolicy.load(saved)


@pytest.mark.parametrize(("old", "new"), [("0.1", "0.2"), ("belts", "twist"), ("m113", "m114"), ("600", "601")])
def test_edited_metadata_is_refused(saved: FilePath, old: str, new: str) -> None:
    data = saved.read_bytes()
    size = int.from_bytes(data[:8], "little")
    header, body = data[8 : 8 + size], data[8 + size :]
    assert old.encode() in header
    edited = header.replace(old.encode(), new.encode(), 1)
    assert len(edited) == len(header)
    saved.write_bytes(data[:8] + edited + body)
    with pytest.raises(ArtifactError, match="altered"):
        TrackingPolicy.load(saved)


def test_a_surrogate_is_no_policy(tmp_path: FilePath) -> None:
    generator = np.random.default_rng(0)
    ranges = parameter_ranges("wide", "rigid")
    theta = np.repeat([ranges.sample(generator).parameters for _ in range(20)], 10, axis=0)
    x = np.column_stack([generator.normal(0.0, 2.0, (200, 7)), theta])
    inputs = Normalizer.fit(x)
    surrogate = Surrogate(
        vehicle=M113,
        mode="rigid",
        network=random_network((10, 8, 3), "tanh", generator),
        input_normalizer=inputs,
        output_normalizer=Normalizer.fit(PhysicsBackend(M113, "rigid", cells=(2, 1)).forces(x)),
        detector=BoxMahalanobisDetector.fit(x, np.repeat(np.arange(20), 10), inputs, ranges, M113),
        ranges=ranges,
    )
    path = surrogate.save(tmp_path / "surrogate.safetensors")
    with pytest.raises(ArtifactError, match="policy"):
        TrackingPolicy.load(path)


def test_a_policy_is_no_surrogate(saved: FilePath) -> None:
    with pytest.raises(ArtifactError):
        Surrogate.load(saved)


@pytest.mark.parametrize("content", [b"", b"not a policy at all, but long enough", pickle.dumps({"actor": [1.0] * 99})])
def test_any_other_file_is_refused(tmp_path: FilePath, content: bytes) -> None:
    path = tmp_path / "policy.safetensors"
    path.write_bytes(content)
    with pytest.raises(ArtifactError):
        TrackingPolicy.load(path)


def test_a_missing_file_and_a_folder_are_refused_by_name(tmp_path: FilePath) -> None:
    for path in (tmp_path / "none.safetensors", tmp_path):
        with pytest.raises(ArtifactError, match=path.name):
            TrackingPolicy.load(path)


def test_a_newer_format_is_refused(saved: FilePath) -> None:
    tensors, metadata = unpack(saved.read_bytes(), "policy", 1)
    saved.write_bytes(pack(tensors, metadata | {"format_version": 2}))
    with pytest.raises(ArtifactError, match="upgrade"):
        TrackingPolicy.load(saved)


@pytest.mark.parametrize("key", ["actor", "vehicle", "config", "recipe"])
def test_an_incomplete_policy_is_refused(saved: FilePath, key: str) -> None:
    tensors, metadata = unpack(saved.read_bytes(), "policy", 1)
    del metadata[key]
    saved.write_bytes(pack(tensors, metadata))
    with pytest.raises(ArtifactError, match=key):
        TrackingPolicy.load(saved)


def test_an_unknown_setting_is_refused(saved: FilePath) -> None:
    tensors, metadata = unpack(saved.read_bytes(), "policy", 1)
    metadata["config"]["gravity"] = 1.6
    saved.write_bytes(pack(tensors, metadata))
    with pytest.raises(ArtifactError, match="gravity"):
        TrackingPolicy.load(saved)


@pytest.mark.parametrize("widths", [(19, 8, 3), (5, 8, 2)])
def test_a_network_of_other_inputs_or_outputs_is_not_a_path_tracking_policy(
    tmp_path: FilePath, widths: tuple[int, ...]
) -> None:
    network = random_network(widths, "tanh", np.random.default_rng(0))
    with pytest.raises(ArtifactError):
        TrackingPolicy.load(TrackingPolicy(network, M113, TrackingConfig()).save(tmp_path / "odd.safetensors"))


def test_act_is_the_clipped_network_in_float64() -> None:
    policy = make_policy(seed=1)
    (w0, w1), (b0, b1) = policy.network.weights, policy.network.biases
    clipped = 0
    for observation in observations():
        hidden = np.tanh(observation.astype(float) @ w0.astype(float) + b0.astype(float))
        raw = hidden @ w1.astype(float) + b1.astype(float)
        action = policy.act(observation)
        assert action.shape == (2,)
        assert action.dtype == np.float64
        np.testing.assert_allclose(action, np.minimum(1.0, np.maximum(-1.0, raw)), rtol=1e-12, atol=1e-15)
        clipped += int(np.any(np.abs(raw) > 1.0))
    assert clipped > 20


# An episode that starts in the middle of a path, off it, and one that starts where a path crosses itself.
EPISODES: dict[str, tuple[Callable[[], Path], Ground, dict[str, Any], dict[str, float]]] = {
    "belts": (lambda: make_path("iso-3888-1", M113), ASPHALT, {}, {"lateral_offset": 0.15, "heading_offset": 0.04}),
    "twist": (
        lambda: make_path("iso-3888-1", M113),
        SAND,
        {"action_mode": "twist", "reference_speed": 4.0},
        {"lateral_offset": -0.1},
    ),
    "sees the terrain change": (
        lambda: straight(60.0),
        stepped(ASPHALT, ICE, 6.0),
        {"action_mode": "twist", "observe_terrain": True},
        {"lateral_offset": 0.2},
    ),
    "slow control, sdirk2": (
        lambda: make_path("sine", M113),
        ASPHALT,
        {"control_period": 0.2, "tick": 0.02, "integrator": "sdirk2", "yaw_rate_scale": 0.5},
        {"arc_length": 31.7, "lateral_offset": 0.1},
    ),
    "closed path, from before its start": (
        lambda: make_path("circle", M113),
        ASPHALT,
        {"action_mode": "twist"},
        {"lateral_offset": 0.1, "heading_offset": 0.05, "arc_length": -0.02},
    ),
    "from a crossing": (
        lambda: make_path("figure-eight", M113),
        ASPHALT,
        {"action_mode": "twist"},
        {"lateral_offset": 0.1},
    ),
}


@pytest.mark.parametrize("name", EPISODES)
def test_a_driver_drives_a_bare_simulator_as_the_environment_does(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    make, ground, settings, options = EPISODES[name]
    path, limit = make(), 4.0
    policy = make_policy(seed=2, terrain=ground, drive=0.4, time_limit=limit, **settings)
    # Tick by tick, to be watched.
    env = PathTrackingEnv("physics", M113, ground, path, time_limit=limit, engine="python", **settings)
    assert env.config == policy.config
    commands: list[BeltCommand] = []
    records: list[TickRecord] = []
    step = env.simulator.step

    def watched(command: BeltCommand) -> TickRecord:
        commands.append(command)
        records.append(step(command))
        return records[-1]

    monkeypatch.setattr(env.simulator, "step", watched)
    observation, _ = env.reset(seed=5, options=dict(options))
    start = env.simulator.get_state()
    done = False
    while not done:
        observation, _, terminated, truncated, _ = env.step(policy.act(observation))  # type: ignore[arg-type]
        done = terminated or truncated
    assert len(records) > 50

    simulator = Simulator(
        M113, "physics", ground, tick=policy.config.tick, integrator=policy.config.integrator, state=start
    )
    log = rollout(
        simulator,
        PolicyDriver(policy, path, ground),
        len(records) * policy.config.tick,
        control_period=policy.config.control_period,
    )
    assert np.array_equal(log.commands, np.array(commands))
    assert len(np.unique(log.commands, axis=0)) > 5
    assert np.array_equal(log.forces, np.array([record.forces for record in records]))
    for field, column in (("x", "x"), ("y", "y"), ("heading", "heading"), ("yaw_rate", "yaw_rate")):
        assert np.array_equal(log.state(column)[1:], [getattr(record.state, field) for record in records])
    assert simulator.get_state() == env.simulator.get_state()


def test_a_driver_sees_its_own_clipped_action_as_the_previous_one() -> None:
    policy = make_policy(seed=2, drive=5.0)
    seen: list[FloatArray] = []

    class Watched(TrackingPolicy):
        def act(self, observation: Any) -> FloatArray:
            seen.append(observation[17:19])
            return super().act(observation)

    watched = Watched(policy.network, policy.vehicle, policy.config)
    driver = PolicyDriver(watched, straight(20.0), ASPHALT)
    rollout(Simulator(M113, "physics", ASPHALT), driver, 0.3)
    assert [values.tolist() for values in seen] == [[0.0, 0.0], [1.0, 1.0], [1.0, 1.0]]


def test_a_driver_forgets_the_last_drive() -> None:
    policy = make_policy(seed=2, drive=0.4)
    driver = PolicyDriver(policy, make_path("sine", M113), ASPHALT)
    logs = [rollout(Simulator(M113, "physics", ASPHALT), driver, 2.0) for _ in range(2)]
    assert np.array_equal(logs[0].states, logs[1].states)
    assert np.array_equal(logs[0].commands, logs[1].commands)
