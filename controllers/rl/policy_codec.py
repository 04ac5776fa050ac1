"""A policy as named tensors and JSON metadata, and back."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from ...surrogate.container import Tensors
from ...terrain import ArtifactError
from .algorithms import Architecture
from .normalizer import ObservationNormalizer
from .spaces import space_from_json, space_to_json

if TYPE_CHECKING:
    from .policy import Policy

FORMAT_VERSION: Final = 1
_KIND: Final = "policy"
_WEIGHTS: Final = "policy."


def encode(policy: Policy) -> tuple[Tensors, dict[str, Any]]:
    """Return weights and statistics as tensors, and the metadata."""
    tensors = {f"{_WEIGHTS}{name}": array for name, array in policy.weights.items()}
    if policy.normalizer is not None:
        tensors |= policy.normalizer.to_tensors()
    return tensors, {
        "format_version": FORMAT_VERSION,
        "kind": _KIND,
        "architecture": policy.architecture.to_json(),
        "observation_space": space_to_json(policy.observation_space),
        "action_space": space_to_json(policy.action_space),
        "normalizer": None if policy.normalizer is None else policy.normalizer.to_json(),
        "environment": dict(policy.environment),
        "recipe": dict(policy.recipe),
    }


def decode(tensors: Tensors, metadata: dict[str, Any]) -> dict[str, Any]:
    """Return what the policy's constructor takes, by name.

    Raises
    ------
    KeyError, TypeError, ValueError
        If a tensor or a key is missing or of another kind.
    ArtifactError
        If it is not a policy.
    GrouserError
        If a part is refused by its own constructor.
    """
    if metadata["kind"] != _KIND:
        raise ArtifactError(f"it is a {metadata['kind']}")
    statistics = metadata["normalizer"]
    return {
        "architecture": Architecture.from_json(metadata["architecture"]),
        "weights": {name.removeprefix(_WEIGHTS): array for name, array in tensors.items() if name.startswith(_WEIGHTS)},
        "observation_space": space_from_json(metadata["observation_space"]),
        "action_space": space_from_json(metadata["action_space"]),
        "environment": metadata["environment"],
        "normalizer": None if statistics is None else ObservationNormalizer.from_file(tensors, statistics),
        "recipe": metadata["recipe"],
    }
