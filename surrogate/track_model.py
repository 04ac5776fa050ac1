"""The structured surrogate: a network for the shear under one track, and the block's own equations for the rest.

The force of a track is Σ_i S_i g_i + rolling resistance. S_i = τ_max A of contact element i follows from load transfer
and strength, and is computed; g_i, the force and moment that the element returns at unit strength, depends on the
track's slip alone. That is four numbers: slip velocity along and across, yaw rate, each times L/(K √(Vt² + V_ε²)), and
the soft rolling direction. The right track is the mirror image of the left one, so that both share one network and
the vehicle's mirror symmetry holds to the bit. All quantities here are those of a track mirrored to the left side.

Four shear points along the track give the force to a few percent of the available shear; the network adds the rest
through a gate that closes with the slip, so that a vehicle at rest feels no force.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, Final, Literal

import numpy as np

from ..terrain import ConfigurationError, FloatArray, Mode, TrackedVehicle
from ..terrain.block import element_shares, rolling_direction, shear_factor, shear_strength, side_loads
from .network import NetworkNamespace

#: Shear points along each track.
POINTS: Final = 4
#: Features of a track: shear at the points along and across, slip size, rolling direction.
FEATURES: Final = 2 * POINTS + 2
# Far below any speed; keeps the derivatives of a length finite at zero.
_TINY_SQUARE: Final = 1e-300

Side = Literal["left", "right"]
SIDES: Final[tuple[Side, ...]] = ("left", "right")

#: Network outputs (…, 3n) for features (…, 10): along, across and moment, element by element each.
Correction = Callable[[Any], Any]


@dataclass(frozen=True, eq=False)
class TrackState:
    """What one track's force is made of, as columns of an array namespace.

    Parameters
    ----------
    features : array, shape (..., 10)
        Network inputs, bounded; zero at rest but for the last, the rolling direction.
    gate : array, shape (..., 1)
        1 − exp(−z̄), z̄ the shear at the middle of the track over K.
    quadrature : array, shape (..., 3n)
        Unit-strength forces of the elements from the shear points.
    strengths : array, shape (..., n)
        S_i in N.
    rolling : array, shape (..., 1)
        Rolling resistance in N.
    """

    features: Any
    gate: Any
    quadrature: Any
    strengths: Any
    rolling: Any


def track_state(xp: NetworkNamespace, vehicle: TrackedVehicle, mode: Mode, x: Any, side: Side) -> TrackState:
    """Return features, gate, quadrature, strengths and rolling resistance of one track.

    At shear point j, the middle of a part of length Δ of the track, the slip is a = Vx − ω B/2 − Vt along and
    b = Vy + ω x across, r its mean size between the ends of the part, the lateral spread ω²b²/12 of the track's width
    included. With d_j the distance travelled and t = 1/(K √(Vt² + V_ε²)), the shear is −(1 − e^(−r d_j t))(a, b)/r. Across the track
    −e^(−r d_j t) s ω Δ² t/12 joins it: without slip the shear grows like d·b, and both change along the part.

    Parameters
    ----------
    xp : NetworkNamespace
        NumPy, torch or CasADi.
    vehicle : TrackedVehicle
        The vehicle.
    mode : {"rigid", "soil"}
        Terrain mode.
    x : array (..., d), or CasADi column (d, 1)
        Interface array.
    side : {"left", "right"}
        Which track; the right one is mirrored.
    """
    array = xp.array
    columns = array.columns(x)
    sign = 1.0 if side == "left" else -1.0
    vx, ax, ay, terrain = columns[0], columns[3], columns[4], columns[7:]
    vt = columns[5 if side == "left" else 6]
    yaw_rate = sign * columns[2]
    across = sign * columns[1] + yaw_rate * vehicle.contact_center
    along = vx - yaw_rate * (vehicle.tread / 2) - vt
    belt_speed = array.sqrt(vt * vt + vehicle.soft_speed**2)
    direction = rolling_direction(array, vt, vehicle.soft_speed)
    per_meter = 1.0 / (belt_speed * terrain[-1])

    points = shear_points(vehicle)
    spread = along * along + (yaw_rate * vehicle.track_width) ** 2 / 12 + _TINY_SQUARE
    start, stop = (across + yaw_rate * array.constant(ends) for ends in (points.starts, points.stops))
    size = (array.sqrt(spread + start * start) + array.sqrt(spread + stop * stop)) / 2
    travelled = (points.half_travel - direction * array.constant(points.reach)) * per_meter
    z = size * travelled
    factor = shear_factor(array, z)
    gain = travelled * factor
    curving = (1.0 - z * factor) * (direction * yaw_rate * per_meter * (points.length**2 / 12))
    shear = array.join([-gain * along, curving - gain * (start + stop) / 2])

    turning = yaw_rate * (vehicle.contact_length / 2)
    size = array.sqrt(along * along + across * across + turning * turning + _TINY_SQUARE) - _TINY_SQUARE**0.5
    z = size * points.half_travel * per_meter
    features = array.join([shear, z / (z + 4.0), direction])

    load = side_loads(array, vehicle, ay)[0 if side == "left" else 1]
    shares = array.join(element_shares(array, vehicle, ax))
    area = vehicle.element_length * vehicle.track_width
    strengths = shear_strength(array, vehicle, mode, terrain, load * shares) * area
    quadrature = xp.affine(shear, points.weights, np.zeros(points.weights.shape[1]))
    return TrackState(features, z * shear_factor(array, z), quadrature, strengths, -terrain[-2] * load * direction)


def track_force(
    xp: NetworkNamespace, vehicle: TrackedVehicle, state: TrackState, correction: Any, side: Side
) -> list[Any]:
    """Return [Fx, Fy, M] of one track, M about the CG; ``correction`` are the network's outputs (…, 3n)."""
    array = xp.array
    unit = state.quadrature + state.gate * correction
    shear = array.join([state.strengths] * 3) * unit
    along, across, moment = (array.total(shear * array.constant(lever)) for lever in _levers(vehicle))
    fx = along + state.rolling
    moment = moment - vehicle.tread / 2 * fx
    return [fx, across, moment] if side == "left" else [fx, -across, -moment]


