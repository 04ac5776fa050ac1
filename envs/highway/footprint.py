"""The rectangle that a vehicle covers."""

from __future__ import annotations

from typing import NamedTuple

from ...terrain import TrackedVehicle
from ...terrain.parameters import require_in


class Footprint(NamedTuple):
    """A rectangle about the middle of the contact length, in m."""

    length: float
    width: float


def footprint_of(vehicle: TrackedVehicle, size: tuple[float, float] | None = None) -> Footprint:
    """Return the footprint of a vehicle.

    Parameters
    ----------
    vehicle : TrackedVehicle
        Its hull covers it, or the rectangle around its tracks where it says nothing of a hull.
    size : tuple of float, optional
        Length and width in m that take its place.

    Raises
    ------
    InvalidInputError
        If the size is not two lengths in (0, 100] m.
    """
    if size is None:
        return Footprint(vehicle.hull_length or vehicle.contact_length, vehicle.hull_width or vehicle.overall_width)
    length, width = size
    require_in("footprint length", length, 0.0, 100.0, low_open=True)
    require_in("footprint width", width, 0.0, 100.0, low_open=True)
    return Footprint(float(length), float(width))
