"""What every backend over a compiled kernel shares: the call without checks, and the checks when it is refused."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from .backend import ForceBackend
from .errors import InvalidInputError
from .interface import FloatArray, Mode
from .vehicle import TrackedVehicle


class Kernel(Protocol):
    """A compiled force function that writes into its caller's arrays and raises ValueError on what it cannot take."""

    def forces(self, x: FloatArray, forces: FloatArray, /) -> None:
        """Write [Qx, Qy, Mz] of every row."""

    def forces_and_jacobian(self, x: FloatArray, forces: FloatArray, jacobian: FloatArray, /) -> None:
        """Write the forces and ∂Q/∂x of every row."""


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
    """

    def __init__(self, vehicle: TrackedVehicle, mode: Mode, kernel: Kernel, *, domain: str = "") -> None:
        super().__init__(vehicle, mode)
        self._kernel = kernel
        self._domain = domain

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
