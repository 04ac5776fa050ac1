"""A trained policy as data: driven without the library that trained it, loaded without pickle."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Final

import gymnasium
import numpy as np
from numpy.typing import NDArray

from ...surrogate.container import content_hash, pack, unpack
from ...terrain import (
    ArtifactError,
    ConfigurationError,
    GrouserError,
    InvalidInputError,
    unknown_name,
    write_aside,
)
from .actor import Actor, read_actor
from .algorithms import Architecture, algorithm_named
from .environment import EnvironmentSpec, require_same_task, trained_vehicle
from .normalizer import ObservationNormalizer
from .policy_codec import FORMAT_VERSION, decode, encode
from .shipped import read_shipped, require_shipped, shipped_policies
from .spaces import describe_space

if TYPE_CHECKING:
    from stable_baselines3.common.policies import BasePolicy

# Where algorithms with a replay buffer keep their actor; all else of their policy is critics.
_ACTOR: Final = "actor."


@dataclass(frozen=True, eq=False)
class Policy:
    """A policy of stable-baselines3 with everything that it takes to drive: weights, statistics, spaces, task.

    Parameters
    ----------
    architecture : Architecture
        Algorithm, layers and activation.
    weights : mapping of str to ndarray
        The policy's state, critics included or left out, by the names that stable-baselines3 gives its parts.
    observation_space, action_space : gymnasium.Space
        A box, or for goals a dictionary of boxes; a box.
    environment : mapping
        What it was trained in: :meth:`EnvironmentSpec.facts`.
    normalizer : ObservationNormalizer, optional
        What observations pass first.
    recipe : mapping
        How it was trained, as JSON can hold it.

    Raises
    ------
    ArtifactError
        If the weights do not fit the architecture and the spaces.
    """

    architecture: Architecture
    weights: Mapping[str, NDArray[Any]]
    observation_space: gymnasium.Space[Any]
    action_space: gymnasium.Space[Any]
    environment: Mapping[str, Any]
    normalizer: ObservationNormalizer | None = None
    recipe: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "weights", {name: _frozen(a) for name, a in self.weights.items()})
        try:
            self._actor.act(self.normalize(self._example()))
        except (KeyError, TypeError, ValueError) as error:
            raise ArtifactError(f"weights, statistics and spaces of the policy do not fit: {error}") from error

    @cached_property
    def _actor(self) -> Actor:
        return read_actor(
            dict(self.weights),
            on_policy=algorithm_named(self.architecture.algorithm).on_policy,
            activation=self.architecture.activation,
            observation_space=self.observation_space,
            action_space=self.action_space,
        )

    @cached_property
    def content_hash(self) -> str:
        """SHA-256 of all that the file holds, in hexadecimal."""
        return content_hash(*encode(self))

    def normalize(self, observation: Any) -> Any:
        """Return an observation as the network takes it."""
        return observation if self.normalizer is None else self.normalizer(observation)

    def act(self, observation: Any) -> NDArray[np.float32]:
        """Return the action without exploration.

        An action has the same bits alone and among others.

        Parameters
        ----------
        observation : ndarray or mapping of str to ndarray, shape (k,) or (n, k)
            As the environment returns it.

        Returns
        -------
        ndarray, shape (a,) or (n, a)

        Raises
        ------
        InvalidInputError
            If the observation has another length or misses a part.
        """
        try:
            return self._actor.act(self.normalize(observation))
        except KeyError as error:
            raise InvalidInputError(
                f"the policy observes {describe_space(self.observation_space)}, got no {error}"
            ) from error

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[NDArray[np.float32], None]:
        """Return the action and no state, as a model of stable-baselines3 does; its helpers take the policy so.

        Raises
        ------
        ConfigurationError
            If exploration is asked for: :meth:`to_sb3` has it.
        """
        if not deterministic:
            raise ConfigurationError("a policy acts without exploration; to_sb3() returns one that explores")
        return self.act(observation), None

    def require(self, environment: Mapping[str, Any] | EnvironmentSpec) -> Policy:
        """Return the policy itself, if it sees in an environment what it was trained to see.

        Raises
        ------
        ConfigurationError
            If the environment is another, or scales observations or actions otherwise.
        """
        facts = environment.facts() if isinstance(environment, EnvironmentSpec) else environment
        require_same_task(self.environment, facts)
        return self

    def environment_spec(self, **changes: Any) -> EnvironmentSpec:
        """Return the environment that the policy is judged in: that of its training, as its recipe has it for judging.

        Parameters
        ----------
        **changes
            Other arguments, such as ``backend="physics"`` or ``terrain="ice"``.

        Raises
        ------
        ConfigurationError
            If the policy would not see there what it was trained to see.
        """
        facts = self.environment
        vehicle = {"vehicle": trained_vehicle(facts)} if "vehicle" in facts else {}
        arguments = {**facts["arguments"], **vehicle, **self.recipe.get("eval_env_kwargs", {}), **changes}
        spec = EnvironmentSpec(facts["id"], arguments)
        self.require(spec)
        return spec

    @property
    def has_critics(self) -> bool:
        """Whether the weights hold the critics too."""
        return any(not name.startswith(_ACTOR) for name in self.weights)

    def without_critics(self) -> Policy:
        """Return the policy with the actor alone: all that drives, in a small part of the bytes.

        Raises
        ------
        ConfigurationError
            If the algorithm learns from fresh rollouts: its actor and critic are one module, and small.
        """
        if algorithm_named(self.architecture.algorithm).on_policy:
            raise ConfigurationError(f"a policy of {self.architecture.algorithm} is one module with its critic")
        kept = {name: array for name, array in self.weights.items() if name.startswith(_ACTOR)}
        return replace(self, weights=kept)

    def to_sb3(self) -> BasePolicy:
        """Rebuild stable-baselines3's policy; it takes observations that :meth:`normalize` returned.

        Returns
        -------
        stable_baselines3.common.policies.BasePolicy
            The whole policy, or without critics the library's ``Actor``, which predicts and explores likewise and has
            nothing to be mistaken for a trained critic.

        Raises
        ------
        ArtifactError
            If the weights are not all of the architecture's.
        ConfigurationError
            If stable-baselines3 or, where needed, sb3-contrib is not installed.
        """
        whole: Any = self.architecture.build_policy(self.observation_space, self.action_space)
        import torch

        prefix = "" if self.has_critics else _ACTOR
        rebuilt: BasePolicy = whole if self.has_critics else whole.actor
        state = {name.removeprefix(prefix): torch.from_numpy(np.array(array)) for name, array in self.weights.items()}
        try:
            rebuilt.load_state_dict(state)
        except RuntimeError as error:
            raise ArtifactError(f"the weights are not those of the policy's architecture: {error}") from error
        rebuilt.set_training_mode(False)
        return rebuilt

    def save(self, path: str | os.PathLike[str]) -> FilePath:
        """Write the policy as one sealed ``.safetensors`` file."""
        return write_aside(FilePath(path), pack(*encode(self)))

    def _example(self) -> Any:
        if isinstance(self.observation_space, gymnasium.spaces.Dict):
            return {
                key: np.zeros(part.shape or (0,), np.float32) for key, part in self.observation_space.spaces.items()
            }
        return np.zeros(self.observation_space.shape or (0,), np.float32)


def _frozen(array: NDArray[Any]) -> NDArray[Any]:
    copy = np.array(array, order="C")
    copy.flags.writeable = False
    return copy


def load_policy(path: str | os.PathLike[str]) -> Policy:
    """Read a policy, checking that it is whole and unaltered.

    Parameters
    ----------
    path : str or path-like
        File, or one of :func:`shipped_policies`.

    Raises
    ------
    ArtifactError
        If there is no such file, or it is truncated, altered, or not a policy.
    ConfigurationError
        If a name without ``.safetensors`` is neither a file nor that of a shipped policy.
    """
    name = str(path)
    if name in shipped_policies():
        policy = _read(read_shipped(name), f"shipped {name}")
        require_shipped(name, policy.content_hash)
        return policy
    file = FilePath(path)
    if file.name == name and not file.suffix and not file.exists():
        raise unknown_name("policy", name, shipped_policies())
    try:
        data = file.read_bytes()
    except OSError as error:
        raise ArtifactError(f"cannot read policy {name!r}: {error.strerror}") from error
    return _read(data, name)


def _read(data: bytes, source: str) -> Policy:
    tensors, metadata = unpack(data, source, FORMAT_VERSION)
    try:
        return Policy(**decode(tensors, metadata))
    except (KeyError, TypeError, ValueError, GrouserError) as error:
        raise ArtifactError(f"{source!r} does not hold a policy: {error}") from error
