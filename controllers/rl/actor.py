"""The deterministic actor of a stable-baselines3 policy in NumPy: what drives once training is over."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import count
from typing import Any, Final

import gymnasium
import numpy as np
from numpy.typing import NDArray

from ...surrogate import DenseNetwork
from ...surrogate.container import Tensors
from ...surrogate.network import Activation, NetworkNamespace
from ...terrain import NUMPY, ArtifactError, FloatArray, InvalidInputError

# Row by row, since a product of matrices rounds a row according to those beside it: an action must not depend on how
# many vehicles are driven at once.
_ROW_BY_ROW: Final = NetworkNamespace(
    NUMPY, lambda rows, weights, bias: (rows[..., None, :] @ weights)[..., 0, :] + bias, np.tanh
)


@dataclass(frozen=True, eq=False)
class Actor:
    """From normalized observations to actions.

    Parameters
    ----------
    network : DenseNetwork
        From an observation, its parts one after the other, to an action.
    squashed : bool
        Whether the network's output passes a hyperbolic tangent, or is clipped, to lie in the box.
    low, high : ndarray, shape (a,)
        Bounds of the actions.
    keys : tuple of str
        Parts of an observation that is a dictionary, in the order in which the network takes them.

    Raises
    ------
    ArtifactError
        If the network has another number of outputs than an action.
    """

    network: DenseNetwork
    squashed: bool
    low: FloatArray
    high: FloatArray
    keys: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.network.widths[-1] != len(self.low):
            raise ArtifactError(f"actions are {len(self.low)} numbers, the actor returns {self.network.widths[-1]}")

    def act(self, observation: Any) -> NDArray[np.float32]:
        """Return actions in the box, shape (..., a), of observations of shape (..., k), or of a dictionary of them."""
        if isinstance(observation, Mapping):
            row = np.concatenate([np.asarray(observation[key], np.float64) for key in self.keys], axis=-1)
        else:
            row = np.asarray(observation, np.float64)
        if row.shape[-1:] != self.network.widths[:1]:
            raise InvalidInputError(f"the policy takes {self.network.widths[0]} numbers, got shape {row.shape}")
        action: FloatArray = self.network.forward(_ROW_BY_ROW, row)
        if self.squashed:
            action = self.low + 0.5 * (np.tanh(action) + 1.0) * (self.high - self.low)
        return np.clip(action, self.low, self.high).astype(np.float32)


def read_actor(
    tensors: Tensors,
    *,
    on_policy: bool,
    activation: Activation,
    observation_space: gymnasium.Space[Any],
    action_space: gymnasium.Space[Any],
) -> Actor:
    """Return the actor among the weights of a policy.

    Parameters
    ----------
    tensors : dict
        The policy's state, by the names that stable-baselines3 gives its parts.
    on_policy : bool
        Whether it is PPO's policy or that of SAC and TQC.
    activation : str
        Between the layers.
    observation_space, action_space : gymnasium.Space
        Of the task.

    Raises
    ------
    ArtifactError
        If a layer is missing, or the network does not fit the spaces.
    """
    body, head = ("mlp_extractor.policy_net", "action_net") if on_policy else ("actor.latent_pi", "actor.mu")
    # Activations stand between the layers, at the odd numbers.
    names = [f"{body}.{index}" for index in _while_found(tensors, body)]
    try:
        layers = [(tensors[f"{name}.weight"].T, tensors[f"{name}.bias"]) for name in (*names, head)]
    except KeyError as error:
        raise ArtifactError(f"the policy has no layer {error}") from error
    network = DenseNetwork(activation, tuple(weights for weights, _ in layers), tuple(bias for _, bias in layers))
    parts = observation_space.spaces if isinstance(observation_space, gymnasium.spaces.Dict) else {}
    taken = sum(math.prod(space.shape or ()) for space in (parts.values() or (observation_space,)))
    if taken != network.widths[0]:
        raise ArtifactError(f"observations are {taken} numbers, the actor takes {network.widths[0]}")
    if not isinstance(action_space, gymnasium.spaces.Box):
        raise ArtifactError(f"a policy's actions are a box of numbers, got {action_space}")
    low, high = action_space.low.astype(np.float64), action_space.high.astype(np.float64)
    return Actor(network, not on_policy, low, high, tuple(parts))


def _while_found(tensors: Tensors, body: str) -> list[int]:
    found: list[int] = []
    for index in count(0, 2):
        if f"{body}.{index}.weight" not in tensors:
            return found
        found.append(index)
    return found
