"""Vehicle geometry and inertia, validated and frozen, and vehicles from a catalogue."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, fields, replace
from typing import Any, Final, Literal

import numpy as np

from .catalogue import shipped_vehicles, vehicle_sheet
from .errors import GrouserError, InvalidInputError, unknown_name
from .interface import FloatArray
from .parameters import require_in, require_whole

GRAVITY: Final = 9.81

#: How shear builds up: along the whole track, or afresh under each road wheel.
Contact = Literal["continuous", "per_wheel"]
CONTACTS: Final[tuple[Contact, ...]] = ("continuous", "per_wheel")


@dataclass(frozen=True)
class TrackedVehicle:
    """A tracked skid-steer vehicle, or a wheeled one whose wheels of a side turn together.

    Parameters
    ----------
    name : str
        Short name, written into datasets and artifacts.
    mass : float
        m in kg.
    yaw_inertia : float
        I_z in kg m².
    contact_length : float
        L in m, length of each track on the ground: from the rear end of the last contact element to the front end of
        the first.
    tread : float
        B in m, distance between the track centrelines; larger than ``track_width``.
    track_width : float
        b in m.
    cg_height : float
        h in m.
    road_wheels : int
        n a side, one contact element under each.
    sprocket_radius : float
        r in m.
    maximum_speed : float
        Belt speed that the drive can reach, in m/s.
    training_speed : float
        Largest belt-speed command in training, in m/s; not above ``maximum_speed``.
    soft_speed : float
        V_ε in m/s, below which the contact time stays bounded.
    cg_offset : float
        How far the CG lies ahead of the centre of the contact length, in m.
    belt_time_constant : float
        T_d in s, of the first-order lag from belt-speed command to belt speed.
    belt_acceleration : float
        Limit on the rate of belt speed, in m/s².
    patch_length : float, optional
        ℓ in m, length of one contact element; L/n, so that the elements meet, by default. Shorter for a wheeled
        vehicle, whose patches are as far apart as its axles.
    contact : {"continuous", "per_wheel"}
        How shear builds up under this vehicle, unless a physics backend is asked for the other.
    source : str
        Where the numbers come from, the hull's apart. Vehicles that differ in nothing but this, ``synthetic`` and the
        hull are equal: neither rewording a source nor measuring a hull makes one that moves otherwise.
    synthetic : bool
        Whether no machine stands behind some of them.
    hull_length, hull_width : float, optional
        Overall, in m, about the middle of the contact length; those of the tracks where they are not given. It collides
        with what stands in a scene, and moves nothing.

    Raises
    ------
    InvalidInputError
        If a value is impossible.
    """

    name: str
    mass: float
    yaw_inertia: float
    contact_length: float
    tread: float
    track_width: float
    cg_height: float
    road_wheels: int
    sprocket_radius: float
    maximum_speed: float
    training_speed: float
    soft_speed: float = 0.1
    cg_offset: float = 0.0
    belt_time_constant: float = 0.2
    belt_acceleration: float = 4.0
    patch_length: float | None = None
    contact: Contact = "continuous"
    source: str = field(default="user", compare=False)
    synthetic: bool = field(default=False, compare=False)
    hull_length: float | None = field(default=None, compare=False)
    hull_width: float | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        for name in ("mass", "yaw_inertia", "contact_length", "track_width", "sprocket_radius"):
            require_in(name, getattr(self, name), 0.0, 1e9, low_open=True)
        for name in ("maximum_speed", "belt_time_constant", "belt_acceleration"):
            require_in(name, getattr(self, name), 0.0, 1e3, low_open=True)
        require_in("cg_height", self.cg_height, 0.0, 10.0)
        require_in("soft_speed", self.soft_speed, 0.0, 10.0)
        require_in("tread", self.tread, self.track_width, 100.0, low_open=True)
        require_in("training_speed", self.training_speed, 0.0, self.maximum_speed, low_open=True)
        for name in _HULL_FIELDS:
            if getattr(self, name) is not None:
                require_in(name, getattr(self, name), 0.0, 100.0, low_open=True)
        half = self.contact_length / 2
        if not -half < self.cg_offset < half:
            raise InvalidInputError(
                f"the CG must lie over the contact length: cg_offset in ({-half:g}, {half:g}), got {self.cg_offset!r}"
            )
        require_whole("road_wheels", self.road_wheels, 1)
        if self.patch_length is not None:
            longest = self.contact_length / self.road_wheels
            require_in("patch_length", self.patch_length, 0.0, longest, low_open=True)
            if self.road_wheels == 1 and self.patch_length < longest:
                raise InvalidInputError("a single patch is as long as the contact length: leave patch_length out")
        check_contact(self.contact, self)

    @classmethod
    def preset(cls, name: str | os.PathLike[str]) -> TrackedVehicle:
        """Return a vehicle of ``data/vehicles.toml`` or of a catalogue file of your own.

        Parameters
        ----------
        name : str or path-like
            One of :func:`vehicle_names`; or a file, a string that ends in ``.toml`` or any path-like object, with
            ``#name`` behind it where the file holds several vehicles.

        Raises
        ------
        ConfigurationError
            If the name is unknown, or the file holds several vehicles and none was named.
        InvalidInputError
            If the file holds no such vehicle, or an impossible one.

        Examples
        --------
        >>> TrackedVehicle.preset("m113").mass
        11300.0
        """
        sheet = vehicle_sheet(name)
        values: dict[str, Any] = {**sheet.values, **sheet.options}
        # What datasets and artifacts are bound to names no hull, and so not where it was measured either.
        moving = replace(sheet, numbers=tuple(number for number in sheet.numbers if number.name not in _HULL_FIELDS))
        synthetic = any(number.kind == "synthetic" for number in moving.numbers)
        try:
            return cls(name=sheet.name, **values, source="; ".join(moving.sources), synthetic=synthetic)
        except GrouserError as error:
            raise type(error)(f"{os.fspath(name)}: {error}") from error

    @property
    def weight(self) -> float:
        """W = m g in N."""
        return self.mass * GRAVITY

    @property
    def element_length(self) -> float:
        """ℓ in m: ``patch_length``, or L/n."""
        return self.contact_length / self.road_wheels if self.patch_length is None else self.patch_length

    @property
    def element_spacing(self) -> float:
        """Distance of neighbouring element centres in m: (L − ℓ)/(n − 1), which is ℓ where the elements meet."""
        if self.patch_length is None or self.road_wheels == 1:
            return self.element_length
        return (self.contact_length - self.patch_length) / (self.road_wheels - 1)

    @property
    def contact_center(self) -> float:
        """x̄ in m: the centre of the contact length, from the CG."""
        return -self.cg_offset

    @property
    def element_centers(self) -> FloatArray:
        """x_i in m, from the CG, rearmost first, shape (n,)."""
        index = np.arange(self.road_wheels, dtype=np.float64)
        return self.contact_center + (index - (self.road_wheels - 1) / 2) * self.element_spacing

    @property
    def overall_width(self) -> float:
        """B + b in m."""
        return self.tread + self.track_width

    def to_dict(self) -> dict[str, Any]:
        """Return the fields by name, as JSON can hold them, without the hull: what identifies a vehicle that moves."""
        return {field.name: getattr(self, field.name) for field in fields(self) if field.name not in _HULL_FIELDS}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> TrackedVehicle:
        """Build a vehicle from :meth:`to_dict`, with a hull or without.

        Raises
        ------
        ConfigurationError
            If a key is unknown.
        InvalidInputError
            If a value is impossible or missing.
        """
        known = {field.name for field in fields(cls)}
        for key in values:
            if key not in known:
                raise unknown_name("vehicle field", key, known)
        try:
            return cls(**values)
        except TypeError as error:
            raise InvalidInputError(f"incomplete vehicle: {error}") from error

    def same_block(self, other: TrackedVehicle) -> bool:
        """Whether both have the same track-terrain block, and so can share a surrogate."""
        return all(getattr(self, name) == getattr(other, name) for name in _BLOCK_FIELDS)


_HULL_FIELDS: Final = ("hull_length", "hull_width")
_BLOCK_FIELDS: Final = (
    "mass",
    "contact_length",
    "tread",
    "track_width",
    "cg_height",
    "road_wheels",
    "soft_speed",
    "cg_offset",
    "element_length",
    "contact",
)


def check_contact(contact: str, vehicle: TrackedVehicle) -> None:
    """Raise unless the vehicle can have this contact option.

    Raises
    ------
    ConfigurationError
        If the option is unknown.
    InvalidInputError
        If shear is to build up across gaps between patches.
    """
    if contact not in CONTACTS:
        raise unknown_name("contact option", contact, CONTACTS)
    if contact == "continuous" and vehicle.element_length * vehicle.road_wheels < vehicle.contact_length * (1 - 1e-9):
        raise InvalidInputError(
            f"continuous contact needs elements that meet: {vehicle.road_wheels} patches of "
            f"{vehicle.element_length:g} m leave gaps in a contact length of {vehicle.contact_length:g} m; "
            "use contact 'per_wheel'"
        )


def vehicle_names() -> tuple[str, ...]:
    """Names that :meth:`TrackedVehicle.preset` knows, sorted."""
    return tuple(sorted(shipped_vehicles()))


def resolve_vehicle(vehicle: str | os.PathLike[str] | TrackedVehicle) -> TrackedVehicle:
    """Return a vehicle given by preset name, by catalogue file or as itself.

    Raises
    ------
    ConfigurationError
        If it is none of them.
    InvalidInputError
        If the file holds no such vehicle, or an impossible one.
    """
    return vehicle if isinstance(vehicle, TrackedVehicle) else TrackedVehicle.preset(vehicle)
