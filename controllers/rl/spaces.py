"""Spaces of observations and actions as JSON holds them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import gymnasium
import numpy as np
from numpy.typing import NDArray

from ...terrain import ConfigurationError

_BOX: Final = "box"
_DICTIONARY: Final = "dict"


def space_to_json(space: gymnasium.Space[Any]) -> dict[str, Any]:
    """Return a box of numbers, or a dictionary of such boxes, as JSON can hold it.

    Raises
    ------
    ConfigurationError
        If the space is of another kind.
    """
    if isinstance(space, gymnasium.spaces.Dict):
        return {"kind": _DICTIONARY, "spaces": {key: space_to_json(part) for key, part in space.spaces.items()}}
    if not isinstance(space, gymnasium.spaces.Box) or len(space.shape) != 1:
        raise ConfigurationError(f"a policy takes rows of numbers, or a dictionary of such rows, got {space}")
    return {
        "kind": _BOX,
        "dtype": np.dtype(space.dtype).name,
        "low": _bounds_to_json(space.low),
        "high": _bounds_to_json(space.high),
    }


def space_from_json(content: Mapping[str, Any]) -> gymnasium.Space[Any]:
    """Return what :func:`space_to_json` was given.

    Raises
    ------
    KeyError, TypeError, ValueError
        If it is not the content of a space.
    """
    if content["kind"] == _DICTIONARY:
        return gymnasium.spaces.Dict({key: space_from_json(part) for key, part in content["spaces"].items()})
    dtype: Any = np.dtype(content["dtype"])
    low, high = (np.array([float(bound) for bound in content[end]], dtype) for end in ("low", "high"))
    return gymnasium.spaces.Box(low, high, dtype=dtype)


def describe_space(space: gymnasium.Space[Any]) -> str:
    """Return a space in the few words that an error needs."""
    if isinstance(space, gymnasium.spaces.Dict):
        return ", ".join(f"{key}: {describe_space(part)}" for key, part in space.spaces.items())
    return f"{space.shape[0]} numbers" if space.shape else str(space)


def _bounds_to_json(bounds: NDArray[Any]) -> list[float | str]:
    # JSON has no infinity; float() reads the word.
    return [bound if np.isfinite(bound) else str(bound) for bound in bounds.astype(np.float64).tolist()]
