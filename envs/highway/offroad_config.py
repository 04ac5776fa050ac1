"""The settings of the off-road task, validated and frozen."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Final

from ...terrain import ConfigurationError, InvalidInputError, Mode, Terrain, resolve_terrain
from ...terrain.parameters import require_in, require_whole
from ..task_config import StartOptions, build_config
from .scene_config import SceneConfig

#: What patches consist of unless settings say otherwise.
PATCH_TERRAINS: Final[Mapping[Mode, tuple[str, ...]]] = {
    "rigid": ("gravel", "snow-packed", "ice"),
    "soil": ("lete-sand", "clayey-soil-55", "snow-sweden"),
}


class OffRoadResetOptions(StartOptions, total=False):
    """What ``reset(options=...)`` takes; whatever is not given is drawn.

    Attributes
    ----------
    state : VehicleState
        The whole initial state, its time set to 0.
    lateral_offset : float
        Of the start, to the left of the road's middle, in m.
    heading_offset : float
        From the road's heading, in rad.
    speed : float
        Initial speed in m/s, belts alike.
    terrain : str, path-like or Terrain
        Ground beside the patches, of the backend's mode.
    """

    lateral_offset: float
    heading_offset: float
    speed: float


@dataclass(frozen=True)
class OffRoadConfig(SceneConfig):
    """Settings of ``grouser/OffRoad-v0``, after those of :class:`SceneConfig`.

    Parameters
    ----------
    reference_speed : float or None
        Speed at which progress earns most, in m/s; half the training speed by default.
    road_points : int
        Points that the road passes through, 20 m apart; at least 4.
    road_width : float
        In m.
    bend : float
        Largest angle in rad between the road's direction, from point to point, and the x axis.
    obstacles : int
        Number of obstacles on the road.
    obstacle_size : tuple of float
        Least and largest edge of an obstacle in m.
    observed_obstacles : int
        How many of them are observed, nearest first.
    patches : int
        Number of patches of other ground.
    patch_terrains : tuple of str, optional
        Grounds of which each patch draws one; by default three of the base ground's mode.
    patch_radius : tuple of float
        Least and largest radius of a patch in m.
    lateral_spread, heading_spread : float
        Half-widths of the uniform draws of the initial offsets, in m and rad.
    progress_weight, cross_track_weight, off_road_weight : float
        Weights of the reward's terms.

    Raises
    ------
    InvalidInputError
        If a number is impossible.
    ConfigurationError
        If a name is unknown.
    """

    changeable: ClassVar = SceneConfig.changeable | {
        "road_points",
        "bend",
        "obstacles",
        "obstacle_size",
        "patches",
        "patch_terrains",
        "patch_radius",
        "lateral_spread",
        "heading_spread",
    }

    time_limit: float = 60.0
    reference_speed: float | None = None
    road_points: int = 9
    road_width: float = 12.0
    bend: float = 0.6
    obstacles: int = 5
    obstacle_size: tuple[float, float] = (1.0, 2.0)
    observed_obstacles: int = 3
    patches: int = 8
    patch_terrains: tuple[str | os.PathLike[str], ...] | None = None
    patch_radius: tuple[float, float] = (4.0, 10.0)
    lateral_spread: float = 0.5
    heading_spread: float = 0.1
    progress_weight: float = 1.0
    cross_track_weight: float = 0.1
    off_road_weight: float = 20.0

    def __post_init__(self) -> None:
        super().__post_init__()
        self._require_positive("reference_speed")
        for name, least, most in (
            ("road_points", 4, 200),
            ("obstacles", 0, 100),
            ("observed_obstacles", 0, 100),
            ("patches", 0, 1000),
        ):
            require_whole(name, getattr(self, name), least, most)
        require_in("road_width", self.road_width, 1.0, 100.0)
        require_in("bend", self.bend, 0.0, 1.0)
        for name, widest in (("obstacle_size", self.road_width / 4), ("patch_radius", 1e3)):
            low, high = _pair(name, getattr(self, name))
            require_in(f"largest of {name}", high, 0.0, widest, low_open=True)
            require_in(f"least of {name}", low, 0.0, high, low_open=True)
            object.__setattr__(self, name, (float(low), float(high)))
        require_in("lateral_spread", self.lateral_spread, 0.0, self.road_width / 2)
        require_in("heading_spread", self.heading_spread, 0.0, 1.0)
        if self.patch_terrains is not None:
            object.__setattr__(self, "patch_terrains", tuple(self.patch_terrains))

    def patch_grounds(self, mode: Mode) -> tuple[Terrain, ...]:
        """Return what patches consist of.

        Raises
        ------
        ConfigurationError
            If one is of another mode.
        """
        names = PATCH_TERRAINS[mode] if self.patch_terrains is None else self.patch_terrains
        grounds = tuple(resolve_terrain(name) for name in names)
        for name, ground in zip(names, grounds, strict=True):
            if ground.mode != mode:
                raise ConfigurationError(f"patches are of the base ground's mode, {mode}, and {name} is {ground.mode}")
        return grounds


def _pair(name: str, values: Any) -> tuple[float, float]:
    try:
        low, high = values
    except (TypeError, ValueError):
        raise InvalidInputError(f"{name} are a least and a largest length, got {values!r}") from None
    return low, high


def offroad_config(settings: Mapping[str, Any]) -> OffRoadConfig:
    """Build the settings from keyword arguments.

    Raises
    ------
    ConfigurationError
        If a key is unknown, with the nearest one that exists.
    """
    return build_config(OffRoadConfig, "OffRoad", settings)
