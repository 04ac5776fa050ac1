"""A training as data: what is trained where, and what is done on the way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ...terrain.parameters import require_whole
from .environment import EnvironmentSpec
from .recipe import Recipe


@dataclass(frozen=True)
class TrainingPlan:
    """A training: what, where, and what is kept of it.

    Parameters
    ----------
    recipe : Recipe
        Algorithm, task and settings.
    environment : mapping
        Arguments of the environment beside the recipe's ``env_kwargs``: ``backend``, ``vehicle``, ``terrain``,
        ``path``, ``backend_options``.
    seed : int
        Of environments, weights and noise. With equal plans, weights are equal to the bit.
    threads : int
        That share the compiled environments; the weights do not depend on their number.
    checkpoint_every : int
        Steps between two checkpoints, rounded up to whole rollouts; 0 for none. At a checkpoint the environments start
        anew, with seeds of their own, whether the training goes on or is resumed there.
    eval_every : int
        Steps between two evaluations, rounded up to whole rollouts; 0 for none.
    eval_environment : mapping
        What of the environment is otherwise where the policy is judged, such as ``{"backend": "physics"}``.
    eval_episodes : int
        Episodes of an evaluation, the same starts every time.

    Raises
    ------
    InvalidInputError
        If a number is impossible.
    """

    recipe: Recipe
    environment: Mapping[str, Any] = field(default_factory=dict)
    seed: int = 0
    threads: int = 1
    checkpoint_every: int = 0
    eval_every: int = 0
    eval_environment: Mapping[str, Any] = field(default_factory=dict)
    eval_episodes: int = 20

    def __post_init__(self) -> None:
        lowest = {"seed": 0, "threads": 1, "checkpoint_every": 0, "eval_every": 0, "eval_episodes": 1}
        for name, least in lowest.items():
            require_whole(name, getattr(self, name), least)

    @property
    def training(self) -> EnvironmentSpec:
        """Where the policy learns."""
        return EnvironmentSpec(self.recipe.environment, {**self.recipe.env_kwargs, **self.environment})

    @property
    def judging(self) -> EnvironmentSpec:
        """Where the policy is judged."""
        return self.training.changed(**self.recipe.eval_env_kwargs).changed(**self.eval_environment)
