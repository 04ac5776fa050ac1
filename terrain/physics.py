"""The compiled physics backend: the cell-integrated block, in float64 unless asked for float32."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Final, Literal

import numpy as np

from ..native import Physics
from .block import SHEAR_PATHS, ShearGrid, ShearPath
from .compiled import CompiledBackend, block_geometry
from .errors import InvalidInputError, unknown_name
from .interface import MODES, Mode, interface
from .parameters import require_in
from .vehicle import CONTACTS, Contact, TrackedVehicle, check_contact

Precision = Literal["float64", "float32"]
#: In the order of the compiled block's enumeration.
PRECISIONS: Final[tuple[Precision, ...]] = ("float64", "float32")

_DOMAIN: Final = "k must be positive, and with soft_speed 0 every belt must run"


class PhysicsBackend(CompiledBackend):
    """Shear stress integrated over a grid of cells, compiled, with an analytic Jacobian.

    Parameters
    ----------
    vehicle : TrackedVehicle
        The vehicle.
    mode : {"rigid", "soil"}
        Terrain mode.
    cells : tuple of int
        Cells an element along and across the track. ``(2, 1)`` is the coarse physics that a surrogate has to beat.
    contact : {"continuous", "per_wheel"}, optional
        Whether the shear builds up along the whole track or starts afresh under each wheel; the vehicle's by default.
    soft_speed : float, optional
        V_ε in m/s; the vehicle's by default. At 0 a stopped belt is refused.
    precision : {"float64", "float32"}
        Of the sums over the cells; float32 is within 1e-5 of the force scale, and faster.

    Raises
    ------
    InvalidInputError
        If there is no cell, more wheels than the compiled block holds, continuous contact over patches with gaps, or
        float32 is asked of the exact path.
    ConfigurationError
        If the contact option or the precision is unknown.
    """

    name: ClassVar[str] = "physics"
    #: How the shear displacement of a cell is found; see :class:`~grouser.terrain.ShearGrid`.
    shear_path: ClassVar[ShearPath] = "soft"

    def __init__(
        self,
        vehicle: TrackedVehicle,
        mode: Mode,
        *,
        cells: tuple[int, int] = (16, 4),
        contact: Contact | None = None,
        soft_speed: float | None = None,
        precision: Precision = "float64",
    ) -> None:
        if len(cells) != 2:
            raise InvalidInputError(f"cells are a pair (along, across), got {cells!r}")
        self.grid = ShearGrid(cells[0], cells[1], contact or vehicle.contact, self.shear_path)
        check_contact(self.grid.contact, vehicle)
        self.soft_speed = vehicle.soft_speed if soft_speed is None else soft_speed
        require_in("soft_speed", self.soft_speed, 0.0, 10.0)
        if precision not in PRECISIONS:
            raise unknown_name("precision", precision, PRECISIONS)
        self.precision: Final[Precision] = precision
        self.resolution = float(np.finfo(precision).eps)
        mode_index = MODES.index(interface(mode).mode)
        try:
            block = Physics(
                mode=mode_index,
                path=SHEAR_PATHS.index(self.grid.path),
                precision=PRECISIONS.index(precision),
                along=self.grid.along,
                across=self.grid.across,
                **block_geometry(vehicle)
                | {"contact": CONTACTS.index(self.grid.contact), "soft_speed": self.soft_speed},
            )
        except ValueError as error:
            raise InvalidInputError(str(error)) from error
        super().__init__(vehicle, mode, block, domain=_DOMAIN, tracks=block)

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuild, (type(self), self.vehicle, self.mode, self.grid, self.soft_speed, self.precision)

    def describe(self) -> dict[str, Any]:
        """Return backend, mode, vehicle, grid, contact option, V_ε and, where it is not float64, the precision."""
        precision = {} if self.precision == "float64" else {"precision": self.precision}
        return (
            super().describe()
            | precision
            | {
                "cells": [self.grid.along, self.grid.across],
                "contact": self.grid.contact,
                "soft_speed": self.soft_speed,
            }
        )


def physics_options(description: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options that build the physics backend of a :meth:`PhysicsBackend.describe` again."""
    options = {name: description[name] for name in ("contact", "soft_speed", "precision") if name in description}
    return options | ({"cells": tuple(description["cells"])} if "cells" in description else {})


def _rebuild(
    kind: type[PhysicsBackend],
    vehicle: TrackedVehicle,
    mode: Mode,
    grid: ShearGrid,
    soft_speed: float,
    precision: Precision,
) -> PhysicsBackend:
    return kind(
        vehicle,
        mode,
        cells=(grid.along, grid.across),
        contact=grid.contact,
        soft_speed=soft_speed,
        precision=precision,
    )
