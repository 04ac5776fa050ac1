"""Grounds that several rooms' tests drive on."""

from grouser.terrain import Patch, Rectangle, Terrain, TerrainField, paint_field


def stepped(before: Terrain, beyond: Terrain, boundary: float) -> TerrainField:
    """Return one terrain up to a line across the x axis and another beyond it, with a border of millimetres."""
    extent = (boundary - 0.01, boundary + 0.01, -0.005, 0.005)
    patches = [Patch(beyond, Rectangle(x_min=boundary))]
    return paint_field(before, extent, spacing=0.001, patches=patches, outside="extend")
