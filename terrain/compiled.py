"""What every backend over a compiled kernel shares: the call without checks, and the checks when it is refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, Protocol

import numpy as np

from .backend import ForceBackend
from .errors import InvalidInputError
from .interface import FloatArray, Mode
from .vehicle import CONTACTS, GRAVITY, TrackedVehicle


def block_geometry(vehicle: TrackedVehicle) -> dict[str, Any]:
    """Return what every compiled block takes of a vehicle, by the names that it takes them under."""
    return {
        "contact": CONTACTS.index(vehicle.contact),
        "wheels": vehicle.road_wheels,
        "mass": vehicle.mass,
        "gravity": GRAVITY,
        "contact_length": vehicle.contact_length,
        "element_length": vehicle.element_length,
        "element_spacing": vehicle.element_spacing,
        "tread": vehicle.tread,
        "track_width": vehicle.track_width,
        "cg_height": vehicle.cg_height,
        "contact_center": vehicle.contact_center,
        "soft_speed": vehicle.soft_speed,
    }


class Kernel(Protocol):
    """A compiled force function that writes into its caller's arrays and raises ValueError on what it cannot take."""

    @property
    def kernel(self) -> object:
        """The function as a capsule, for other compiled code."""

    def forces(self, x: FloatArray, forces: FloatArray, /) -> None:
        """Write [Qx, Qy, Mz] of every row."""

    def forces_and_jacobian(self, x: FloatArray, forces: FloatArray, jacobian: FloatArray, /) -> None:
        """Write the forces and ∂Q/∂x of every row."""

    def bind(self, x: FloatArray, forces: FloatArray, jacobian: FloatArray = ..., /) -> Callable[[], None]:
        """Return a function that evaluates the rows held in the arrays."""

    def time_calls(self, x: FloatArray, calls: int, want_jacobian: bool, /) -> float:
        """Return ns a call, each waiting for the last, in turn on the rows."""


class TrackKernel(Protocol):
    """A compiled force function that knows the tracks apart."""

    def track_forces(
        self, x_left: FloatArray, x_right: FloatArray, track_forces: FloatArray, jacobian: FloatArray = ..., /
    ) -> None:
        """Write [Fx, Fy, M] of both tracks of every row and, if asked, their derivatives by their own input."""


class CompiledBackend(ForceBackend):
    """A force backend whose arithmetic is a compiled kernel.

    The kernel looks at every value anyway, so that Python checks an input only once the kernel has refused it.

    Parameters
    ----------
    vehicle : TrackedVehicle
        The vehicle.
    mode : {"rigid", "soil"}
        Terrain mode.
    kernel : Kernel
        The compiled function.
    domain : str
        What the kernel asks of a row besides finite values, for the error.
    tracks : TrackKernel, optional
        The same function by track, where there is one.
    """

    def __init__(
        self,
        vehicle: TrackedVehicle,
        mode: Mode,
        kernel: Kernel,
        *,
        domain: str = "",
        tracks: TrackKernel | None = None,
    ) -> None:
        super().__init__(vehicle, mode)
        self._kernel: Final = kernel
        self._domain = domain
        self._tracks = tracks
        self.has_track_forces = tracks is not None

    @property
    def kernel(self) -> Kernel:
        """The compiled function, for callers that go on in C."""
        return self._kernel

    def forces(self, x: FloatArray) -> FloatArray:
        """Return [Qx, Qy, Mz], shape (3,) or (n, 3); see :meth:`ForceBackend.forces`."""
        x = self._kernel_input(x)
        out = np.empty((*x.shape[:-1], 3))
        try:
            self._kernel.forces(x, out)
        except ValueError as error:
            raise self._refusal(x, error) from error
        return out

    def forces_and_jacobian(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return forces and the analytic ∂Q/∂x over every column."""
        x = self._kernel_input(x)
        out = np.empty((*x.shape[:-1], 3))
        jacobian = np.empty((*x.shape[:-1], 3, self.interface.size))
        try:
            self._kernel.forces_and_jacobian(x, out, jacobian)
        except ValueError as error:
            raise self._refusal(x, error) from error
        return out, jacobian

    def bind(self, x: FloatArray, forces: FloatArray, jacobian: FloatArray | None = None) -> Callable[[], None]:
        """Return ``step``: each call evaluates the rows that ``x`` then holds and writes into the other arrays.

        The arrays are looked at once, here, and held as long as ``step``: a call costs little more than the kernel. It
        allocates nothing and may run in several threads, each on arrays of its own.

        Parameters
        ----------
        x : ndarray, shape (d,) or (n, d)
            Interface rows: float64, C-contiguous, aligned.
        forces : ndarray, shape (3,) or (n, 3)
            Gets [Qx, Qy, Mz]; float64, C-contiguous, writable.
        jacobian : ndarray, shape (3, d) or (n, 3, d), optional
            Gets ∂Q/∂x.

        Returns
        -------
        callable
            Raises ValueError on a row that the kernel cannot take, and writes nothing then.

        Raises
        ------
        InvalidInputError
            If an array is of another kind or size, or two share memory.

        Examples
        --------
        >>> import numpy as np
        >>> from grouser.terrain import make_backend
        >>> backend = make_backend("physics", mode="rigid", vehicle="m113")
        >>> x, forces = np.array([3.0, 0, 0, 0, 0, 3.0, 3.0, 0.7, 0.04, 0.05]), np.empty(3)
        >>> step = backend.bind(x, forces)
        >>> x[5:7] = 3.2
        >>> step()
        >>> bool(forces[0] > 0)
        True
        """
        try:
            return self._kernel.bind(x, forces) if jacobian is None else self._kernel.bind(x, forces, jacobian)
        except (TypeError, ValueError) as error:
            raise InvalidInputError(str(error)) from error

    def track_forces(self, x_left: FloatArray, x_right: FloatArray) -> FloatArray:
        """Return [Fx, Fy, M] of each track, shape (n, 2, 3); see :meth:`ForceBackend.track_forces`."""
        if self._tracks is None:
            return super().track_forces(x_left, x_right)
        left, right = self.check_tracks(x_left, x_right)
        out = np.empty((len(left), 2, 3))
        try:
            self._tracks.track_forces(left, right, out)
        except ValueError as error:
            raise self._refusal(left, error) from error
        return out

    def track_forces_and_jacobian(self, x_left: FloatArray, x_right: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return track forces and the analytic derivatives of each by its own input."""
        if self._tracks is None:
            return super().track_forces_and_jacobian(x_left, x_right)
        left, right = self.check_tracks(x_left, x_right)
        out = np.empty((len(left), 2, 3))
        jacobian = np.empty((*out.shape, self.interface.size))
        try:
            self._tracks.track_forces(left, right, out, jacobian)
        except ValueError as error:
            raise self._refusal(left, error) from error
        return out, jacobian

    def _kernel_input(self, x: Any) -> FloatArray:
        """Return ``x`` itself where its type and layout are the kernel's, else a checked copy."""
        fits = (
            isinstance(x, np.ndarray)
            and 1 <= x.ndim <= 2
            and x.shape[-1] == self.interface.size
            and x.dtype == np.float64
            and x.flags.c_contiguous
            and x.flags.aligned
        )
        return x if fits else self.interface.check(x)

    def _refusal(self, x: FloatArray, error: ValueError) -> InvalidInputError:
        """Return what is wrong with values that the kernel refused."""
        try:
            self.interface.check(x)
        except InvalidInputError as named:
            return named
        return InvalidInputError(f"{error}{'; ' if self._domain else ''}{self._domain}")
