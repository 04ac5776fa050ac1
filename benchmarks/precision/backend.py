"""A surrogate in another format as a force backend: compiled where its weights alone are rounded."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar, Final

from grouser.surrogate import NUMPY_NETWORK, NativeSurrogate, Surrogate
from grouser.terrain import FloatArray, ForceBackend

from .formats import Format, Number

#: What rounded activations resolve: half a step, over the largest one.
RESOLUTIONS: Final[dict[Number, float]] = {"bfloat16": 2.0**-9, "int8": 2.0**-8}


def rounded(surrogate: Surrogate, kind: Format) -> Surrogate:
    """Return the surrogate with rounded weights."""
    return replace(surrogate, network=kind.network(surrogate.network))


def backend(surrogate: Surrogate, kind: Format, *, resolution: float | None = None) -> ForceBackend:
    """Return the surrogate in a format, as something to drive on.

    Parameters
    ----------
    surrogate : Surrogate
        In float32.
    kind : Format
        That it is to be held in.
    resolution : float, optional
        Relative force resolution that ticks are to be solved to, where activations are rounded; that of float32 by
        default.
    """
    weights = NativeSurrogate(surrogate.vehicle, surrogate.mode, rounded(surrogate, kind))
    if kind.activations == "float32":
        return weights
    return RoundedActivations(surrogate, kind, weights, weights.resolution if resolution is None else resolution)


class RoundedActivations(ForceBackend):
    """A surrogate whose activations are rounded as well, in NumPy.

    Its force is a staircase, so that derivatives are those of the network without the stairs.

    Parameters
    ----------
    surrogate : Surrogate
        In float32.
    kind : Format
        That it is held in.
    slopes : NativeSurrogate
        With the same weights.
    resolution : float
        Relative force resolution that ticks are to be solved to.
    """

    name: ClassVar[str] = "rounded"

    def __init__(self, surrogate: Surrogate, kind: Format, slopes: NativeSurrogate, resolution: float) -> None:
        super().__init__(surrogate.vehicle, surrogate.mode)
        self.resolution = resolution
        self._surrogate, self._slopes = surrogate, slopes
        self._forward = kind.forward(surrogate.network)

    def forces(self, x: FloatArray) -> FloatArray:
        """Return [Qx, Qy, Mz], shape (3,) or (n, 3)."""
        forces: FloatArray = self._surrogate.evaluate(NUMPY_NETWORK, self._surrogate.check(x), self._forward)
        return forces

    def forces_and_jacobian(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the forces, and ∂Q/∂x of the network without rounded activations."""
        return self.forces(x), self._slopes.forces_and_jacobian(x)[1]
