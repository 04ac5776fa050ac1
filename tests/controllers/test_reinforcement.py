"""A tiny training of PPO on the physics: repeatable, exported faithfully, without side effects on torch's threads."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pytest
import stable_baselines3
import torch

from grouser.controllers import PolicyDriver, PPOConfig, TrackingPolicy, train_policy
from grouser.envs import PathTrackingEnv, Simulator, TrackingConfig, rollout
from grouser.envs.paths import straight
from grouser.terrain import ConfigurationError, InvalidInputError, TrackedVehicle, named

M113 = TrackedVehicle.preset("m113")
CONFIG = PPOConfig(
    steps=600, environments=2, rollout_steps=64, batch_size=64, epochs=2, hidden=(12, 8), learning_rate=1e-2, seed=3
)
TASK: Mapping[str, Any] = {
    "backend": "physics",
    "vehicle": "m113",
    "terrain": "asphalt",
    "path": "straight",
    "action_mode": "twist",
    "reference_speed": 4.0,
    "random_start": True,
    "time_limit": 4.0,
}


@dataclass
class Training:
    policy: TrackingPolicy
    model: Any
    said: list[tuple[int, int]] = field(default_factory=list)


@pytest.fixture
def four_threads() -> Iterator[int]:
    """Torch with another number of threads than training takes."""
    before = torch.get_num_threads()
    torch.set_num_threads(4)
    yield 4
    torch.set_num_threads(before)


@pytest.fixture(scope="module")
def trained() -> Training:
    """A training, with stable-baselines3's own model kept."""
    models: list[Any] = []

    class Kept(stable_baselines3.PPO):
        def __init__(self, *args: Any, **kwargs: Any) -> None:
            super().__init__(*args, **kwargs)
            models.append(self)

    said: list[tuple[int, int]] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stable_baselines3, "PPO", Kept)
        policy = train_policy(CONFIG, TASK, progress=lambda done, total: said.append((done, total)))
    (model,) = models
    return Training(policy, model, said)


def weights(policy: TrackingPolicy) -> list[bytes]:
    return [array.tobytes() for array in (*policy.network.weights, *policy.network.biases)]


def test_the_same_seed_gives_the_same_weights_whatever_the_threads(trained: Training, four_threads: int) -> None:
    torch.rand(7)
    np.random.default_rng().random(3)
    again = train_policy(CONFIG, TASK)
    assert weights(again) == weights(trained.policy)
    assert torch.get_num_threads() == four_threads


def test_another_seed_gives_other_weights(trained: Training) -> None:
    short = {**asdict(CONFIG), "steps": 128}
    first, second = (train_policy(PPOConfig(**(short | {"seed": seed})), TASK) for seed in (3, 4))
    assert weights(first) != weights(second)
    assert weights(first) != weights(trained.policy)


def test_the_number_of_threads_is_restored_after_a_failure(four_threads: int) -> None:
    with pytest.raises(ConfigurationError, match="action_mode"):
        train_policy(CONFIG, {**TASK, "action_mod": "twist"})
    assert torch.get_num_threads() == four_threads


def test_the_actor_is_the_deterministic_prediction_of_the_library(trained: Training) -> None:
    env = PathTrackingEnv(**TASK)
    env.reset(seed=1)
    env.action_space.seed(1)
    driven = []
    for _ in range(30):
        observation, *_ = env.step(env.action_space.sample())
        driven.append(observation)
    wild = np.random.default_rng(0).uniform(-10.0, 10.0, (200, 19)).astype(np.float32)
    inside = 0
    for observation in [*driven, *wild]:
        expected, _ = trained.model.predict(observation, deterministic=True)
        action = trained.policy.act(observation)
        np.testing.assert_allclose(action, expected, atol=1e-5)
        inside += int(np.all(np.abs(action) < 1.0))
    assert inside > 50


def test_the_actor_is_the_mean_of_the_policys_distribution(trained: Training) -> None:
    observation = np.random.default_rng(2).normal(size=(50, 19)).astype(np.float32)
    with torch.no_grad():
        mean = trained.model.policy.get_distribution(torch.as_tensor(observation)).distribution.mean.numpy()
    for row, expected in zip(observation, mean, strict=True):
        np.testing.assert_allclose(trained.policy.act(row), np.clip(expected, -1.0, 1.0), atol=1e-5)


def test_training_moved_the_weights(trained: Training) -> None:
    untrained = train_policy(PPOConfig(**{**asdict(CONFIG), "steps": 128, "learning_rate": 1e-30}), TASK)
    assert weights(untrained) != weights(trained.policy)


def test_steps_are_rounded_up_to_whole_rollouts_and_reported(trained: Training) -> None:
    per_rollout = CONFIG.environments * CONFIG.rollout_steps
    assert trained.model.num_timesteps == -(-CONFIG.steps // per_rollout) * per_rollout
    assert trained.said == [(min(done, 600), 600) for done in range(per_rollout, 600 + per_rollout, per_rollout)]


def test_hyper_parameters_reach_the_library(trained: Training) -> None:
    model = trained.model
    assert model.gamma == CONFIG.discount
    assert (model.n_steps, model.batch_size, model.n_epochs, model.n_envs) == (64, 64, 2, 2)
    assert model.lr_schedule(1.0) == pytest.approx(1e-2)
    assert model.lr_schedule(0.25) == pytest.approx(0.25e-2)
    assert trained.policy.network.widths == (19, 12, 8, 2)
    assert trained.policy.network.activation == "tanh"


def test_a_policy_knows_its_vehicle_its_task_and_how_it_was_trained(trained: Training, tmp_path: FilePath) -> None:
    policy = TrackingPolicy.load(trained.policy.save(tmp_path / "policy.safetensors"))
    assert policy.vehicle == M113
    assert policy.config == TrackingConfig(action_mode="twist", reference_speed=4.0, random_start=True, time_limit=4.0)
    made = json.loads(json.dumps(asdict(CONFIG)))
    assert {key: policy.recipe[key] for key in made} == made
    assert policy.recipe["backend"]["backend"] == "physics"
    assert policy.recipe["path"] == "straight"


def test_a_trained_policy_drives_a_bare_simulator(trained: Training) -> None:
    asphalt = named("asphalt")
    log = rollout(Simulator(M113, "physics", asphalt), PolicyDriver(trained.policy, straight(), asphalt), 1.0)
    assert np.abs(log.commands).max() <= M113.training_speed


def test_a_missing_library_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    with pytest.raises(ConfigurationError, match=r"grouser\[rl\]"):
        train_policy(CONFIG, TASK)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("steps", 0),
        ("environments", -1),
        ("rollout_steps", 0),
        ("batch_size", 0),
        ("epochs", -3),
        ("learning_rate", 0.0),
        ("learning_rate", float("nan")),
        ("discount", -0.5),
        ("hidden", (64, 0)),
    ],
)
def test_numbers_that_are_not_positive_are_refused(name: str, value: object) -> None:
    with pytest.raises(InvalidInputError, match=name):
        PPOConfig(**{name: value})  # type: ignore[arg-type]
