"""The C core: the cell-integrated physics and the network's forward pass, behind ``grouser.native._core``."""

from ._core import Mlp, Physics, columns, cpu_level

__all__ = ["Mlp", "Physics", "columns", "cpu_level"]
