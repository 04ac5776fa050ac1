"""Shear force, slip and place of every single cell: what the block only returns the sums of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..block import ShearGrid, element_shares, exact_displacement, rolling_direction, shear_strength, side_loads
from ..interface import FloatArray, Mode
from ..namespace import NUMPY
from ..vehicle import TrackedVehicle


@dataclass(frozen=True, eq=False)
class Cells:
    """All cells of both tracks, rolling resistance left out; every array has shape (n, cells).

    Parameters
    ----------
    x, y : ndarray
        Place from the CG in m.
    slip_x, slip_y : ndarray
        Slip velocity in m/s.
    force_x, force_y : ndarray
        Shear force in N.
    """

    x: FloatArray
    y: FloatArray
    slip_x: FloatArray
    slip_y: FloatArray
    force_x: FloatArray
    force_y: FloatArray

    @property
    def slip_power(self) -> FloatArray:
        """Power in W that each cell loses to the ground, P_slip = −dF · v_s."""
        return -(self.force_x * self.slip_x + self.force_y * self.slip_y)

    @property
    def lateral_moment(self) -> FloatArray:
        """Σ x dFy in N m about the CG, shape (n,): the moment of the lateral forces alone."""
        return np.asarray(np.sum(self.x * self.force_y, axis=-1))


def shear_cells(vehicle: TrackedVehicle, mode: Mode, x: FloatArray, *, grid: ShearGrid, soft_speed: float) -> Cells:
    """Return every cell of the block at each row, with dF = −τ_max (1 − e^(−j/K)) v_s/|v_s| dA.

    Parameters
    ----------
    vehicle : TrackedVehicle
        The vehicle.
    mode : {"rigid", "soil"}
        Terrain mode.
    x : ndarray, shape (n, d)
        Interface array.
    grid : ShearGrid
        Cells, contact option and shear path.
    soft_speed : float
        V_ε in m/s.
    """
    vx, vy, yaw_rate, ax, ay, *belts = NUMPY.columns(x)[:7]
    terrain = NUMPY.columns(x)[7:]
    length, width = vehicle.element_length, vehicle.track_width
    area = length * width / (grid.along * grid.across)
    along = np.repeat(((np.arange(grid.along) + 0.5) / grid.along - 0.5) * length, grid.across)
    across = np.tile(((np.arange(grid.across) + 0.5) / grid.across - 0.5) * width, grid.along)
    shares = element_shares(NUMPY, vehicle, ax)
    parts: list[tuple[FloatArray, ...]] = []
    for sign, vt, side_load in zip((1.0, -1.0), belts, side_loads(NUMPY, vehicle, ay), strict=True):
        direction = rolling_direction(NUMPY, vt, soft_speed)
        for center, share in zip(vehicle.element_centers, shares, strict=True):
            place_x = float(center) + along
            place_y = sign * (vehicle.tread / 2 + across)
            slip_x, slip_y = vx - yaw_rate * place_y - vt, vy + yaw_rate * place_x
            sliding = np.hypot(slip_x, slip_y)
            if grid.contact == "continuous":
                travelled = vehicle.contact_length / 2 - direction * (place_x - vehicle.contact_center)
            else:
                travelled = length / 2 - direction * along
            time = travelled / np.hypot(vt, soft_speed)
            if grid.path == "soft":
                displacement = sliding * time
            else:
                displacement = exact_displacement(NUMPY, slip_x, slip_y, yaw_rate, vt, time)
            strength = shear_strength(NUMPY, vehicle, mode, terrain, side_load * share) * area
            stress = -strength * np.expm1(-displacement / terrain[-1])
            pull = np.divide(stress, sliding, out=np.zeros_like(sliding), where=sliding > 0)
            places = np.broadcast_to(place_x, sliding.shape), np.broadcast_to(place_y, sliding.shape)
            parts.append((*places, slip_x, slip_y, -pull * slip_x, -pull * slip_y))
    return Cells(*(np.concatenate(column, axis=-1) for column in zip(*parts, strict=True)))
