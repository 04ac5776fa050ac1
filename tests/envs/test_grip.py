"""Grip: what a ground holds of a vehicle's weight, at a place and over a view."""

import math

import numpy as np
import pytest

from grouser.envs.grip import grip, grip_at, grip_map
from grouser.terrain import Disc, Patch, Terrain, TerrainField, TrackedVehicle, named, paint_field, terrain_names
from grouser.terrain.closed_forms import shear_capacity

M113 = TrackedVehicle.preset("m113")


@pytest.mark.parametrize("name", terrain_names())
def test_is_the_shear_capacity_over_the_weight(name: str) -> None:
    terrain: Terrain = named(name)
    share = shear_capacity(M113, terrain) / M113.weight
    assert grip(M113, terrain.mode, terrain.parameters) == pytest.approx(share, rel=1e-14)


def test_a_map_holds_the_cells_of_a_field() -> None:
    """At a cell's centre in the midst of a patch, field and cell agree."""
    patch = Patch(named("heavy-clay-25"), Disc(6.0, -2.0, 4.0))
    field = paint_field(named("lete-sand"), (-20.0, 20.0, -20.0, 20.0), spacing=0.5, patches=[patch])
    shown = grip_map(M113, field, np.array([-3.3, -9.9]), np.array([12.7, 8.2]))
    assert shown.low == (-3.5, -10.0)
    assert shown.high == (13.0, 8.5)
    for x, y in ((6.25, -2.25), (-2.25, 5.25)):
        row, column = int((y - shown.low[1]) / 0.5), int((x - shown.low[0]) / 0.5)
        assert shown.values[row, column] == pytest.approx(grip_at(M113, field, x, y), rel=1e-12)


def test_off_the_map_there_is_none() -> None:
    field = TerrainField.uniform(named("asphalt"), (0.0, 4.0, 0.0, 2.0))
    values = grip_map(M113, field, np.array([-1.0, -1.0]), np.array([6.0, 3.0])).values
    assert np.isnan(values).tolist() == [
        [not (1 <= row <= 2 and 1 <= column <= 4) for column in range(7)] for row in range(4)
    ]
    assert math.isnan(grip_at(M113, field, 5.0, 1.0))
