"""A curriculum as data: settings of the environment that change at shares of a training's steps."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from ...terrain import ConfigurationError, InvalidInputError, unknown_name
from .environment import EnvironmentSpec

_KEYS: Final = ("at", "settings")


@dataclass(frozen=True)
class Stage:
    """A stage.

    Parameters
    ----------
    at : float
        Share of the training's steps, between 0 and 1, from which on it holds.
    settings : mapping
        Arguments of the environments' ``reconfigure``.
    """

    at: float
    settings: Mapping[str, Any]

    def first_step(self, steps: int) -> int:
        """Return the step of a training of so many at which the stage begins."""
        return math.ceil(self.at * steps)


def read_stages(curriculum: Any) -> tuple[Stage, ...]:
    """Return the stages of a recipe's ``curriculum``: a list of ``{"at": 0.3, "settings": {...}}``.

    Raises
    ------
    ConfigurationError
        If a key is unknown.
    InvalidInputError
        If it is no such list, or a stage does not come after the one before it.
    """
    if not isinstance(curriculum, Sequence) or isinstance(curriculum, str):
        raise InvalidInputError(f"curriculum must be a list of stages, got {curriculum!r}")
    stages: list[Stage] = []
    for entry in curriculum:
        if not isinstance(entry, Mapping):
            raise InvalidInputError(f"a stage of the curriculum has the keys at and settings, got {entry!r}")
        for key in entry:
            if key not in _KEYS:
                raise unknown_name("key of a stage", key, _KEYS)
        at, settings = entry.get("at"), entry.get("settings")
        after = stages[-1].at if stages else 0.0
        if isinstance(at, bool) or not isinstance(at, int | float) or not after < at < 1.0:
            raise InvalidInputError(f"at of a stage must be a number above {after:g} and below 1, got {at!r}")
        if not isinstance(settings, Mapping) or not settings:
            raise InvalidInputError(f"settings of a stage must be a mapping of names to values, got {settings!r}")
        stages.append(Stage(float(at), settings))
    return tuple(stages)


def rehearse(environment: EnvironmentSpec, stages: Sequence[Stage]) -> None:
    """Check that an environment takes every stage, before steps are spent on the way there.

    Raises
    ------
    ConfigurationError
        If its settings do not change while it lives, or one of a stage's does not or is unknown.
    InvalidInputError
        If a value is impossible.
    """
    if not stages:
        return
    made = environment.make()
    try:
        if not made.has_wrapper_attr("reconfigure"):
            raise ConfigurationError(f"{environment.id} has no settings that change while it lives: no curriculum")
        for stage in stages:
            made.get_wrapper_attr("reconfigure")(**stage.settings)
    finally:
        made.close()
