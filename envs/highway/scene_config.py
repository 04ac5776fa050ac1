"""The settings that both scenes share."""

from __future__ import annotations

from dataclasses import dataclass

from ...terrain.parameters import require_in
from ..task_config import RandomizedTaskConfig


@dataclass(frozen=True)
class SceneConfig(RandomizedTaskConfig):
    """Settings of the tasks in highway-env's scenes, after those of :class:`~grouser.envs.RandomizedTaskConfig`.

    Parameters
    ----------
    scene_period : float
        How often the scene looks for collisions, in s: it divides ``control_period``, and is a multiple of ``tick``.
    top_speed : float or None
        Belt speed of a full action, in m/s; the task's own by default.
    size : tuple of float, optional
        Length and width of the vehicle in m; those of its hull, else of the rectangle around its tracks.
    collision_weight : float
        What a collision costs, and breaking off.

    Raises
    ------
    InvalidInputError
        If a number is impossible.
    ConfigurationError
        If a name is unknown.
    """

    scene_period: float = 0.1
    top_speed: float | None = None
    size: tuple[float, float] | None = None
    collision_weight: float = 20.0

    def __post_init__(self) -> None:
        super().__post_init__()
        require_in("scene_period", self.scene_period, 0.0, 1e4, low_open=True)
        self._require_positive("top_speed")
