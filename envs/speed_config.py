"""The settings of the speed-tracking task, validated and frozen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ..terrain import InvalidInputError
from ..terrain.parameters import require_in
from .motion_profile import MotionProfile
from .task_config import RandomizedTaskConfig, StartOptions, build_config


class SpeedResetOptions(StartOptions, total=False):
    """What ``reset(options=...)`` takes; whatever is not given is drawn.

    Attributes
    ----------
    state : VehicleState
        The whole initial state, its time set to 0.
    speed : float
        Initial speed in m/s, belts alike; the profile stays as it is drawn.
    profile : MotionProfile
        What is commanded, with the task's number of knots or fewer and its times.
    terrain : str, path-like or Ground
        Ground of the episode, of the backend's mode.
    """

    speed: float
    profile: MotionProfile


@dataclass(frozen=True)
class SpeedConfig(RandomizedTaskConfig):
    """Settings of ``grouser/SpeedTracking-v0``, after those of :class:`RandomizedTaskConfig`.

    Parameters
    ----------
    lowest_speed, highest_speed : float
        Between which the commanded speed is drawn, in m/s; by default 0 and 70 % of the training speed.
    segment_time, ramp_time : float
        The commanded motion changes every ``segment_time`` over ``ramp_time``, in s.
    effort : float
        Share of what ground, drive and belts allow that a drawn profile asks for, in (0, 1].
    speed_tolerance, yaw_rate_tolerance : float
        Errors that earn half of the full reward, in m/s and rad/s; by default 5 % of the training speed, and a tenth
        of ``yaw_rate_scale``.
    speed_weight, yaw_rate_weight : float
        Weights of the reward's terms.

    Raises
    ------
    InvalidInputError
        If a number is impossible.
    ConfigurationError
        If the action mode, the integrator, the ground sampling or what to randomize is unknown.
    """

    changeable: ClassVar = RandomizedTaskConfig.changeable | {"lowest_speed", "highest_speed", "effort"}

    lowest_speed: float = 0.0
    highest_speed: float | None = None
    segment_time: float = 5.0
    ramp_time: float = 2.0
    effort: float = 0.5
    speed_tolerance: float | None = None
    yaw_rate_tolerance: float | None = None
    speed_weight: float = 1.0
    yaw_rate_weight: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        require_in("lowest_speed", self.lowest_speed, -1e2, 1e2)
        if self.highest_speed is not None:
            require_in("highest_speed", self.highest_speed, -1e2, 1e2)
            if self.highest_speed < self.lowest_speed:
                raise InvalidInputError(
                    f"highest_speed must not lie below lowest_speed = {self.lowest_speed:g}, got {self.highest_speed!r}"
                )
        require_in("segment_time", self.segment_time, 0.0, 1e4, low_open=True)
        require_in("ramp_time", self.ramp_time, 0.0, self.segment_time, low_open=True)
        require_in("effort", self.effort, 0.0, 1.0, low_open=True)
        self._require_positive("speed_tolerance", "yaw_rate_tolerance")


def speed_config(settings: Mapping[str, Any]) -> SpeedConfig:
    """Build the settings from keyword arguments.

    Raises
    ------
    ConfigurationError
        If a key is unknown, with the nearest one that exists.
    """
    return build_config(SpeedConfig, "SpeedTracking", settings)