def _levers(vehicle: TrackedVehicle) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return what each unit adds to Fx, Fy, and M about the middle of the track at the CG, each of shape (3n,)."""
    count = vehicle.road_wheels
    ones, zeros = np.ones(count), np.zeros(count)
    half = np.full(count, vehicle.element_length / 2)
    return (
        np.concatenate([ones, zeros, zeros]),
        np.concatenate([zeros, ones, zeros]),
        np.concatenate([zeros, vehicle.element_centers, half]),
    )


def track_forces(
    xp: NetworkNamespace, vehicle: TrackedVehicle, mode: Mode, x: Any, side: Side, correction: Correction
) -> list[Any]:
    """Return [Fx, Fy, M] of one track for interface rows; see :func:`track_state`."""
    state = track_state(xp, vehicle, mode, x, side)
    return track_force(xp, vehicle, state, correction(state.features), side)


@dataclass(frozen=True, eq=False)
class ShearPoints:
    """The parts of a track and how their shear spreads over the contact elements.

    Parameters
    ----------
    starts, stops : ndarray, shape (4,)
        Rear and front end of each part in m from the contact centre, rearmost first.
    reach : ndarray, shape (4,)
        Middle of each part, from where the shear is counted from.
    half_travel : float
        Distance travelled there, in m.
    length : float
        Δ in m.
    mean, moment : ndarray, shape (4, n)
        From shear at the points to the elements' mean shear, and to its moment about the element's centre, over ℓ/2.
    """

    starts: FloatArray
    stops: FloatArray
    reach: FloatArray
    half_travel: float
    length: float
    mean: FloatArray
    moment: FloatArray

    @cached_property
    def weights(self) -> FloatArray:
        """From shear along and across at the points to the elements' along, across and moment, shape (8, 3n)."""
        count = self.mean.shape[1]
        weights = np.zeros((2 * POINTS, 3 * count))
        weights[:POINTS, :count] = self.mean
        weights[POINTS:, count : 2 * count] = self.mean
        weights[POINTS:, 2 * count :] = self.moment
        return weights


def shear_points(vehicle: TrackedVehicle) -> ShearPoints:
    """Return the shear points of a vehicle's tracks: spread over the track, or over the wheels of a per-wheel contact.

    Raises
    ------
    ConfigurationError
        If the shear starts afresh under more wheels than there are points, or a number that does not divide them.
    """
    count = vehicle.road_wheels
    if vehicle.contact == "continuous":
        return _continuous_points(vehicle.contact_length, vehicle.element_length, vehicle.element_spacing, count)
    if POINTS % count:
        raise ConfigurationError(
            f"a structured surrogate has {POINTS} shear points a track: per-wheel contact needs 1, 2 or 4 road wheels, "
            f"got {count}; train a plain one"
        )
    return _wheel_points(vehicle.element_length, vehicle.element_spacing, count)


@cache
def _continuous_points(contact_length: float, element_length: float, spacing: float, count: int) -> ShearPoints:
    ends = np.linspace(-0.5, 0.5, POINTS + 1, dtype=np.float64) * contact_length
    arms = (np.arange(count, dtype=np.float64) - (count - 1) / 2) * spacing
    mean, moment = _reconstruction(ends, arms, element_length)
    return ShearPoints(
        ends[:-1],
        ends[1:],
        (ends[1:] + ends[:-1]) / 2,
        contact_length / 2,
        contact_length / POINTS,
        mean.T.copy(),
        moment.T.copy(),
    )


@cache
def _wheel_points(element_length: float, spacing: float, count: int) -> ShearPoints:
    share = POINTS // count
    ends = np.linspace(-0.5, 0.5, share + 1, dtype=np.float64) * element_length
    arms = (np.arange(count, dtype=np.float64) - (count - 1) / 2) * spacing
    own_mean, own_moment = _reconstruction(ends, np.zeros(1, dtype=np.float64), element_length)
    starts, stops = ((arms[:, None] + end).ravel() for end in (ends[:-1], ends[1:]))
    mean, moment = (np.asarray(np.kron(np.eye(count), own), dtype=np.float64) for own in (own_mean, own_moment))
    reach = np.tile((ends[1:] + ends[:-1]) / 2, count)
    return ShearPoints(starts, stops, reach, element_length / 2, element_length / share, mean.T.copy(), moment.T.copy())


def _reconstruction(ends: FloatArray, arms: FloatArray, element_length: float) -> tuple[FloatArray, FloatArray]:
    """Return elements' mean, and moment over ℓ/2, of the polynomial with given means over the parts between ``ends``.

    Both of shape (elements, parts); the polynomial has as many coefficients as there are parts.
    """
    powers = np.arange(len(ends) - 1)
    integral = ends[:, None] ** (powers + 1) / (powers + 1)
    coefficients = np.linalg.inv((integral[1:] - integral[:-1]) / np.diff(ends)[:, None])
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    places = arms[:, None] + nodes * element_length / 2
    values = (places[..., None] ** powers) @ coefficients
    mean: FloatArray = np.einsum("q,iqj->ij", weights / 2, values)
    moment: FloatArray = np.einsum("q,iqj->ij", weights / 2 * nodes, values)
    return mean, moment
