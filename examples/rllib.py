"""Train a few iterations with Ray RLlib, in a local Ray, on the environments that everything else here uses.

python examples/rllib.py

RLlib needs more than Ray itself: pip install 'grouser[rl,ray]' lz4 dm-tree ormsgpack scipy. Its own extra, ray[rllib],
asks for one version of gymnasium exactly.
"""

from __future__ import annotations

import warnings
from typing import Any

import gymnasium
import ray
from ray.rllib.algorithms.ppo import PPOConfig
from ray.tune.registry import register_env

ENVIRONMENT = "grouser/PathTracking-v0"
ARGUMENTS = {"backend": "native", "action_mode": "twist", "random_start": True, "time_limit": 8.0}


def make(arguments: dict[str, Any]) -> gymnasium.Env[Any, Any]:
    """Make the environment where Ray wants it: in a process of its own, where nothing is registered yet."""
    import grouser  # noqa: F401 - registers the environments

    return gymnasium.make(ENVIRONMENT, **arguments)


if __name__ == "__main__":
    # What RLlib warns of is its own.
    warnings.simplefilter("ignore")
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="error")
    register_env(ENVIRONMENT, make)
    config = (
        PPOConfig()
        .environment(ENVIRONMENT, env_config=ARGUMENTS)
        .env_runners(num_env_runners=1, num_envs_per_env_runner=4, rollout_fragment_length=128)
        .training(train_batch_size=512, minibatch_size=128, num_epochs=5, lr=1e-3, gamma=0.95)
        .debugging(seed=0, log_level="ERROR")
    )
    algorithm = config.build_algo()
    for iteration in range(3):
        found = algorithm.train()["env_runners"]
        print(f"iteration {iteration + 1}: mean return {found['episode_return_mean']:.2f}")
    algorithm.stop()
    ray.shutdown()
