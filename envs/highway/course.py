"""A course off the road map: a winding road, obstacles on it and patches of other ground, drawn for one episode."""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np

from ...terrain import Disc, FloatArray, Patch, Terrain, TerrainField, paint_field
from ..path import Path
from .dependency import import_highway_env
from .lane import SplineLane
from .offroad_config import OffRoadConfig

_roads = import_highway_env("road.road")
_objects = import_highway_env("vehicle.objects")

_POINT_SPACING: Final = 20.0
_PATH_STEP: Final = 0.5
_CELL: Final = 1.0
# Ground beyond the road's edge that is painted; further out it goes on as at the border.
_MARGIN: Final = 20.0
# Road without obstacles at both ends, in m.
_CLEAR_LENGTH: Final = 20.0


class Course(NamedTuple):
    """What is drawn for an episode.

    Parameters
    ----------
    path : Path
        Middle of the road.
    obstacles : ndarray, shape (n, 4)
        Position in m, heading in rad and edge in m of square obstacles.
    patches : tuple of Patch
        Of other ground.
    """

    path: Path
    obstacles: FloatArray
    patches: tuple[Patch, ...]


def draw_course(generator: np.random.Generator, config: OffRoadConfig, grounds: tuple[Terrain, ...]) -> Course:
    """Draw a course.

    The road runs along x, from point to point at an angle within ±``bend``, and starts straight. Obstacles stand one in
    each of as many equal stretches of it, in the middle half, and off the middle line, so that beside each more than
    half of the road is free. Patches lie anywhere along the road.

    Parameters
    ----------
    generator : numpy.random.Generator
        What it is drawn from.
    config : OffRoadConfig
        Settings.
    grounds : tuple of Terrain
        Of which each patch draws one.
    """
    path = _draw_road(generator, config)
    return Course(path, _draw_obstacles(generator, config, path), _draw_patches(generator, config, path, grounds))


def _draw_road(generator: np.random.Generator, config: OffRoadConfig) -> Path:
    angles = generator.uniform(-config.bend, config.bend, config.road_points - 1)
    angles[0] = 0.0
    x = _POINT_SPACING * np.arange(config.road_points)
    y = np.concatenate([[0.0], np.cumsum(_POINT_SPACING * np.tan(angles))])
    return Path.from_points("off-road", np.column_stack([x, y]), spacing=_PATH_STEP)


def _draw_obstacles(generator: np.random.Generator, config: OffRoadConfig, path: Path) -> FloatArray:
    draws = generator.random((config.obstacles, 4))
    low, high = config.obstacle_size
    table = np.zeros((config.obstacles, 4))
    stretch = max(0.0, path.length - 2 * _CLEAR_LENGTH) / max(1, config.obstacles)
    for index, (along, across, turn, large) in enumerate(draws.tolist()):
        edge = low + (high - low) * large
        # From touching the middle line to standing half on the road's edge, on either side.
        side = math.copysign(1.0, across - 0.5)
        lateral = side * (edge / 2 + abs(2 * across - 1) * (config.road_width / 2 - edge))
        station = _CLEAR_LENGTH + (index + 0.25 + along / 2) * stretch
        x, y = path.point_at(station)
        heading = path.heading_at(station)
        table[index] = (
            x - lateral * math.sin(heading),
            y + lateral * math.cos(heading),
            heading + (turn - 0.5) * math.pi / 2,
            edge,
        )
    return table


def _draw_patches(
    generator: np.random.Generator, config: OffRoadConfig, path: Path, grounds: tuple[Terrain, ...]
) -> tuple[Patch, ...]:
    draws = generator.random((config.patches, 4))
    low, high = config.patch_radius
    patches = []
    for along, across, large, which in draws.tolist() if grounds else ():
        x, y = path.point_at(along * path.length)
        heading = path.heading_at(along * path.length)
        lateral = (across - 0.5) * config.road_width
        disc = Disc(x - lateral * math.sin(heading), y + lateral * math.cos(heading), low + (high - low) * large)
        patches.append(Patch(grounds[int(which * len(grounds))], disc))
    return tuple(patches)


def paint_course(course: Course, base: Terrain, road_width: float) -> TerrainField:
    """Return the ground of a course."""
    reach = road_width / 2 + _MARGIN
    x, y = course.path.x, course.path.y
    extent = (float(x.min()) - reach, float(x.max()) + reach, float(y.min()) - reach, float(y.max()) + reach)
    return paint_field(base, extent, spacing=_CELL, patches=course.patches, outside="extend")


def course_network(course: Course, road_width: float) -> Any:
    """Return the road as highway-env's network of one lane."""
    network = _roads.RoadNetwork()
    network.add_lane("start", "end", SplineLane(course.path, road_width))
    return network


def course_obstacles(course: Course) -> list[Any]:
    """Return the obstacles as highway-env's objects."""
    made = []
    for x, y, heading, edge in course.obstacles.tolist():
        obstacle = _objects.Obstacle(None, [x, y], heading=heading)
        obstacle.LENGTH = obstacle.WIDTH = edge
        obstacle.diagonal = math.hypot(edge, edge)
        made.append(obstacle)
    return made
