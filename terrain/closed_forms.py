"""Results of the track-terrain block that can be written down: thrust, turning moments, steady skid turn.

Sources: Janosi & Hanamoto (1961), shear stress against shear displacement; Wong, Theory of Ground Vehicles; Wong &
Chiang (2001), a general theory for skid steering of tracked vehicles on firm ground; Merritt (1939) and Steeds (1950),
skid steering with friction that does not depend on slip.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from .errors import InvalidInputError
from .parameters import RigidTerrain, Terrain, require_in
from .vehicle import TrackedVehicle

# μ_max/(A + B R/tread), fitted to measured turning resistances.
_RESISTANCE_OFFSET: Final = 0.925
_RESISTANCE_SLOPE: Final = 0.15


def shear_capacity(vehicle: TrackedVehicle, terrain: Terrain) -> float:
    """Return the force in N that the ground under both tracks bears at most: μ W, or A c + W tan φ.

    A = 2 n ℓ b is the contact area; the vehicle stands level with its CG over the centre of the contact.
    """
    if isinstance(terrain, RigidTerrain):
        return terrain.mu * vehicle.weight
    area = 2 * vehicle.road_wheels * vehicle.element_length * vehicle.track_width
    return area * terrain.c + vehicle.weight * math.tan(terrain.phi)


def mobilized_share(length: float, slip: float, k: float, *, rolling: float = 1.0) -> float:
    """Return the share of the shear strength that a track mobilizes on a straight run.

    With s the rolling direction, the shear displacement i d grows over d from L (1 − |s|)/2 to L (1 + |s|)/2, so that
    the mean of 1 − e^(−i d/K) is 1 − (K/(i s L)) (e^(−i L (1−s)/2K) − e^(−i L (1+s)/2K)); for s = 1 that is
    1 − (K/(i L)) (1 − e^(−i L/K)).

    Parameters
    ----------
    length : float
        L in m.
    slip : float
        i = |V − Vt|/√(Vt² + V_ε²), not negative.
    k : float
        K in m.
    rolling : float
        s = Vt/√(Vt² + V_ε²), in [−1, 1]; 1 without V_ε.

    Raises
    ------
    InvalidInputError
        If an argument lies outside its interval.
    """
    require_in("length", length, 0.0, 1e3, low_open=True)
    require_in("slip", slip, 0.0, 1e12)
    require_in("k", k, 0.0, 1e3, low_open=True)
    require_in("rolling", rolling, -1.0, 1.0)
    middle, half = slip * length / (2 * k), slip * abs(rolling) * length / (2 * k)
    # e^(−middle) sinh(half)/half, with half ≤ middle: neither factor overflows, and half → 0 gives 1.
    swing = -math.expm1(-2 * half) / (2 * half) if half > 1e-12 else 1.0 - half
    return 1.0 - math.exp(half - middle) * swing


def straight_thrust(vehicle: TrackedVehicle, terrain: Terrain, vx: float, vt: float, soft_speed: float = 0.0) -> float:
    """Return the thrust in N of both tracks on a straight run, rolling resistance left out.

    F = (A c + W tan φ) [1 − (K/(iL)) (1 − e^(−iL/K))] with i = |V − Vt|/√(Vt² + V_ε²), generalized to V_ε > 0 as in
    :func:`mobilized_share`; uniform pressure, continuous contact; signed as Vt − V.

    Parameters
    ----------
    vehicle : TrackedVehicle
        The vehicle.
    terrain : Terrain
        The ground.
    vx, vt : float
        V and the speed of both belts in m/s.
    soft_speed : float
        V_ε in m/s.

    Raises
    ------
    InvalidInputError
        If the belts stand still at V_ε = 0.
    """
    speed = math.hypot(vt, soft_speed)
    if speed == 0.0:
        raise InvalidInputError("with soft_speed 0 the belts must run: the contact time of a stopped one is infinite")
    share = mobilized_share(vehicle.contact_length, abs(vx - vt) / speed, terrain.k, rolling=vt / speed)
    return math.copysign(shear_capacity(vehicle, terrain) * share, vt - vx)


def radius_integral(a: float, h: float) -> float:
    """Return G(a, h) in m³: the integral of the distance from the origin over the rectangle [0, a] × [0, h].

    G = a h √(a² + h²)/3 + (a³ asinh(h/a) + h³ asinh(a/h))/6.

    Raises
    ------
    InvalidInputError
        If a side is not positive.
    """
    require_in("a", a, 0.0, 1e6, low_open=True)
    require_in("h", h, 0.0, 1e6, low_open=True)
    return a * h * math.hypot(a, h) / 3 + (a**3 * math.asinh(h / a) + h**3 * math.asinh(a / h)) / 6


def matched_pivot_moment(vehicle: TrackedVehicle, mu: float) -> float:
    """Return the moment in N m that resists a pivot with belts Vt = ±ωB/2 for K → 0.

    Each track turns about its own centre: M = μ W G(L/2, b/2)/(L b/4); for b → 0 it is μ W L/4.
    """
    half_length, half_width = vehicle.contact_length / 2, vehicle.track_width / 2
    return mu * vehicle.weight * radius_integral(half_length, half_width) / (half_length * half_width)


def locked_tracks_moment(vehicle: TrackedVehicle, mu: float) -> float:
    """Return the moment in N m that resists turning about the CG with locked tracks for K → 0.

    M = μ W [G(L/2, (B + b)/2) − G(L/2, (B − b)/2)]/(L b/2).
    """
    half_length = vehicle.contact_length / 2
    outer, inner = (
        radius_integral(half_length, (vehicle.tread + sign * vehicle.track_width) / 2) for sign in (1.0, -1.0)
    )
    return mu * vehicle.weight * (outer - inner) / (half_length * vehicle.track_width)


def skid_turn_slip(length_to_tread: float) -> float:
    """Return λ = 2u/(ωL) of a steady skid turn of a line track without force or moment from outside, K → 0.

    u is the longitudinal sliding speed at the track's centre; λ solves
    (2B/L) λ asinh(1/λ) = √(1 + λ²) − λ² asinh(1/λ) (Steeds, Merritt), by bisection to the last bit.

    Parameters
    ----------
    length_to_tread : float
        L/B, in [0.1, 10].

    Raises
    ------
    InvalidInputError
        If L/B lies outside.

    Examples
    --------
    >>> round(skid_turn_slip(1.5), 5)
    0.35917
    """
    require_in("length_to_tread", length_to_tread, 0.1, 10.0)

    def excess(slip: float) -> float:
        drive, turn = slip * math.asinh(1 / slip), math.sqrt(1 + slip**2) - slip**2 * math.asinh(1 / slip)
        return 2 / length_to_tread * drive - turn

    low, high = 1e-6, 1e3
    while True:
        middle = (low + high) / 2
        if not low < middle < high:
            return middle
        low, high = (middle, high) if excess(middle) < 0 else (low, middle)


def turning_resistance(mu_max: float, radius: float, tread: float) -> float:
    """Return the empirical coefficient of turning resistance μ_t = μ_max/(0.925 + 0.15 R/B).

    μ_t = 4 M_r/(W L), M_r the moment of the lateral forces in a slow turn of radius R; μ_max is its value at R = B/2
    (Wong, Theory of Ground Vehicles).

    Raises
    ------
    InvalidInputError
        If a value is not positive.
    """
    for name, value in (("mu_max", mu_max), ("radius", radius), ("tread", tread)):
        require_in(name, value, 0.0, float(np.finfo(np.float64).max), low_open=True)
    return mu_max / (_RESISTANCE_OFFSET + _RESISTANCE_SLOPE * radius / tread)
