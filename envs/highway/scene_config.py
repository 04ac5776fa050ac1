"""The settings that both scenes share."""

from __future__ import annotations

import os
from dataclasses import dataclass

from ...terrain import (
    RANGE_NAMES,
    ConfigurationError,
    InvalidInputError,
    resolve_terrain,
    unknown_name,
)
from ...terrain.parameters import require_in
from ..task_config import TaskConfig


@dataclass(frozen=True)
class SceneConfig(TaskConfig):
    """Settings of the tasks in highway-env's scenes, after those of :class:`~grouser.envs.TaskConfig`.

    Parameters
    ----------
    scene_period : float
        How often the scene looks for collisions, in s: it divides ``control_period``, and is a multiple of ``tick``.
    top_speed : float or None
        Belt speed of a full action, in m/s; the task's own by default.
    terrains : tuple of str
        Grounds of which every episode draws one, in place of the environment's own.
    terrain_range : {"wide", "paper"}, optional
        Ranges from which every episode draws its ground instead.
    size : tuple of float, optional
        Length and width of the vehicle in m; those of the machine where they are known, else of the rectangle around
        its tracks.
    collision_weight : float
        What a collision costs, and breaking off.

    Raises
    ------
    InvalidInputError
        If a number is impossible.
    ConfigurationError
        If a name is unknown, or both ``terrains`` and ``terrain_range`` are given.
    """

    scene_period: float = 0.1
    top_speed: float | None = None
    terrains: tuple[str | os.PathLike[str], ...] = ()
    terrain_range: str | None = None
    size: tuple[float, float] | None = None
    collision_weight: float = 20.0

    def __post_init__(self) -> None:
        super().__post_init__()
        require_in("scene_period", self.scene_period, 0.0, 1e4, low_open=True)
        if self.top_speed is not None:
            require_in("top_speed", self.top_speed, 0.0, 1e2, low_open=True)
        if isinstance(self.terrains, str | os.PathLike):
            raise InvalidInputError(f"terrains is a sequence of names, got {self.terrains!r}")
        object.__setattr__(self, "terrains", tuple(self.terrains))
        if len({resolve_terrain(name).mode for name in self.terrains}) > 1:
            raise ConfigurationError(f"the terrains of a task have one mode, got {self.terrains!r}")
        if self.terrain_range is not None:
            if self.terrain_range not in RANGE_NAMES:
                raise unknown_name("terrain range", self.terrain_range, RANGE_NAMES)
            if self.terrains:
                raise ConfigurationError("terrains and terrain_range both draw the ground: give one of them")
