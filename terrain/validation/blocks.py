"""The two implementations that are validated, built alike: the compiled block, and its NumPy oracle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Final, Literal

import numpy as np

from ..backend import ForceBackend
from ..block import ShearGrid, reference_forces, track_force
from ..exact import ExactBackend
from ..interface import FloatArray, Mode
from ..namespace import NUMPY
from ..physics import PhysicsBackend
from ..vehicle import TrackedVehicle

#: The fine grid of the checks, and the default one: cells an element along and across the track.
FINE: Final = (104, 64)
DEFAULT: Final = (16, 4)

#: Builds a block: ``build(vehicle, mode, grid, soft_speed)``.
Build = Callable[[TrackedVehicle, Mode, ShearGrid, float], ForceBackend]


@dataclass(frozen=True)
class Block:
    """An implementation of the block.

    Parameters
    ----------
    name : str
        As the table calls it.
    build : callable
        ``build(vehicle, mode, grid, soft_speed)`` gives the force backend; the grid says which path.
    """

    name: str
    build: Build


class ReferenceBackend(ForceBackend):
    """The equations evaluated with NumPy, as a backend: the oracle, far dearer than the compiled block.

    Parameters
    ----------
    vehicle : TrackedVehicle
        The vehicle.
    mode : {"rigid", "soil"}
        Terrain mode.
    grid : ShearGrid
        Cells, contact option and shear path.
    soft_speed : float
        V_ε in m/s.
    """

    name: ClassVar[str] = "numpy"
    has_track_forces = True

    def __init__(self, vehicle: TrackedVehicle, mode: Mode, grid: ShearGrid, soft_speed: float) -> None:
        super().__init__(vehicle, mode)
        self.grid, self.soft_speed = grid, soft_speed

    def forces(self, x: FloatArray) -> FloatArray:
        """Return [Qx, Qy, Mz], shape (3,) or (n, 3)."""
        return reference_forces(self.vehicle, self.mode, x, grid=self.grid, soft_speed=self.soft_speed)

    def track_forces(self, x_left: FloatArray, x_right: FloatArray) -> FloatArray:
        """Return [Fx, Fy, M] of each track, shape (n, 2, 3)."""
        inputs = self.check_tracks(x_left, x_right)
        out = np.empty((len(inputs[0]), 2, 3))
        sides: tuple[Literal["left", "right"], ...] = ("left", "right")
        for index, side in enumerate(sides):
            columns = NUMPY.columns(inputs[index])
            out[:, index] = NUMPY.join(
                track_force(
                    NUMPY, self.vehicle, self.mode, columns, side=side, grid=self.grid, soft_speed=self.soft_speed
                )
            )
        return out


def _compiled(vehicle: TrackedVehicle, mode: Mode, grid: ShearGrid, soft_speed: float) -> ForceBackend:
    kind = PhysicsBackend if grid.path == "soft" else ExactBackend
    return kind(vehicle, mode, cells=(grid.along, grid.across), contact=grid.contact, soft_speed=soft_speed)


COMPILED: Final = Block("compiled", _compiled)
ORACLE: Final = Block("NumPy", ReferenceBackend)
BLOCKS: Final = (COMPILED, ORACLE)
