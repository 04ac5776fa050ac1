"""The C core, behind ``grouser.native._core``: cell-integrated physics, surrogates, guard, whole vehicles and their tasks."""

from ._core import (
    Detector,
    Episodes,
    Field,
    Fleet,
    Gated,
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
    "Gated",
    "Mlp",
    "Physics",
    "Speed",
    "TrackNet",
    "Tracking",
    "columns",
    "cpu_level",
]
