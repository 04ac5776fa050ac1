"""Gravity on a slope: what pulls the vehicle, and what the block returns under less than the whole weight."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Final, NamedTuple

import numpy as np

from .interface import FloatArray, Interface
from .vehicle import GRAVITY

#: Forces (3,) and Jacobian (3, d) of one interface row.
ForceFunction = Callable[[FloatArray], tuple[FloatArray, FloatArray]]


class Gravity(NamedTuple):
    """Gravity in body axes in m/s²: along x and y, and what presses the vehicle on the ground (positive)."""

    x: float
    y: float
    z: float

    @property
    def load_ratio(self) -> float:
        """Share r = g_z/g of the weight that presses on the ground."""
        return self.z / GRAVITY


LEVEL: Final = Gravity(0.0, 0.0, GRAVITY)


def body_gravity(gradient: tuple[float, float], heading: float) -> Gravity:
    """Return gravity in the axes of a body that stands on a slope.

    (g_x, g_y) = −g R(−ψ) ∇z/√(1 + |∇z|²), g_z = g/√(1 + |∇z|²). On a plane with one slope γ these are −g sin γ uphill
    and g cos γ.

    Parameters
    ----------
    gradient : tuple of float
        ∇z = (∂z/∂x, ∂z/∂y).
    heading : float
        ψ in rad.
    """
    p, q = gradient
    if p == 0.0 and q == 0.0:
        return LEVEL
    normal = GRAVITY / math.sqrt(1.0 + p * p + q * q)
    cosine, sine = math.cos(heading), math.sin(heading)
    return Gravity(-normal * (cosine * p + sine * q), -normal * (cosine * q - sine * p), normal)


def level_equivalent(interface: Interface, row: FloatArray, load_ratio: float | FloatArray) -> FloatArray:
    """Return the row on level ground whose forces, times r, are those of ``row`` under the load m g_z.

    Loads, pressures and friction are proportional to W = m g_z, and accelerations enter as h a/g_z; cohesion alone
    does not know the weight. So Q(x; g_z) = r·Q(x′; g) with ax′ = ax/r, ay′ = ay/r and, on soil, c′ = c/r. The rule is
    exact for the block, and it lets a surrogate that was trained on level ground answer on a slope.

    Parameters
    ----------
    interface : Interface
        Of the row.
    row : ndarray, shape (d,) or (n, d)
        Interface array.
    load_ratio : float, or ndarray of shape (n,)
        r = g_z/g, for all rows or each.

    Returns
    -------
    ndarray, of the same shape; ``row`` itself where r = 1
    """
    if isinstance(load_ratio, float) and load_ratio == 1.0:
        return row
    scaled = row.copy()
    scaled[..., _scaled_columns(interface)] /= np.asarray(load_ratio)[..., None]
    return scaled


def on_slope(interface: Interface, forces: ForceFunction, load_ratio: float) -> ForceFunction:
    """Return the force function under the load m g_z, by the rule of :func:`level_equivalent`."""
    if load_ratio == 1.0:
        return forces
    gain = np.full(interface.size, load_ratio)
    gain[_scaled_columns(interface)] = 1.0

    def evaluate(row: FloatArray) -> tuple[FloatArray, FloatArray]:
        level, jacobian = forces(level_equivalent(interface, row, load_ratio))
        return load_ratio * level, jacobian * gain

    return evaluate


@cache
def _scaled_columns(interface: Interface) -> list[int]:
    return [interface.index(name) for name in ("ax", "ay", "c") if name in interface.names]
