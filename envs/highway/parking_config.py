"""The settings of the parking task, validated and frozen."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ...terrain import ConfigurationError, InvalidInputError
from ...terrain.parameters import require_in, require_whole
from ..task_config import StartOptions, build_config, check_options
from .goal import GOAL_NAMES, Tolerance
from .scene_config import SceneConfig

#: Spots of the lot: two rows of 14, as in parking-v0.
SPOTS_PER_ROW = 14


class ParkingResetOptions(StartOptions, total=False):
    """What ``reset(options=...)`` takes; whatever is not given is drawn.

    Attributes
    ----------
    state : VehicleState
        The whole initial state, its time set to 0.
    heading : float
        Initial heading in rad.
    spot : int
        Where to park: 0 to 13 in the row above the aisle (y > 0), 14 to 27 in the row below, each along x.
    terrain : str, path-like or Ground
        Ground of the episode, of the backend's mode.
    """

    heading: float
    spot: int


@dataclass(frozen=True)
class ParkingConfig(SceneConfig):
    """Settings of ``grouser/Parking-v0``, after those of :class:`SceneConfig`.

    Parameters
    ----------
    reward_weights : tuple of float
        w_i of the goal's parts x, y, vx, vy, cos, sin, each measured in its scale.
    reward_exponent : float
        p of the norm, in (0, 2].
    position_tolerance, heading_tolerance, speed_tolerance : float
        What still counts as parked, in m, rad and m/s.
    start_spread : float
        Half-width in m of the uniform draws of the start's x and y; 0 as in parking-v0.
    parked_vehicles : int
        Spots that are taken.
    observed_obstacles : int
        How many of them are observed, nearest first.
    walls : bool
        Whether walls stand around the lot.

    Raises
    ------
    InvalidInputError
        If a number is impossible.
    ConfigurationError
        If a name is unknown, or a setting has no meaning here.
    """

    changeable: ClassVar = (SceneConfig.changeable - {"lowest_start_speed"}) | {
        "position_tolerance",
        "heading_tolerance",
        "speed_tolerance",
        "start_spread",
        "parked_vehicles",
        "walls",
    }

    control_period: float = 0.2
    time_limit: float = 30.0
    action_change_weight: float = 0.0
    slip_power_weight: float = 0.0
    reward_weights: tuple[float, ...] = (0.25, 0.25, 0.1, 0.1, 0.1, 0.1)
    reward_exponent: float = 0.5
    position_tolerance: float = 0.5
    heading_tolerance: float = math.radians(10.0)
    speed_tolerance: float = 0.1
    start_spread: float = 0.0
    parked_vehicles: int = 0
    observed_obstacles: int = 4
    walls: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        self._require_flag("walls")
        weights = tuple(self.reward_weights)
        if len(weights) != len(GOAL_NAMES):
            raise InvalidInputError(f"reward_weights are {len(GOAL_NAMES)} numbers, {GOAL_NAMES}, got {weights!r}")
        for name, weight in zip(GOAL_NAMES, weights, strict=True):
            require_in(f"reward weight of {name}", weight, 0.0, 1e6)
        object.__setattr__(self, "reward_weights", tuple(map(float, weights)))
        require_in("reward_exponent", self.reward_exponent, 0.0, 2.0, low_open=True)
        for name, loosest in (("position", 1e3), ("heading", math.pi), ("speed", 1e3)):
            require_in(f"{name}_tolerance", getattr(self, f"{name}_tolerance"), 0.0, loosest, low_open=True)
        require_in("start_spread", self.start_spread, 0.0, 5.0)
        for name, most in (("parked_vehicles", 2 * SPOTS_PER_ROW - 2), ("observed_obstacles", 2 * SPOTS_PER_ROW)):
            require_whole(name, getattr(self, name), 0, most)

    @property
    def tolerance(self) -> Tolerance:
        """What still counts as parked."""
        return Tolerance(self.position_tolerance, self.heading_tolerance, self.speed_tolerance)


def parking_config(settings: Mapping[str, Any]) -> ParkingConfig:
    """Build the settings from keyword arguments.

    Raises
    ------
    ConfigurationError
        If a key is unknown, with the nearest one that exists, or has no meaning here.
    """
    if "lowest_start_speed" in settings:
        raise ConfigurationError("a vehicle that is to be parked starts at rest: there is no lowest_start_speed")
    return build_config(ParkingConfig, "Parking", settings)


def check_parking_options(options: Mapping[str, Any]) -> ParkingResetOptions:
    """Return the options, once every key is seen to be one and every value to be of its kind.

    Raises
    ------
    ConfigurationError
        If a key is unknown, or the terrain's name is.
    InvalidInputError
        If a number is impossible or a value is of another kind.
    """
    checked = check_options(ParkingResetOptions, options)
    if "spot" in checked:
        spot = checked["spot"]
        if spot != round(spot) or not 0 <= spot < 2 * SPOTS_PER_ROW:
            raise InvalidInputError(f"the reset option spot is a whole number below {2 * SPOTS_PER_ROW}, got {spot!r}")
        checked["spot"] = int(spot)
    return checked
