"""The balance of a steady motion as an equation of three unknowns, and Newton's method for it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from .backend import ForceBackend
from .interface import FloatArray
from .parameters import Terrain

_TOLERANCE: Final = 1e-11
_NEWTON_STEPS: Final = 30
_HALVINGS: Final = 12

#: A balance of three unknowns: its residual over the weight, and the residual's Jacobian.
Balance = Callable[[FloatArray], tuple[FloatArray, FloatArray]]


def motion_row(terrain: Terrain, vx: float, vy: float, yaw_rate: float, left: float, right: float) -> FloatArray:
    """Return the interface array of a motion that goes on: its accelerations are the centripetal ones."""
    motion = [vx, vy, yaw_rate, -yaw_rate * vy, yaw_rate * vx, left, right]
    return np.concatenate([motion, terrain.parameters])


def turn_row(terrain: Terrain, speed: float, curvature: float, z: FloatArray) -> FloatArray:
    """Return the interface array of a turn at z = (v_left, v_right, β)."""
    vx, vy = speed * math.cos(z[2]), speed * math.sin(z[2])
    return motion_row(terrain, vx, vy, speed * curvature, z[0], z[1])


def turn_balance(
    backend: ForceBackend, terrain: Terrain, speed: float, curvature: float, z: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return residual and Jacobian over z = (v_left, v_right, β)."""
    row = turn_row(terrain, speed, curvature, z)
    forces, slopes = backend.forces_and_jacobian(row)
    vx, vy, yaw_rate = row[:3]
    turned = np.zeros(row.size)
    turned[:5] = -vy, vx, 0.0, -yaw_rate * vx, -yaw_rate * vy
    jacobian = np.column_stack([slopes[:, 5], slopes[:, 6], slopes @ turned])
    mass = backend.vehicle.mass
    jacobian[:2, 2] -= mass * turned[3:5]
    return _over_weight(backend, forces - mass * np.array([row[3], row[4], 0.0]), jacobian)


def belt_balance(
    backend: ForceBackend, terrain: Terrain, belts: FloatArray, z: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return residual and Jacobian over z = (Vx, Vy, ω)."""
    vx, vy, yaw_rate = z
    row = motion_row(terrain, vx, vy, yaw_rate, belts[0], belts[1])
    forces, slopes = backend.forces_and_jacobian(row)
    accelerated = np.array([[0.0, -yaw_rate, -vy], [yaw_rate, 0.0, vx]])
    mass = backend.vehicle.mass
    jacobian = slopes[:, :3] + slopes[:, 3:5] @ accelerated
    jacobian[:2] -= mass * accelerated
    return _over_weight(backend, forces - mass * np.array([row[3], row[4], 0.0]), jacobian)


def _over_weight(backend: ForceBackend, residual: FloatArray, jacobian: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Divide forces by W and the moment by W L/2."""
    vehicle = backend.vehicle
    scale = vehicle.weight * np.array([1.0, 1.0, vehicle.contact_length / 2])
    return residual / scale, jacobian / scale[:, None]


def newton(balance: Balance, start: FloatArray, tolerance: float) -> FloatArray | None:
    """Solve a balance by damped Newton; None where it does not converge."""
    z = start
    residual, jacobian = balance(z)
    size = float(np.abs(residual).max())
    for _ in range(_NEWTON_STEPS):
        if size <= tolerance:
            return z
        try:
            step = np.linalg.solve(jacobian, -residual)
        except np.linalg.LinAlgError:
            return None
        if not np.isfinite(step).all():
            return None
        for halving in range(_HALVINGS):
            shorter = z + step / 2**halving
            residual, jacobian = balance(shorter)
            if np.abs(residual).max() < size:
                break
        else:
            return None
        z, size = shorter, float(np.abs(residual).max())
    return z if size <= tolerance else None


def solution_tolerance(backend: ForceBackend) -> float:
    """Return the residual over the weight at which a balance counts as solved."""
    return max(_TOLERANCE, 8 * backend.resolution)
