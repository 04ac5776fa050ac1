"""The rectangle that a vehicle covers."""

from __future__ import annotations

from typing import Final, NamedTuple

from ...terrain import TrackedVehicle
from ...terrain.parameters import require_in


class Footprint(NamedTuple):
    """A rectangle about the middle of the contact length, in m."""

    length: float
    width: float


# Overall sizes. The M113's and the Marder's are those published for the machines, the Warthog's is its maker's.
_HULLS: Final = {
    "m113": Footprint(4.86, 2.69),
    "marder": Footprint(6.79, 3.24),
    "warthog": Footprint(1.52, 1.38),
}


def footprint_of(vehicle: TrackedVehicle, size: tuple[float, float] | None = None) -> Footprint:
    """Return the footprint of a vehicle.

    Parameters
    ----------
    vehicle : TrackedVehicle
        Those whose overall size is known by name cover it, others the rectangle around their tracks.
    size : tuple of float, optional
        Length and width in m that take its place.

    Raises
    ------
    InvalidInputError
        If the size is not two lengths in (0, 100] m.
    """
    if size is None:
        return _HULLS.get(vehicle.name, Footprint(vehicle.contact_length, vehicle.overall_width))
    length, width = size
    require_in("footprint length", length, 0.0, 100.0, low_open=True)
    require_in("footprint width", width, 0.0, 100.0, low_open=True)
    return Footprint(float(length), float(width))
