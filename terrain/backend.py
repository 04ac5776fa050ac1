"""The abstraction that the whole project swaps: a pure function from the interface to [Qx, Qy, Mz]."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import partial
from typing import Any, ClassVar, Final

import numpy as np

from .errors import ConfigurationError, InvalidInputError
from .interface import FloatArray, Interface, Mode, interface
from .vehicle import TrackedVehicle


class ForceBackend(ABC):
    """Track-terrain forces of one vehicle in one terrain mode.

    A backend has no state, no globals, is safe to call from several threads, and survives pickling. Subclasses write
    :meth:`forces`; they override :meth:`forces_and_jacobian` where they know better than central differences, and
    :meth:`track_forces` together with ``has_track_forces`` where they know the tracks apart.

    Parameters
    ----------
    vehicle : TrackedVehicle
        The vehicle.
    mode : {"rigid", "soil"}
        Terrain mode.
    """

    #: Name under which log columns and comparisons mention the backend.
    name: ClassVar[str] = "custom"
    #: Whether :meth:`track_forces` is available.
    has_track_forces: bool = False
    #: Smallest change of force that the arithmetic resolves, relative to the force. Solvers do not ask for more.
    resolution: float = float(np.finfo(np.float64).eps)

    def __init__(self, vehicle: TrackedVehicle, mode: Mode) -> None:
        self.vehicle: Final = vehicle
        self.interface: Final[Interface] = interface(mode)

    @property
    def mode(self) -> Mode:
        """Terrain mode."""
        return self.interface.mode

    @abstractmethod
    def forces(self, x: FloatArray) -> FloatArray:
        """Return [Qx, Qy, Mz] in N, N, N m.

        Parameters
        ----------
        x : ndarray, shape (d,) or (n, d)
            Interface array, float64; columns as in :mod:`grouser.terrain.interface`.

        Returns
        -------
        ndarray, shape (3,) or (n, 3)

        Raises
        ------
        InvalidInputError
            If the shape is wrong or a value is not finite.
        """

    def forces_and_jacobian(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the forces and ∂Q/∂x.

        The default takes central differences, at 2d further calls.

        Returns
        -------
        forces : ndarray, shape (3,) or (n, 3)
        jacobian : ndarray, shape (3, d) or (n, 3, d)
        """
        x = self.interface.check(x)
        return self.forces(x), _central_differences(self.forces, x, self.resolution)

    def track_forces(self, x_left: FloatArray, x_right: FloatArray) -> FloatArray:
        """Return [Fx, Fy, M] of each track, each with its own ground.

        Parameters
        ----------
        x_left, x_right : ndarray, shape (n, d) or (d,)
            Interface arrays that differ only in the terrain parameters.

        Returns
        -------
        ndarray, shape (n, 2, 3)
            Left track, then right; moments about the CG. One row counts as n = 1.

        Raises
        ------
        ConfigurationError
            If the backend does not know the tracks apart.
        """
        raise ConfigurationError(
            f"the {self.name!r} backend gives the force of the whole vehicle, not of each track; "
            "use one with has_track_forces, such as 'physics'"
        )

    def track_forces_and_jacobian(self, x_left: FloatArray, x_right: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the track forces and the derivatives of each by its own input.

        The default takes central differences, at 2d further calls.

        Returns
        -------
        forces : ndarray, shape (n, 2, 3)
        jacobian : ndarray, shape (n, 2, 3, d)

        Raises
        ------
        ConfigurationError
            If the backend does not know the tracks apart.
        """
        left, right = self.check_tracks(x_left, x_right)

        def side(index: int, x: FloatArray) -> FloatArray:
            return self.track_forces(x, x)[:, index]

        slopes = [
            _central_differences(partial(side, index), x, self.resolution) for index, x in enumerate((left, right))
        ]
        return self.track_forces(left, right), np.stack(slopes, axis=1)

    def check_tracks(self, x_left: FloatArray, x_right: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return both inputs as float64 arrays of shape (n, d).

        Raises
        ------
        InvalidInputError
            If a shape is wrong, a value is not finite, or the numbers of rows differ.
        """
        left, right = (np.atleast_2d(self.interface.check(x)) for x in (x_left, x_right))
        if left.shape != right.shape:
            raise InvalidInputError(
                f"x_left and x_right must have equally many rows, got shapes {left.shape} and {right.shape}"
            )
        return left, right

    def describe(self) -> dict[str, Any]:
        """Return what identifies the backend in logs and manifests, as JSON can hold it."""
        return {"backend": self.name, "mode": self.mode, "vehicle": self.vehicle.name}


def _central_differences(forces: Callable[[FloatArray], FloatArray], x: FloatArray, resolution: float) -> FloatArray:
    """Return ∂F/∂x of shape (..., 3, d) for forces of shape (..., 3)."""
    # The cube root of the resolution balances truncation against rounding.
    step = np.maximum(np.abs(x), 1e-2) * resolution ** (1 / 3)
    jacobian = np.empty((*x.shape[:-1], 3, x.shape[-1]))
    for column in range(x.shape[-1]):
        forward, backward = x.copy(), x.copy()
        forward[..., column] += step[..., column]
        backward[..., column] -= step[..., column]
        width = (forward[..., column] - backward[..., column])[..., None]
        jacobian[..., column] = (forces(forward) - forces(backward)) / width
    return jacobian


def assemble(track_forces: FloatArray) -> FloatArray:
    """Sum track forces of shape (..., 2, 3) to the vehicle's [Qx, Qy, Mz], shape (..., 3)."""
    total: FloatArray = np.sum(track_forces, axis=-2)
    return total
