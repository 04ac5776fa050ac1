"""The path-tracking task: where it starts, what it shows of the path, what progress earns and when it ends."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final

import numpy as np

from ..native import Tracking
from ..terrain import FloatArray, Ground, TrackedVehicle, resolve_vehicle
from ..terrain.parameters import require_in
from .footing import require_covered
from .observation import LOOK_AHEAD_TIMES, path_sight, reference_speed
from .path import Path, Projection
from .paths import make_path
from .state import VehicleState
from .task import Start, Task
from .task_config import check_options
from .tracking_config import ResetOptions, TrackingConfig


@dataclass
class PathEpisode:
    """What a path-tracking episode remembers.

    Parameters
    ----------
    start : float
        Arc length in m at which it began.
    foot : Projection
        Of the vehicle on the path.
    """

    start: float
    foot: Projection


class PathTask(Task[TrackingConfig, PathEpisode]):
    """Keep on a path; see :class:`~grouser.envs.PathTrackingEnv`.

    Parameters
    ----------
    vehicle, terrain, config
        As of :class:`Task`.
    path : str, path-like or Path
        The path, or its name or file.
    """

    terms: ClassVar = ("progress", "cross_track")
    measures: ClassVar = ("cross_track_error", "progress")

    def __init__(
        self,
        vehicle: str | os.PathLike[str] | TrackedVehicle,
        terrain: str | os.PathLike[str] | Ground,
        config: TrackingConfig,
        path: str | os.PathLike[str] | Path,
    ) -> None:
        vehicle = resolve_vehicle(vehicle)
        self.path: Final = path if isinstance(path, Path) else make_path(path, vehicle)
        self._reference_speed = reference_speed(vehicle, config)
        super().__init__(vehicle, terrain, config)

    @property
    def shown_path(self) -> Path:
        """The path to keep on."""
        return self.path

    @property
    def reference_speed(self) -> float:
        """Speed at which progress earns most, in m/s."""
        return self._reference_speed

    @property
    def memory_size(self) -> int:
        """Start and foot."""
        return 7

    @property
    def broken_off_reward(self) -> float:
        """Reward of standing at the maximum cross-track error, less the weight of progress."""
        config = self.config
        return -config.progress_weight - config.cross_track_weight * (config.maximum_cross_track / 2.0) ** 2

    def prepare_ground(self, terrain: str | os.PathLike[str] | Ground) -> Ground:
        """Return the ground on the configured slope, once its map is seen to reach as far as an episode can."""
        ground = super().prepare_ground(terrain)
        overshoot = self.vehicle.maximum_speed * self.config.control_period + self.vehicle.tread
        require_covered(ground, self.path, self.config.maximum_cross_track + overshoot)
        return ground

    def start(self, generator: np.random.Generator, options: Mapping[str, Any]) -> Start[PathEpisode]:
        """Draw a start near the path; ``options`` as in :class:`ResetOptions`."""
        chosen = check_options(ResetOptions, options)
        self._check_reach(chosen)
        lateral, heading, share, along = generator.uniform(-1.0, 1.0, size=4)
        lateral = chosen.get("lateral_offset", self.config.lateral_spread * lateral)
        heading = chosen.get("heading_offset", self.config.heading_spread * heading)
        lowest = self.config.lowest_start_speed
        speed = chosen.get("speed", self.reference_speed * (lowest + (1 - lowest) * (share + 1) / 2))
        drawn_start = self.path.length * (along + 1) / 2 if self.config.random_start else 0.0
        arc_length = float(chosen.get("arc_length", drawn_start))
        x, y = self.path.point_at(arc_length)
        direction = self.path.heading_at(arc_length)
        drawn = VehicleState.rolling(
            float(speed),
            x=x - float(lateral) * math.sin(direction),
            y=y + float(lateral) * math.cos(direction),
            heading=direction + float(heading),
        )
        state = replace(chosen["state"], time=0.0) if "state" in chosen else drawn
        near = None if "state" in chosen else arc_length
        foot = self.path.project(state.x, state.y, near=near, heading=state.heading)
        return self.begin(state, self.surroundings(generator, chosen), PathEpisode(foot.arc_length, foot))

    def _check_reach(self, options: ResetOptions) -> None:
        fastest, widest, longest = self.vehicle.maximum_speed, self.config.maximum_cross_track, self.path.length
        require_in("reset option speed", options.get("speed", 0.0), -fastest, fastest)
        require_in("reset option lateral_offset", options.get("lateral_offset", 0.0), -widest, widest)
        require_in("reset option arc_length", options.get("arc_length", 0.0), -longest, longest)

    def follow(self, episode: PathEpisode, state: VehicleState) -> None:
        """Move the foot after the vehicle."""
        episode.foot = self.path.project(state.x, state.y, near=episode.foot.arc_length)

    def assess(self, episode: PathEpisode, state: VehicleState) -> tuple[tuple[float, float], bool]:
        """Return the terms of progress and cross-track error, and whether the vehicle is lost or at the end."""
        config, before = self.config, episode.foot.arc_length
        self.follow(episode, state)
        foot = episode.foot
        progress = (foot.arc_length - before) / (self.reference_speed * config.control_period)
        terms = (
            config.progress_weight * min(progress, 2.0 - progress),
            -config.cross_track_weight * (foot.cross_track / 2.0) ** 2,
        )
        driven = foot.arc_length - episode.start if self.path.closed else foot.arc_length
        return terms, bool(driven >= self.path.length or abs(foot.cross_track) > config.maximum_cross_track)

    def show(self, episode: PathEpisode, state: VehicleState) -> FloatArray:
        """Return errors and look-ahead points."""
        return path_sight(state, episode.foot, vehicle=self.vehicle, path=self.path, config=self.config)

    def rules(self) -> Tracking:
        """Return the path and the weights."""
        path, config = self.path, self.config
        nodes = [path.x, path.y, path.heading, path.curvature, np.cos(path.heading), np.sin(path.heading)]
        return Tracking(
            nodes=np.column_stack(nodes),
            length=path.length,
            closed=path.closed,
            reference_speed=self.reference_speed,
            control_period=config.control_period,
            maximum_cross_track=config.maximum_cross_track,
            progress_weight=config.progress_weight,
            cross_track_weight=config.cross_track_weight,
            look_ahead=np.array(LOOK_AHEAD_TIMES),
        )

    def remember(self, episode: PathEpisode) -> FloatArray:
        """Return start and foot, shape (7,)."""
        foot = episode.foot
        return np.array(
            [episode.start, foot.arc_length, foot.cross_track, foot.x, foot.y, foot.heading, foot.curvature]
        )

    def measure(self, episode: PathEpisode, state: VehicleState) -> tuple[float, float]:
        """Return cross-track error and progress, in m."""
        return episode.foot.cross_track, episode.foot.arc_length - episode.start
