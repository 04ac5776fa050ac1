"""The settings of the path-tracking task, validated and frozen."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Final, Literal, TypedDict, cast

from ..terrain import Ground, InvalidInputError, resolve_ground, unknown_name
from ..terrain.parameters import require_in
from .footing import GROUND_SAMPLINGS, GroundSampling
from .state import VehicleState
from .tick import INTEGRATORS, Integrator

ActionMode = Literal["belts", "twist"]
ACTION_MODES: Final[tuple[ActionMode, ...]] = ("belts", "twist")


class ResetOptions(TypedDict, total=False):
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

    state: VehicleState
    arc_length: float
    lateral_offset: float
    heading_offset: float
    speed: float
    terrain: str | os.PathLike[str] | Ground


@dataclass(frozen=True)
class TrackingConfig:
    """Settings of ``grouser/PathTracking-v0``.

    Parameters
    ----------
    action_mode : {"belts", "twist"}
        Whether an action is left and right belt speed, or speed and yaw rate.
    control_period : float
        In s, a multiple of the tick.
    tick : float
        T_s in s.
    integrator : str
        Of the simulator.
    ground_sampling : {"vehicle", "tracks"}
        Whether θ is taken at the CG or at each track; see :class:`~grouser.envs.Simulator`.
    grade, bank : float
        Slope of the plane in rad, along its x and y axes, positive uphill; added to the ground's own.
    reference_speed : float or None
        Speed at which progress earns most, in m/s; half the training speed by default.
    yaw_rate_scale : float
        Yaw rate of a full ``twist`` action, in rad/s.
    observe_terrain : bool
        Whether the observation ends with the terrain parameters.
    maximum_cross_track : float
        Distance from the path that ends an episode, in m.
    time_limit : float
        Length of an episode in s, after which it is truncated.
    lateral_spread, heading_spread : float
        Half-widths of the uniform draws of the initial offsets, in m and rad.
    lowest_start_speed : float
        Initial speed is drawn from this share of the reference speed up to all of it.
    random_start : bool
        Whether an episode starts anywhere along the path, as suits training, or at the path's start.
    progress_weight, cross_track_weight, action_change_weight, slip_power_weight : float
        Weights of the reward's terms.

    Raises
    ------
    InvalidInputError
        If a number is impossible.
    ConfigurationError
        If the action mode, the integrator or the ground sampling is unknown.
    """

    action_mode: ActionMode = "belts"
    control_period: float = 0.1
    tick: float = 0.01
    integrator: Integrator = "implicit"
    ground_sampling: GroundSampling = "vehicle"
    grade: float = 0.0
    bank: float = 0.0
    reference_speed: float | None = None
    yaw_rate_scale: float = 1.0
    observe_terrain: bool = False
    maximum_cross_track: float = 5.0
    time_limit: float = 40.0
    lateral_spread: float = 0.2
    heading_spread: float = 0.05
    lowest_start_speed: float = 0.5
    random_start: bool = False
    progress_weight: float = 1.0
    cross_track_weight: float = 1.0
    action_change_weight: float = 0.05
    slip_power_weight: float = 0.1

    def __post_init__(self) -> None:
        if self.action_mode not in ACTION_MODES:
            raise unknown_name("action mode", self.action_mode, ACTION_MODES)
        if self.integrator not in INTEGRATORS:
            raise unknown_name("integrator", self.integrator, INTEGRATORS)
        if self.ground_sampling not in GROUND_SAMPLINGS:
            raise unknown_name("ground sampling", self.ground_sampling, GROUND_SAMPLINGS)
        for name in ("grade", "bank"):
            require_in(name, getattr(self, name), -math.pi / 4, math.pi / 4)
        for name in ("observe_terrain", "random_start"):
            if not isinstance(getattr(self, name), bool):
                raise InvalidInputError(f"{name} must be True or False, got {getattr(self, name)!r}")
        for name in ("control_period", "tick", "yaw_rate_scale", "maximum_cross_track", "time_limit"):
            require_in(name, getattr(self, name), 0.0, 1e4, low_open=True)
        if self.reference_speed is not None:
            require_in("reference_speed", self.reference_speed, 0.0, 1e2, low_open=True)
        for name in ("lateral_spread", "heading_spread", "lowest_start_speed"):
            require_in(name, getattr(self, name), 0.0, 1.0)
        for field in fields(self):
            if field.name.endswith("_weight"):
                require_in(field.name, getattr(self, field.name), 0.0, 1e6)


def tracking_config(settings: Mapping[str, Any]) -> TrackingConfig:
    """Build the settings from keyword arguments.

    Raises
    ------
    ConfigurationError
        If a key is unknown, with the nearest one that exists.
    """
    known = {field.name for field in fields(TrackingConfig)}
    for key in settings:
        if key not in known:
            raise unknown_name("PathTracking setting", key, known)
    return TrackingConfig(**settings)


def check_reset_options(options: Mapping[str, Any]) -> ResetOptions:
    """Return the options, once every key is seen to be one and every value to be of its kind.

    Raises
    ------
    ConfigurationError
        If a key is unknown, or the terrain's name is.
    InvalidInputError
        If a number is not finite or a value is of another kind.
    """
    checked: dict[str, Any] = {}
    for key, value in options.items():
        if key not in ResetOptions.__annotations__:
            raise unknown_name("reset option", key, ResetOptions.__annotations__)
        if key == "terrain":
            checked[key] = resolve_ground(value)
        elif key == "state":
            if not isinstance(value, VehicleState):
                raise InvalidInputError(f"the reset option state takes a VehicleState, got {value!r}")
            checked[key] = value
        else:
            try:
                checked[key] = float(value)
            except (TypeError, ValueError):
                checked[key] = math.nan
            if not math.isfinite(checked[key]):
                raise InvalidInputError(f"the reset option {key} takes a finite number, got {value!r}")
    return cast(ResetOptions, checked)
