"""The C core: the cell-integrated physics and the surrogates' forward passes, whole vehicles and their tasks."""

from ._core import (
    Detector,
    Episodes,
    Field,
    Fleet,
    Mlp,
    Physics,
    Speed,
    Tracking,
    TrackNet,
    columns,
    cpu_level,
)

__all__ = [
    "Detector",
    "Episodes",
    "Field",
    "Fleet",
    "Mlp",
    "Physics",
    "Speed",
    "TrackNet",
    "Tracking",
    "columns",
    "cpu_level",
]
