"""What values the hyper-parameters of an algorithm may have, and those that fall with the steps."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import Any, Final

from ...terrain import InvalidInputError

_LINEAR: Final = re.compile(r"lin_(.+)")
_SCHEDULED: Final = ("learning_rate", "clip_range")
_POSITIVE: Final = (
    "learning_rate", "clip_range", "n_steps", "batch_size", "n_epochs", "buffer_size", "max_grad_norm", "tau",
)  # fmt: skip
_SHARES: Final = ("gamma", "gae_lambda", "tau")


def library_arguments(hyperparameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return hyper-parameters as stable-baselines3 takes them: schedules as functions of the share that is left."""
    taken = dict(hyperparameters)
    for name in _SCHEDULED:
        if isinstance(taken.get(name), str):
            taken[name] = _linear(_schedule_start(taken[name]))
    if isinstance(taken.get("train_freq"), list):
        taken["train_freq"] = tuple(taken["train_freq"])
    return taken


def require_possible(name: str, value: Any) -> None:
    """Raise InvalidInputError unless a hyper-parameter may have the value."""
    if isinstance(value, str) and name in _SCHEDULED:
        start = _schedule_start(value)
        if math.isnan(start):
            raise InvalidInputError(f"{name} must be a number, or lin_ and one, such as lin_3e-4, got {value!r}")
        value = start
    if isinstance(value, bool) or not isinstance(value, int | float):
        if name in (*_POSITIVE, *_SHARES):
            raise InvalidInputError(f"{name} must be a number, got {value!r}")
        return
    if not math.isfinite(value) or (name in _POSITIVE and value <= 0):
        raise InvalidInputError(f"{name} must be positive and finite, got {value!r}")
    if name in _SHARES and not 0 <= value <= 1:
        raise InvalidInputError(f"{name} must lie in [0, 1], got {value!r}")


def _linear(start: float) -> Callable[[float], float]:
    return lambda remaining: start * remaining


def _schedule_start(text: str) -> float:
    match = _LINEAR.fullmatch(text)
    try:
        return float(match[1]) if match else math.nan
    except ValueError:
        return math.nan
