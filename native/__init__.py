"""The C core, behind ``grouser.native._core``: cell-integrated physics, surrogates, guard and whole vehicles."""

from ._core import Detector, Field, Fleet, Gated, Mlp, Physics, TrackNet, columns, cpu_level

__all__ = ["Detector", "Field", "Fleet", "Gated", "Mlp", "Physics", "TrackNet", "columns", "cpu_level"]
