"""A recipe as a model of stable-baselines3, and a model as a policy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ...terrain import ConfigurationError
from .algorithms import policy_name
from .hindsight import hindsight_buffer
from .normalizer import ObservationNormalizer
from .policy import Policy
from .recipe import Recipe

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm
    from stable_baselines3.common.vec_env import VecEnv


def build_model(recipe: Recipe, environment: VecEnv, seed: int) -> BaseAlgorithm:
    """Return an untrained model on the environment, which is normalized first where the recipe says so.

    Raises
    ------
    ConfigurationError
        If goals are to be relabelled and the environment has none.
    """
    arguments = recipe.arguments()
    if recipe.normalize:
        from stable_baselines3.common.vec_env import VecNormalize

        own = dict(recipe.normalize) if isinstance(recipe.normalize, Mapping) else {}
        environment = VecNormalize(environment, **({"gamma": arguments.get("gamma", 0.99)} | own))
    if recipe.kind.hindsight:
        if policy_name(environment.observation_space) == "MlpPolicy":
            raise ConfigurationError(f"{recipe.algorithm} relabels goals, and {recipe.environment} has none")
        arguments["replay_buffer_class"] = hindsight_buffer()
    return recipe.kind.load()(
        policy_name(environment.observation_space),
        environment,
        policy_kwargs=recipe.architecture.policy_arguments(),
        seed=seed,
        device="cpu",
        **arguments,
    )


def policy_of(model: BaseAlgorithm, recipe: Recipe, facts: Mapping[str, Any], trained: Mapping[str, Any]) -> Policy:
    """Return a model's policy as it is now.

    Parameters
    ----------
    model : BaseAlgorithm
        Of stable-baselines3.
    recipe : Recipe
        That it is trained by.
    facts : mapping
        Of its environment.
    trained : mapping
        What else to keep beside the recipe, such as seed and steps.
    """
    wrapper = model.get_vec_normalize_env()
    return Policy(
        recipe.architecture,
        {name: value.detach().cpu().numpy().copy() for name, value in model.policy.state_dict().items()},
        model.observation_space,
        model.action_space,
        facts,
        None if wrapper is None else ObservationNormalizer.from_vec_normalize(wrapper),
        {**recipe.to_json(), **trained},
    )
