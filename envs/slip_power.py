"""Power that is lost to slip under the tracks."""

from __future__ import annotations

from typing import Final

from ..terrain import Mode, PhysicsBackend, TrackedVehicle
from .footing import track_forces_on
from .simulator import TickRecord

# A plain network has no track forces, and what is lost must not depend on the backend.
_CELLS: Final = (2, 1)


def slip_power_block(vehicle: TrackedVehicle, mode: Mode) -> PhysicsBackend:
    """Return the block that :func:`slip_power` is taken from, whatever the backend of the vehicle."""
    return PhysicsBackend(vehicle, mode, cells=_CELLS)


def slip_power(block: PhysicsBackend, record: TickRecord) -> float:
    """Return VtL F_L + VtR F_R − (Qx Vx + Qy Vy + Mz ω) of the shear forces, in W."""
    tracks = track_forces_on(record.footing, block, record.row, rolling=False)
    belt_power = float(record.row[5:7] @ tracks[:, 0])
    return belt_power - float(record.row[:3] @ tracks.sum(axis=0))
