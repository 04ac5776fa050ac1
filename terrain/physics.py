"""The compiled physics backend: the cell-integrated block in float64."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from ..native import Physics
from .backend import ForceBackend
from .block import CONTACTS, Contact, ShearGrid
from .errors import InvalidInputError
from .interface import MODES, FloatArray, Mode
from .parameters import require_in
from .vehicle import GRAVITY, TrackedVehicle


class PhysicsBackend(ForceBackend):
    """Shear stress integrated over a grid of cells, in compiled float64 with an analytic Jacobian.

    Parameters
    ----------
    vehicle : TrackedVehicle
        The vehicle.
    mode : {"rigid", "soil"}
        Terrain mode.
    cells : tuple of int
        Cells an element along and across the track. ``(2, 1)`` is the coarse physics that a surrogate has to beat.
    contact : {"continuous", "per_wheel"}
        Whether the shear builds up along the whole track or starts afresh under each wheel.
    soft_speed : float, optional
        V_ε in m/s; the vehicle's by default. At 0 a stopped belt is refused.

    Raises
    ------
    InvalidInputError
        If there is no cell, or more wheels than the compiled block holds.
    ConfigurationError
        If the contact option is unknown.
    """

    name: ClassVar[str] = "physics"
    has_track_forces: ClassVar[bool] = True

    def __init__(
        self,
        vehicle: TrackedVehicle,
        mode: Mode,
        *,
        cells: tuple[int, int] = (16, 4),
        contact: Contact = "continuous",
        soft_speed: float | None = None,
    ) -> None:
        super().__init__(vehicle, mode)
        if len(cells) != 2:
            raise InvalidInputError(f"cells are a pair (along, across), got {cells!r}")
        self.grid = ShearGrid(cells[0], cells[1], contact)
        self.soft_speed = vehicle.soft_speed if soft_speed is None else soft_speed
        require_in("soft_speed", self.soft_speed, 0.0, 10.0)
        try:
            self._block = Physics(
                mode=MODES.index(mode),
                contact=CONTACTS.index(contact),
                wheels=vehicle.road_wheels,
                along=self.grid.along,
                across=self.grid.across,
                mass=vehicle.mass,
                gravity=GRAVITY,
                contact_length=vehicle.contact_length,
                tread=vehicle.tread,
                track_width=vehicle.track_width,
                cg_height=vehicle.cg_height,
                contact_center=vehicle.contact_center,
                soft_speed=self.soft_speed,
            )
        except ValueError as error:
            raise InvalidInputError(str(error)) from error

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuild, (self.vehicle, self.mode, self.grid, self.soft_speed)

    def forces(self, x: FloatArray) -> FloatArray:
        """Return [Qx, Qy, Mz], shape (3,) or (n, 3); see :meth:`ForceBackend.forces`."""
        try:
            out = np.empty((*x.shape[:-1], 3))
            self._block.forces(x, out)
        except (AttributeError, ValueError) as error:
            return self.forces(self._corrected(x, error))
        return out

    def forces_and_jacobian(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return forces and the analytic ∂Q/∂x over every column."""
        try:
            out = np.empty((*x.shape[:-1], 3))
            jacobian = np.empty((*x.shape[:-1], 3, self.interface.size))
            self._block.forces_and_jacobian(x, out, jacobian)
        except (AttributeError, ValueError) as error:
            return self.forces_and_jacobian(self._corrected(x, error))
        return out, jacobian

    def track_forces(self, x_left: FloatArray, x_right: FloatArray) -> FloatArray:
        """Return [Fx, Fy, M] of each track, shape (n, 2, 3); see :meth:`ForceBackend.track_forces`."""
        left, right = (np.atleast_2d(self.interface.check(x)) for x in (x_left, x_right))
        out = np.empty((left.shape[0], 2, 3))
        try:
            self._block.track_forces(left, right, out)
        except ValueError as error:
            raise InvalidInputError(str(error)) from error
        return out

    def describe(self) -> dict[str, Any]:
        """Return backend, mode, vehicle, grid, contact option and V_ε."""
        return super().describe() | {
            "cells": [self.grid.along, self.grid.across],
            "contact": self.grid.contact,
            "soft_speed": self.soft_speed,
        }

    def _corrected(self, x: Any, error: Exception) -> FloatArray:
        """Convert an input that the block could not take, or say what is wrong with it."""
        checked = self.interface.check(x)
        if isinstance(x, np.ndarray) and checked is x:
            raise InvalidInputError(f"{error}; k must be positive, and with soft_speed 0 every belt must run")
        return checked


def _rebuild(vehicle: TrackedVehicle, mode: Mode, grid: ShearGrid, soft_speed: float) -> PhysicsBackend:
    return PhysicsBackend(vehicle, mode, cells=(grid.along, grid.across), contact=grid.contact, soft_speed=soft_speed)
