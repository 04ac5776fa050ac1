"""The C core: the cell-integrated physics and the surrogates' forward passes, behind ``grouser.native._core``."""

from ._core import Mlp, Physics, TrackNet, columns, cpu_level

__all__ = ["Mlp", "Physics", "TrackNet", "columns", "cpu_level"]
