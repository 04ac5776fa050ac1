"""Train a path-tracking policy with stable-baselines3, on any backend."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from ..envs import PathTrackingEnv
from ..surrogate import DenseNetwork
from ..surrogate.threads import torch_threads
from ..terrain import InvalidInputError, missing_extra
from .policy import TrackingPolicy

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class PPOConfig:
    """Hyper-parameters of proximal policy optimization, for a short budget of tens of thousands of steps.

    Parameters
    ----------
    steps : int
        Environment steps in all; rounded up to whole rollouts.
    environments : int
        Stepped in turn.
    rollout_steps : int
        Steps of each environment between two updates.
    batch_size, epochs : int
        Of an update.
    learning_rate : float
        Of Adam, falling linearly to zero.
    discount : float
        γ.
    hidden : tuple of int
        Widths of actor and critic.
    initial_log_std : float
        Of the exploration noise.
    seed : int
        Of environments, weights and noise.

    Raises
    ------
    InvalidInputError
        If a number is impossible.
    """

    steps: int = 60_000
    environments: int = 4
    rollout_steps: int = 256
    batch_size: int = 256
    epochs: int = 10
    learning_rate: float = 1e-3
    discount: float = 0.97
    hidden: tuple[int, ...] = (64, 64)
    initial_log_std: float = -1.0
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("steps", "environments", "rollout_steps", "batch_size", "epochs", "learning_rate"):
            if not 0 < getattr(self, name) < math.inf:
                raise InvalidInputError(f"{name} must be positive and finite, got {getattr(self, name)!r}")
        whole = ("steps", "environments", "rollout_steps", "batch_size", "epochs", "seed")
        for name, value in [*((name, getattr(self, name)) for name in whole), *(("hidden", w) for w in self.hidden)]:
            if isinstance(value, bool) or not isinstance(value, int) or value < (0 if name == "seed" else 1):
                raise InvalidInputError(f"{name} must be a positive whole number, got {value!r}")
        if not 0 < self.discount <= 1 or not math.isfinite(self.initial_log_std):
            raise InvalidInputError(f"discount must lie in (0, 1] and initial_log_std be finite, got {self.discount}")


def train_policy(
    config: PPOConfig,
    environment: Mapping[str, Any],
    *,
    progress: Progress | None = None,
    tensorboard: str | None = None,
) -> TrackingPolicy:
    """Train PPO on ``grouser/PathTracking-v0``.

    With one torch thread, equal arguments give equal weights.

    Parameters
    ----------
    config : PPOConfig
        Hyper-parameters.
    environment : mapping
        Arguments of :class:`~grouser.envs.PathTrackingEnv`, as JSON can hold them but for ``backend_options``.
    progress : callable, optional
        Called with steps done and steps in all, after each rollout.
    tensorboard : str, optional
        Folder for curves.

    Raises
    ------
    ConfigurationError
        If stable-baselines3 is not installed.
    """
    try:
        import torch
        from stable_baselines3 import PPO
        from stable_baselines3.common.callbacks import BaseCallback
        from stable_baselines3.common.env_util import make_vec_env
    except ImportError as error:
        raise missing_extra("stable-baselines3", "rl") from error

    class Reporter(BaseCallback):
        def _on_step(self) -> bool:
            return True

        def _on_rollout_end(self) -> None:
            if progress is not None:
                progress(min(self.num_timesteps, config.steps), config.steps)

    with torch_threads(1):
        vector = make_vec_env(
            PathTrackingEnv, n_envs=config.environments, seed=config.seed, env_kwargs=dict(environment)
        )
        model = PPO(
            "MlpPolicy",
            vector,
            n_steps=config.rollout_steps,
            batch_size=config.batch_size,
            n_epochs=config.epochs,
            learning_rate=lambda remaining: config.learning_rate * remaining,
            gamma=config.discount,
            policy_kwargs={
                "net_arch": list(config.hidden),
                "log_std_init": config.initial_log_std,
                "activation_fn": torch.nn.Tanh,
            },
            seed=config.seed,
            device="cpu",
            tensorboard_log=tensorboard,
        )
        model.learn(config.steps, callback=Reporter())
    task: PathTrackingEnv = vector.envs[0].unwrapped  # type: ignore[attr-defined]
    actor = torch.nn.Sequential(*model.policy.mlp_extractor.policy_net, model.policy.action_net)
    policy = TrackingPolicy(
        DenseNetwork.from_torch(actor),
        task.vehicle,
        task.config,
        {
            **asdict(config),
            "backend": task.simulator.backend.describe(),
            "path": task.path.name,
            "environment": {key: value for key, value in environment.items() if key != "backend_options"},
        },
    )
    vector.close()
    return policy
