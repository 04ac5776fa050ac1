"""How much a ground holds: its grip under a vehicle, at a place and over a view."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from ..terrain import (
    FloatArray,
    Ground,
    Mode,
    OffMapError,
    RigidTerrain,
    SlopedGround,
    SoilTerrain,
    TerrainField,
    TrackedVehicle,
)

# NumPy's tangent differs in its last bit from processor to processor, and commands are drawn by the grip.
_TANGENT: Final = np.frompyfunc(math.tan, 1, 1)

# Places a side of a view at which a ground that is neither a terrain nor a field is looked at.
_SAMPLES: Final = 32


class GripMap(NamedTuple):
    """Grip over a rectangle.

    Parameters
    ----------
    values : ndarray, shape (rows, columns)
        By cell, rows along y, columns along x; NaN off the map.
    low, high : tuple of float
        (x, y) in m of the corners with the lowest and the highest coordinates.
    """

    values: FloatArray
    low: tuple[float, float]
    high: tuple[float, float]


def grip(vehicle: TrackedVehicle, mode: Mode, theta: FloatArray) -> FloatArray:
    """Return the largest shear force that ground returns to a vehicle on the level, over its weight: μ, or A c/W + tan φ.

    Parameters
    ----------
    vehicle : TrackedVehicle
        On the ground.
    mode : {"rigid", "soil"}
        Of the ground.
    theta : ndarray, shape (..., p)
        Terrain parameters.

    Returns
    -------
    ndarray, shape (...)
    """
    if mode == "rigid":
        mu: FloatArray = theta[..., 0]
        return mu
    area = 2 * vehicle.track_width * vehicle.element_length * vehicle.road_wheels
    share: FloatArray = np.asarray(theta[..., 0] * area / vehicle.weight + _TANGENT(theta[..., 1]), dtype=np.float64)
    return share


def grip_at(vehicle: TrackedVehicle, ground: Ground, x: float, y: float) -> float:
    """Return the grip at (x, y) in m; NaN off the map."""
    try:
        return float(grip(vehicle, ground.mode, ground.parameters_at(x, y)))
    except OffMapError:
        return math.nan


def grip_map(vehicle: TrackedVehicle, ground: Ground, low: FloatArray, high: FloatArray) -> GripMap:
    """Return the grip over at least the rectangle between two corners (x, y) in m."""
    while isinstance(ground, SlopedGround):
        ground = ground.ground
    if isinstance(ground, RigidTerrain | SoilTerrain):
        values = grip(vehicle, ground.mode, ground.parameters).reshape(1, 1)
    elif isinstance(ground, TerrainField):
        return _field_map(vehicle, ground, low, high)
    else:
        size = (high - low) / _SAMPLES
        x, y = (low[axis] + (np.arange(_SAMPLES) + 0.5) * size[axis] for axis in (0, 1))
        values = np.array([[grip_at(vehicle, ground, float(a), float(b)) for a in x] for b in y])
    return GripMap(values, (float(low[0]), float(low[1])), (float(high[0]), float(high[1])))


def _field_map(vehicle: TrackedVehicle, field: TerrainField, low: FloatArray, high: FloatArray) -> GripMap:
    """Return the grip of the cells that a rectangle touches."""
    origin = np.array(field.origin)
    first = np.floor((low - origin) / field.spacing).astype(int)
    last = np.ceil((high - origin) / field.spacing).astype(int)
    rows, columns = np.arange(first[1], last[1]), np.arange(first[0], last[0])
    height, width = field.parameters.shape[:2]
    cells = field.parameters[np.clip(rows, 0, height - 1)[:, None], np.clip(columns, 0, width - 1)]
    values = np.array(grip(vehicle, field.mode, cells))
    if field.outside == "refuse":
        values[(rows < 0) | (rows >= height)] = math.nan
        values[:, (columns < 0) | (columns >= width)] = math.nan
    corners = (origin + corner * field.spacing for corner in (first, last))
    begin, end = ((float(x), float(y)) for x, y in corners)
    return GripMap(values, begin, end)
