"""A scenario: ground, path, vehicle and drivers, where its drives start and when they are over."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from ..envs import Driver, Path, VehicleState
from ..terrain import Ground, TrackedVehicle

#: Distance from the path in m at which a drive is given up.
MAXIMUM_CROSS_TRACK: Final = 10.0

DriverFactory = Callable[[], Driver]


@dataclass(frozen=True)
class Scenario:
    """A ground, a path, and the speed to start at.

    Parameters
    ----------
    name : str
        Of the scenario.
    terrain : str
        Of the ground, for the table.
    ground : Ground
        Under the vehicle.
    path : Path
        To drive along.
    vehicle : TrackedVehicle
        That drives.
    speed : float
        Initial speed in m/s.
    drivers : mapping of str to callable
        A fresh driver by controller name.
    backend_options : mapping of str to mapping
        Options of :func:`~grouser.terrain.make_backend` by backend name.
    time_limit : float
        Of a drive, in s.
    maximum_cross_track : float
        Distance from the path in m at which a drive is given up.
    """

    name: str
    terrain: str
    ground: Ground
    path: Path
    vehicle: TrackedVehicle
    speed: float
    drivers: Mapping[str, DriverFactory]
    backend_options: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    time_limit: float = 60.0
    maximum_cross_track: float = MAXIMUM_CROSS_TRACK


def path_driven_or_lost(path: Path, maximum_cross_track: float) -> Callable[[VehicleState], bool]:
    """Return what ends a drive: the path's end, or a distance from it in m at which it counts as lost."""
    near = 0.0

    def over(state: VehicleState) -> bool:
        nonlocal near
        foot = path.project(state.x, state.y, near=near)
        near = foot.arc_length
        return near >= path.length or abs(foot.cross_track) > maximum_cross_track

    return over


def start_state(scenario: Scenario, seed: int) -> VehicleState:
    """Return where a seed's drives start: rolling along the path, a little off it."""
    lateral, heading = np.random.default_rng(seed).uniform(-1.0, 1.0, size=2) * (0.1, 0.01)
    x, y = scenario.path.point_at(0.0)
    direction = scenario.path.heading_at(0.0)
    return VehicleState.rolling(
        scenario.speed,
        x=float(x - lateral * np.sin(direction)),
        y=float(y + lateral * np.cos(direction)),
        heading=float(direction + heading),
    )
