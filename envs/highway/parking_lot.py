"""The lot of parking-v0: two rows of spots along an aisle, walls around them, and what is drawn for an episode."""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np

from .dependency import import_highway_env
from .parking_config import SPOTS_PER_ROW

_lanes = import_highway_env("road.lane")
_roads = import_highway_env("road.road")
_objects = import_highway_env("vehicle.objects")

# As in highway_env.envs.parking_env.
_SPOT_WIDTH: Final = 4.0
_SPOT_LENGTH: Final = 8.0
_AISLE_HALF_WIDTH: Final = 10.0
_LOT_SIZE: Final = (70.0, 42.0)
_PARKED_SIZE: Final = (5.0, 2.0)
_PARKED_DEPTH: Final = 4.0

LaneIndex = tuple[str, str, int]


class ParkingDraw(NamedTuple):
    """What is drawn for an episode.

    Parameters
    ----------
    x, y, heading : float
        Of the start, in m and rad.
    spot : tuple
        Lane index of the goal.
    taken : tuple
        Lane indices of the spots that are taken.
    """

    x: float
    y: float
    heading: float
    spot: LaneIndex
    taken: tuple[LaneIndex, ...]


def spot_network() -> Any:
    """Return the road network of the lot: a lane for each spot, leading out of the aisle."""
    network = _roads.RoadNetwork()
    lines = (_lanes.LineType.CONTINUOUS, _lanes.LineType.CONTINUOUS)
    for spot in range(SPOTS_PER_ROW):
        x = (spot + 1 - SPOTS_PER_ROW // 2) * _SPOT_WIDTH - _SPOT_WIDTH / 2
        for side, nodes in ((1.0, ("a", "b")), (-1.0, ("b", "c"))):
            ends = [x, side * _AISLE_HALF_WIDTH], [x, side * (_AISLE_HALF_WIDTH + _SPOT_LENGTH)]
            network.add_lane(*nodes, _lanes.StraightLane(*ends, width=_SPOT_WIDTH, line_types=lines))
    return network


def spot_index(spot: int) -> LaneIndex:
    """Return the lane index of a spot, counted along the upper row and then along the lower."""
    row, place = divmod(spot, SPOTS_PER_ROW)
    return (("a", "b"), ("b", "c"))[row] + (place,)


def spot_pose(network: Any, index: LaneIndex) -> tuple[float, float, float]:
    """Return x, y and heading of a vehicle in the middle of a spot, its nose away from the aisle."""
    lane = network.get_lane(index)
    x, y = lane.position(lane.length / 2, 0).tolist()
    return x, y, float(lane.heading)


def draw_parking(generator: np.random.Generator, network: Any, *, parked: int, spread: float) -> ParkingDraw:
    """Draw an episode as parking-v0 does, number by number, so that equal seeds give equal starts and goals.

    Parameters
    ----------
    generator : numpy.random.Generator
        What it is drawn from.
    network : highway_env.road.road.RoadNetwork
        The lot's.
    parked : int
        Spots that are taken.
    spread : float
        Half-width in m of the draws of the start's position, which parking-v0 does not make.
    """
    heading = 2.0 * math.pi * generator.uniform()
    # The spot that the start is nearest to is never a goal there; which one that is hangs on the heading alone.
    free = list(network.lanes_dict())
    free.remove(network.get_closest_lane_index(np.zeros(2), heading))

    def take() -> LaneIndex:
        index: LaneIndex = free.pop(int(generator.choice(np.arange(len(free)))))
        return index

    spot = take()
    taken = tuple(take() for _ in range(parked))
    x, y = generator.uniform(-spread, spread, 2).tolist()
    return ParkingDraw(x, y, heading, spot, taken)


def lot_objects(network: Any, draw: ParkingDraw, *, walls: bool) -> list[Any]:
    """Return goal, taken spots and walls as highway-env's objects."""
    x, y, heading = spot_pose(network, draw.spot)
    objects = [_objects.Landmark(None, [x, y], heading=heading)]
    for index in draw.taken:
        lane = network.get_lane(index)
        objects.append(_obstacle(lane.position(_PARKED_DEPTH, 0), float(lane.heading), *_PARKED_SIZE))
    if walls:
        length, width = _LOT_SIZE
        objects += [_obstacle([0.0, y], 0.0, length, 1.0) for y in (-width / 2, width / 2)]
        objects += [_obstacle([x, 0.0], math.pi / 2, width, 1.0) for x in (-length / 2, length / 2)]
    return objects


def _obstacle(position: Any, heading: float, length: float, width: float) -> Any:
    obstacle = _objects.Obstacle(None, position, heading=heading)
    obstacle.LENGTH, obstacle.WIDTH = length, width
    obstacle.diagonal = math.hypot(length, width)
    return obstacle
