"""Small random policies of path tracking, made without the library that trains them."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from grouser.controllers import EnvironmentSpec, Policy
from grouser.controllers.rl import Architecture

WIDTH = 16


def random_layers(generator: np.random.Generator, names: dict[str, tuple[int, int]]) -> dict[str, Any]:
    """Weights and biases of linear layers as torch keeps them, by name and (inputs, outputs)."""
    layers = {}
    for name, (inputs, outputs) in names.items():
        layers[f"{name}.weight"] = generator.normal(0.0, inputs**-0.5, (outputs, inputs)).astype(np.float32)
        layers[f"{name}.bias"] = generator.normal(0.0, 0.1, outputs).astype(np.float32)
    return layers


def make_policy(seed: int = 0, drive: float = 0.0, **arguments: Any) -> Policy:
    """A random policy of PPO; ``drive`` is added to what it asks of both actions."""
    spec = EnvironmentSpec("grouser/PathTracking-v0", {"backend": "physics", **arguments})
    made = spec.make()
    space, actions = made.observation_space, made.action_space
    made.close()
    size = (space.shape or (0,))[0]
    weights = random_layers(
        np.random.default_rng(seed),
        {
            "mlp_extractor.policy_net.0": (size, WIDTH),
            "mlp_extractor.value_net.0": (size, WIDTH),
            "action_net": (WIDTH, 2),
            "value_net": (WIDTH, 1),
        },
    )
    weights["action_net.bias"] += np.float32(drive)
    weights["log_std"] = np.zeros(2, np.float32)
    return Policy(
        Architecture("ppo", (WIDTH,), "tanh"),
        weights,
        space,
        gymnasium.spaces.Box(-1.0, 1.0, actions.shape, np.float32),
        spec.facts(),
        recipe={"n_timesteps": 600},
    )
