"""Rows that fill slip space: what the block answers where neither trajectories nor their neighbourhood go.

The shear under a track hangs on its slip velocity along, across and turning, each times L/(K √(Vt² + V_ε²)). Drives
crowd where these are near 0.1 to 100, and hardly any stops and stays at rest. Here they are drawn themselves, by
scrambled Sobol points. These rows belong to no run: they join training rows, and enter no dataset
and no test.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from ...terrain import (
    GRAVITY,
    MOTION_SIZE,
    NUMPY,
    ConfigurationError,
    FloatArray,
    ForceBackend,
    InvalidInputError,
    Mode,
    ParameterRanges,
    TrackedVehicle,
    missing_extra,
)
from ...terrain.block import shear_strength
from ..detector import SPEED_MARGIN

#: Limits of the magnitude of each slip coordinate, u = slip · L/(K √(Vt² + V_ε²)).
SMALLEST_SLIP: Final = 1e-3
LARGEST_SLIP: Final = 1e3
#: Share of rows that brake or have just stopped: belts below V_ε, the body at 1e-6 to 1 m/s.
BRAKING_SHARE: Final = 0.10
#: Share of rows exactly at rest.
REST_SHARE: Final = 0.02
#: Largest body speed of a row that brakes, in m/s.
BRAKING_SPEED: Final = 1.0
#: Smallest speed that is not rest, in m/s.
SMALLEST_SPEED: Final = 1e-6
#: Bound of vy over the training speed; drives of the M113 on the wide ranges reach .55.
LATERAL_SHARE: Final = 0.6
# A belt speed is the training speed times the cube of a uniform draw: half of them lie below an eighth of it.
_BELT_POWER: Final = 3


def space_filling_rows(
    vehicle: TrackedVehicle, mode: Mode, ranges: ParameterRanges, count: int, teacher: ForceBackend, seed: int
) -> tuple[FloatArray, FloatArray]:
    """Return rows that fill slip space, with the teacher's forces for them.

    Terrain follows the law of :meth:`ParameterRanges.sample`; ax, ay are uniform in size and direction up to what the
    ground holds and the vehicle bears without lifting a track. Of one track, left or right, the belt speed is drawn,
    crowded near zero, then its slip along, across and turning, signed and log-uniform; the other track's belt follows
    from its own slip along. Then come the rows that brake, and those at rest.

    Belts stay within the training speed, vx within 1.1 times that, vy within 0.6 times that, and the yaw rate within
    that of belts at training speed that counter-rotate without slip: the magnitudes are log-uniform up to there.

    Parameters
    ----------
    vehicle : TrackedVehicle
        With V_ε above zero: a belt at rest has no force without it.
    mode : {"rigid", "soil"}
        Terrain mode.
    ranges : ParameterRanges
        Terrain of the rows.
    count : int
        Number of rows; :func:`counts` says how they are divided.
    teacher : ForceBackend
        Asked for the forces.
    seed : int
        Of the scramble; the same seed gives the same rows.

    Returns
    -------
    inputs : ndarray, shape (count, d)
    forces : ndarray, shape (count, 3)

    Raises
    ------
    InvalidInputError
        If the count or the seed is negative, or V_ε is zero.
    ConfigurationError
        If the teacher or the ranges are for another vehicle or mode, or torch is missing.
    """
    if count < 0 or seed < 0:
        raise InvalidInputError(f"count and seed must not be negative, got {count} and {seed}")
    if not vehicle.soft_speed > 0:
        raise InvalidInputError("space-filling rows hold belts at rest, for which soft_speed must be above 0")
    if teacher.vehicle != vehicle or teacher.mode != mode or ranges.mode != mode:
        raise ConfigurationError(
            f"asked for {vehicle.name} on {mode} ground, got a teacher for {teacher.vehicle.name} on {teacher.mode} "
            f"ground and {ranges.mode} ranges"
        )
    slipping, braking, resting = counts(count)
    size = len(ranges.low)
    inputs = np.concatenate(
        [
            _rows(vehicle, ranges, draw, motion(vehicle, draw[:, size + 2 :], ranges.at(draw[:, :size])[:, -1]))
            for draw, motion in (
                (_sobol(slipping, size + 8, (seed, 0)), _slipping),
                (_sobol(braking, size + 7, (seed, 1)), _braking),
                (_sobol(resting, size + 2, (seed, 2)), _resting),
            )
        ]
    )
    return inputs, teacher.forces(inputs) if count else np.empty((0, 3))


def counts(count: int) -> tuple[int, int, int]:
    """Return how many of the rows slip, brake, and rest; they come in this order."""
    braking, resting = round(BRAKING_SHARE * count), round(REST_SHARE * count)
    return count - braking - resting, braking, resting


def slip_coordinates(vehicle: TrackedVehicle, rows: FloatArray) -> FloatArray:
    """Return u along, across and turning of the left and the right track, shape (n, 2, 3), of interface rows (n, d)."""
    vx, vy, yaw_rate, k = rows[:, 0], rows[:, 1], rows[:, 2], rows[:, -1]
    sides = []
    for y, belt in ((vehicle.tread / 2, rows[:, 5]), (-vehicle.tread / 2, rows[:, 6])):
        slip = [vx - yaw_rate * y - belt, vy + yaw_rate * vehicle.contact_center, yaw_rate * vehicle.contact_length / 2]
        sides.append(np.stack(slip, axis=1) / _unit_slip(vehicle, belt, k)[:, None])
    return np.stack(sides, axis=1)


def _unit_slip(vehicle: TrackedVehicle, belt: FloatArray, k: FloatArray) -> FloatArray:
    """Return the slip velocity in m/s at which u is 1."""
    unit: FloatArray = k / vehicle.contact_length * np.sqrt(belt**2 + vehicle.soft_speed**2)
    return unit


def _rows(vehicle: TrackedVehicle, ranges: ParameterRanges, draw: FloatArray, motion: FloatArray) -> FloatArray:
    """Join terrain and accelerations from the first columns of a draw with vx, vy, yaw rate and both belts."""
    size = len(ranges.low)
    theta = ranges.at(draw[:, :size])
    elements = 2 * vehicle.road_wheels
    area = elements * vehicle.element_length * vehicle.track_width
    strength = shear_strength(NUMPY, vehicle, ranges.mode, list(theta.T), vehicle.weight / elements)
    held = strength * area / vehicle.mass
    # Where the centre of pressure reaches a track, or an end of the contact.
    height = max(vehicle.cg_height, 1e-9)
    reach = GRAVITY / height * np.array([vehicle.contact_length / 2 - abs(vehicle.cg_offset), vehicle.tread / 2])
    angle = 2 * np.pi * draw[:, size + 1]
    accelerations = (held * draw[:, size])[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rows = np.empty((len(draw), MOTION_SIZE + size))
    rows[:, :3], rows[:, 5:7] = motion[:, :3], motion[:, 3:]
    rows[:, 3:5] = np.clip(accelerations, -reach, reach)
    rows[:, MOTION_SIZE:] = theta
    return rows


def _slipping(vehicle: TrackedVehicle, draw: FloatArray, k: FloatArray) -> FloatArray:
    """Return vx, vy, yaw rate and both belts (n, 5) from draws (n, 6) of one track's slip and the other's."""
    side, place, along, across, turning, other = draw.T
    top, half = vehicle.training_speed, vehicle.contact_length / 2
    y = np.where(side < 0.5, 1.0, -1.0) * vehicle.tread / 2
    belt = top * (2 * place - 1) ** _BELT_POWER
    unit = _unit_slip(vehicle, belt, k)

    fastest_turn = np.full(len(draw), half * top / (vehicle.tread / 2))
    yaw_rate = _slip(turning, -fastest_turn, fastest_turn, unit) / half
    offset = yaw_rate * vehicle.contact_center
    vy = _slip(across, offset - LATERAL_SHARE * top, offset + LATERAL_SHARE * top, unit) - offset
    rolling = belt + yaw_rate * y
    vx = rolling + _slip(along, -SPEED_MARGIN * top - rolling, SPEED_MARGIN * top - rolling, unit)
    # The other belt's own speed is not known yet; the ground speed under it is as good for the size of the slip.
    under = vx + yaw_rate * y
    other_belt = under - _slip(other, under - top, under + top, _unit_slip(vehicle, under, k))
    left, right = np.where(y > 0, belt, other_belt), np.where(y > 0, other_belt, belt)
    # Rounding of sums and differences is no excursion.
    bound = top * np.array([SPEED_MARGIN, LATERAL_SHARE, 2 / vehicle.tread, 1.0, 1.0])
    clipped: FloatArray = np.clip(np.stack([vx, vy, yaw_rate, left, right], axis=1), -bound, bound)
    return clipped


def _braking(vehicle: TrackedVehicle, draw: FloatArray, k: FloatArray) -> FloatArray:
    """Return vx, vy, yaw rate and both belts (n, 5): any direction of motion, belts slower than V_ε."""
    fastest = min(BRAKING_SPEED, LATERAL_SHARE * vehicle.training_speed)
    speed = SMALLEST_SPEED * (fastest / SMALLEST_SPEED) ** draw[:, 0]
    # Uniform on the sphere of (vx, vy, ω L/2).
    sine, angle = 2 * draw[:, 1] - 1, 2 * np.pi * draw[:, 2]
    cosine = np.sqrt(1 - sine**2)
    body = speed[:, None] * np.stack([cosine * np.cos(angle), cosine * np.sin(angle), sine], axis=1)
    body[:, 2] = np.clip(body[:, 2] / (vehicle.contact_length / 2), *(2 / vehicle.tread * np.array([-1, 1]) * fastest))
    slow = np.full(len(draw), min(vehicle.soft_speed, vehicle.training_speed))
    least = np.full(len(draw), SMALLEST_SPEED)
    belts = [_signed_log_uniform(column, -slow, slow, least) for column in draw[:, 3:5].T]
    return np.column_stack([body, *belts])


def _resting(vehicle: TrackedVehicle, draw: FloatArray, k: FloatArray) -> FloatArray:
    return np.zeros((len(draw), 5))


def _slip(draw: FloatArray, low: FloatArray, high: FloatArray, unit: FloatArray) -> FloatArray:
    """Return slip velocities of log-uniform u, inside [low, high] where the envelope is narrower than slip space."""
    widest = LARGEST_SLIP * unit
    # Where belt and yaw rate alone leave the envelope, the slip must bring the body back, whatever its u.
    low, high = (
        np.where(high > -widest, np.maximum(low, -widest), low),
        np.where(low < widest, np.minimum(high, widest), high),
    )
    return _signed_log_uniform(draw, low, high, SMALLEST_SLIP * unit)


def _signed_log_uniform(draw: FloatArray, low: FloatArray, high: FloatArray, smallest: FloatArray) -> FloatArray:
    """Return values in [low, high] whose magnitude is log-uniform from ``smallest``, or from the bound nearer to 0.

    A draw in [0, 1) below a half is negative. Where one side of zero is out of reach, the other is taken.
    """
    signed = 2 * draw - 1
    negative = np.where(signed < 0, low < -smallest, high <= smallest)
    farthest = np.where(negative, -low, high)
    nearest = np.maximum(np.where(negative, -high, low), smallest)
    farthest = np.maximum(farthest, nearest)
    magnitude = nearest * (farthest / nearest) ** np.abs(signed)
    return np.where(negative, -magnitude, magnitude)


def _sobol(count: int, dimension: int, seed: tuple[int, int]) -> FloatArray:
    """Return scrambled Sobol points (count, dimension) in [0, 1)."""
    try:
        import torch
    except ImportError as error:
        raise missing_extra("torch", "torch") from error
    if not count:
        return np.empty((0, dimension))
    scramble = int(np.random.SeedSequence(seed).generate_state(1)[0])
    quasirandom: Any = torch.quasirandom
    engine = quasirandom.SobolEngine(dimension, scramble=True, seed=scramble)
    points: FloatArray = engine.draw(count, dtype=torch.float64).numpy()
    return points
