"""The C core: the cell-integrated physics and the surrogates' forward passes and whole vehicles, behind ``grouser.native._core``."""

from ._core import Detector, Field, Fleet, Mlp, Physics, TrackNet, columns, cpu_level

__all__ = ["Detector", "Field", "Fleet", "Mlp", "Physics", "TrackNet", "columns", "cpu_level"]
