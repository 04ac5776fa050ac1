"""The algorithms of stable-baselines3 and sb3-contrib by name, and the policies that they train."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module
from inspect import signature
from typing import TYPE_CHECKING, Any, Final

import gymnasium

from ...surrogate.network import ACTIVATIONS, Activation
from ...terrain import missing_extra, unknown_name

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm
    from stable_baselines3.common.policies import BasePolicy

# Of the constructors, what the training itself decides; noise and gSDE change what the deterministic actor is.
_OWN: Final = {
    "self", "policy", "env", "policy_kwargs", "seed", "device", "verbose", "tensorboard_log", "_init_setup_model",
    "use_sde", "sde_sample_freq", "use_sde_at_warmup", "action_noise", "rollout_buffer_class", "rollout_buffer_kwargs",
    "replay_buffer_class", "optimize_memory_usage", "stats_window_size",
}  # fmt: skip
_ACTIVATION_CLASSES: Final = {"relu": "ReLU", "silu": "SiLU", "tanh": "Tanh"}


@dataclass(frozen=True)
class Algorithm:
    """An algorithm.

    Parameters
    ----------
    name : str
        As it is typed.
    package, class_name : str
        Where it is.
    on_policy : bool
        Whether it learns from fresh rollouts or from a replay buffer.
    hindsight : bool
        Whether the replay buffer relabels goals.
    policy_keys : tuple of str
        Keys of ``policy_kwargs`` beside ``net_arch`` and ``activation``.
    """

    name: str
    package: str
    class_name: str
    on_policy: bool = False
    hindsight: bool = False
    policy_keys: tuple[str, ...] = ("log_std_init", "n_critics")

    def load(self) -> type[BaseAlgorithm]:
        """Return the class.

        Raises
        ------
        ConfigurationError
            If its package is not installed.
        """
        try:
            found: type[BaseAlgorithm] = getattr(import_module(self.package), self.class_name)
        except ImportError as error:
            raise missing_extra(self.package.replace("_", "-"), "rl") from error
        return found

    def hyperparameters(self) -> tuple[str, ...]:
        """Return the names that a recipe may set, sorted."""
        return tuple(sorted(set(signature(self.load().__init__).parameters) - _OWN))


ALGORITHMS: Final = {
    algorithm.name: algorithm
    for algorithm in (
        Algorithm("ppo", "stable_baselines3", "PPO", on_policy=True, policy_keys=("log_std_init", "ortho_init")),
        Algorithm("sac", "stable_baselines3", "SAC"),
        Algorithm("tqc", "sb3_contrib", "TQC", policy_keys=("log_std_init", "n_critics", "n_quantiles")),
        Algorithm("her-sac", "stable_baselines3", "SAC", hindsight=True),
        Algorithm(
            "her-tqc", "sb3_contrib", "TQC", hindsight=True, policy_keys=("log_std_init", "n_critics", "n_quantiles")
        ),
    )
}


def algorithm_named(name: str) -> Algorithm:
    """Return an algorithm.

    Raises
    ------
    ConfigurationError
        If there is none of that name.
    """
    if name not in ALGORITHMS:
        raise unknown_name("algorithm", name, ALGORITHMS)
    return ALGORITHMS[name]


@dataclass(frozen=True)
class Architecture:
    """What a policy's weights belong to.

    Parameters
    ----------
    algorithm : str
        That trains it, one of :data:`ALGORITHMS`.
    net_arch : tuple of int
        Hidden widths of actor and critics.
    activation : {"relu", "silu", "tanh"}
        Between the layers.
    options : mapping
        Further arguments of stable-baselines3's policy.

    Raises
    ------
    ConfigurationError
        If a name is unknown.
    """

    algorithm: str
    net_arch: tuple[int, ...]
    activation: Activation
    options: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        known = algorithm_named(self.algorithm).policy_keys
        if self.activation not in ACTIVATIONS:
            raise unknown_name("activation", self.activation, ACTIVATIONS)
        for key in self.options:
            if key not in known:
                raise unknown_name("key of policy_kwargs", key, ("net_arch", "activation", *known))

    def policy_arguments(self) -> dict[str, Any]:
        """Return ``policy_kwargs`` as stable-baselines3 takes them."""
        from torch import nn

        return {
            "net_arch": list(self.net_arch),
            "activation_fn": getattr(nn, _ACTIVATION_CLASSES[self.activation]),
            **self.options,
        }

    def build_policy(self, observation_space: gymnasium.Space[Any], action_space: gymnasium.Space[Any]) -> BasePolicy:
        """Return an untrained policy.

        Raises
        ------
        ConfigurationError
            If stable-baselines3 or sb3-contrib is not installed.
        """
        kind = algorithm_named(self.algorithm).load()
        import torch

        # Building draws weights that nobody keeps: the global generator stays where it was.
        with torch.random.fork_rng(devices=[]):
            policy: BasePolicy = kind.policy_aliases[policy_name(observation_space)](
                observation_space, action_space, lambda _: 0.0, **self.policy_arguments()
            )
        return policy

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON can hold it."""
        return {
            "algorithm": self.algorithm,
            "net_arch": list(self.net_arch),
            "activation": self.activation,
            "options": dict(self.options),
        }

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Architecture:
        """Return what :meth:`to_json` was given."""
        return cls(content["algorithm"], tuple(content["net_arch"]), content["activation"], content["options"])


def policy_name(observation_space: gymnasium.Space[Any]) -> str:
    """Return stable-baselines3's name of the policy for a space."""
    return "MultiInputPolicy" if isinstance(observation_space, gymnasium.spaces.Dict) else "MlpPolicy"
