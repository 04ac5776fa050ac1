"""The settings of the path-tracking task, validated and frozen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ..terrain.parameters import require_in
from .task_config import RandomizedTaskConfig, StartOptions, build_config


class ResetOptions(StartOptions, total=False):
    """What ``reset(options=...)`` takes; whatever is not given is drawn.

    Attributes
    ----------
    state : VehicleState
        The whole initial state, its time set to 0; of the others only the terrain then matters.
    arc_length : float
        Where on the path to start, in m.
    lateral_offset : float
        To the left of the path, in m.
    heading_offset : float
        From the path's heading, in rad.
    speed : float
        Initial speed in m/s, belts alike.
    terrain : str, path-like or Ground
        Ground of the episode, of the backend's mode.
    """

    arc_length: float
    lateral_offset: float
    heading_offset: float
    speed: float


@dataclass(frozen=True)
class TrackingConfig(RandomizedTaskConfig):
    """Settings of ``grouser/PathTracking-v0``, after those of :class:`RandomizedTaskConfig`.

    Parameters
    ----------
    reference_speed : float or None
        Speed at which progress earns most, in m/s; half the training speed by default.
    maximum_cross_track : float
        Distance from the path that ends an episode, in m.
    lateral_spread, heading_spread : float
        Half-widths of the uniform draws of the initial offsets, in m and rad.
    random_start : bool
        Whether an episode starts anywhere along the path, as suits training, or at the path's start.
    progress_weight, cross_track_weight : float
        Weights of the reward's terms.

    Raises
    ------
    InvalidInputError
        If a number is impossible.
    ConfigurationError
        If the action mode, the integrator, the ground sampling or what to randomize is unknown.
    """

    changeable: ClassVar = RandomizedTaskConfig.changeable | {"lateral_spread", "heading_spread", "random_start"}

    reference_speed: float | None = None
    maximum_cross_track: float = 5.0
    lateral_spread: float = 0.2
    heading_spread: float = 0.05
    random_start: bool = False
    progress_weight: float = 1.0
    cross_track_weight: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        self._require_flag("random_start")
        require_in("maximum_cross_track", self.maximum_cross_track, 0.0, 1e4, low_open=True)
        self._require_positive("reference_speed")
        for name in ("lateral_spread", "heading_spread"):
            require_in(name, getattr(self, name), 0.0, 1.0)


def tracking_config(settings: Mapping[str, Any]) -> TrackingConfig:
    """Build the settings from keyword arguments.

    Raises
    ------
    ConfigurationError
        If a key is unknown, with the nearest one that exists.
    """
    return build_config(TrackingConfig, "PathTracking", settings)
