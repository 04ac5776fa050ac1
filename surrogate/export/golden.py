"""Golden vectors: rows, and what the NumPy oracles say of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...terrain import (
    FloatArray,
    ForceBackend,
    GuardedBackend,
    GuardMode,
    GuardState,
    PhysicsBackend,
    SwitchingPolicy,
    reference_forces,
)
from ..artifact import Surrogate

#: Rows that are checked, and the first of them whose Jacobians are, too.
ROWS: Final = 24
JACOBIAN_ROWS: Final = 4
#: Share of an output's spread by which a float32 network, and float64 physics, may be off.
SURROGATE_TOLERANCE: Final = 1e-5
PHYSICS_TOLERANCE: Final = 1e-9
#: Share of a Jacobian's largest entry in a row; the expected ones are central differences of the oracles.
JACOBIAN_TOLERANCE: Final = 1e-3
SCORE_TOLERANCE: Final = 1e-9
#: Between the rows of the guard's drive, in s: long enough to come back within a few rows.
ELAPSED: Final = 0.1
_SEED: Final = 20


@dataclass(frozen=True, eq=False)
class GoldenRows:
    """Rows and expected answers.

    Parameters
    ----------
    x : ndarray, shape (n, d)
        A vehicle at rest, rolling rows with slip, then rows from all over the detector's box and beyond it.
    surrogate, physics : ndarray, shape (n, 3)
        Expected forces in N and N m.
    surrogate_scale, physics_scale : ndarray, shape (3,)
        Their spread over the rows.
    surrogate_jacobian, physics_jacobian : ndarray, shape (m, 3, d)
        Expected derivatives of the first m rows after the one at rest.
    score : ndarray, shape (n,)
        Of the detector.
    """

    x: FloatArray
    surrogate: FloatArray
    physics: FloatArray
    surrogate_scale: FloatArray
    physics_scale: FloatArray
    surrogate_jacobian: FloatArray
    physics_jacobian: FloatArray
    score: FloatArray


def golden_rows(surrogate: Surrogate, fallback: PhysicsBackend) -> GoldenRows:
    """Return the golden vectors of a surrogate and its fallback."""
    x = _rows(surrogate, running=fallback.soft_speed == 0)
    network, block = _SurrogateOracle(surrogate), _PhysicsOracle(fallback)
    sloped = x[1 : 1 + JACOBIAN_ROWS]
    surrogate_forces, physics_forces = network.forces(x), block.forces(x)
    return GoldenRows(
        x=x,
        surrogate=surrogate_forces,
        physics=physics_forces,
        surrogate_scale=surrogate_forces.std(axis=0),
        physics_scale=physics_forces.std(axis=0),
        surrogate_jacobian=network.forces_and_jacobian(sloped)[1],
        physics_jacobian=block.forces_and_jacobian(sloped)[1],
        score=surrogate.detector.score(x),
    )


@dataclass(frozen=True, eq=False)
class GoldenDrive:
    """What a fresh guard does along a sequence of golden rows.

    Parameters
    ----------
    index : ndarray of int, shape (m,)
        Into the golden rows: from the calmest to one beyond the box, back, to the farthest inside it, and back.
    fallback : ndarray of int, shape (m,)
        1 on the fallback, else 0.
    weight : ndarray, shape (m,)
        Of the fallback in the blend.
    forces : ndarray, shape (m, 3)
        Blended, in N and N m.
    """

    index: NDArray[np.int64]
    fallback: NDArray[np.int64]
    weight: FloatArray
    forces: FloatArray


def golden_drive(
    surrogate: Surrogate, fallback: PhysicsBackend, policy: SwitchingPolicy, rows: GoldenRows
) -> GoldenDrive:
    """Return the drive of a guard over both oracles."""
    guarded = GuardedBackend(_SurrogateOracle(surrogate), _PhysicsOracle(fallback), surrogate.detector, policy)
    reasons = np.array([surrogate.detector.detect(row).reason for row in rows.x])
    calm, beyond = int(rows.score.argmin()), int(rows.score.argmax())
    farthest = int(np.where(reasons == "box", -1.0, rows.score).argmax())
    index = np.array([calm] * 2 + [beyond] + [calm] * 9 + [farthest] * 3 + [calm] * 9, dtype=np.int64)
    state, states, forces = GuardState(), [], []
    for row in rows.x[index]:
        state = policy.advance(state, surrogate.detector.detect(row), ELAPSED)
        states.append(state)
        forces.append(guarded.blended_forces_and_jacobian(row, state.fallback_weight)[0])
    return GoldenDrive(
        index=index,
        fallback=np.array([each.mode is GuardMode.FALLBACK for each in states], dtype=np.int64),
        weight=np.array([each.fallback_weight for each in states]),
        forces=np.array(forces),
    )


class _SurrogateOracle(ForceBackend):
    """The artifact in NumPy float64, with the base class's central differences."""

    def __init__(self, surrogate: Surrogate) -> None:
        super().__init__(surrogate.vehicle, surrogate.mode)
        self._surrogate = surrogate

    def forces(self, x: FloatArray) -> FloatArray:
        return self._surrogate.reference_forces(x)


class _PhysicsOracle(ForceBackend):
    """The block in NumPy float64, with the base class's central differences."""

    def __init__(self, fallback: PhysicsBackend) -> None:
        super().__init__(fallback.vehicle, fallback.mode)
        self._fallback = fallback

    def forces(self, x: FloatArray) -> FloatArray:
        fallback = self._fallback
        return reference_forces(self.vehicle, self.mode, x, grid=fallback.grid, soft_speed=fallback.soft_speed)


def _rolling_rows(surrogate: Surrogate, count: int, seed: int) -> FloatArray:
    """Return rows in which belts, speed and yaw rate belong together, terrain in the training ranges, shape (n, d)."""
    generator, vehicle = np.random.default_rng(seed), surrogate.vehicle
    top = vehicle.training_speed
    vx = generator.uniform(-0.6, 0.6, count) * top
    yaw_rate = generator.uniform(-0.2, 0.2, count) * top / vehicle.tread
    slip = generator.normal(0.0, 0.05 * top, (count, 2))
    half = yaw_rate * vehicle.tread / 2
    motion = np.column_stack(
        [
            vx,
            generator.normal(0.0, 0.02 * top, count),
            yaw_rate,
            generator.normal(0.0, 1.0, count),
            generator.normal(0.0, 1.0, count),
            vx - half + slip[:, 0],
            vx + half + slip[:, 1],
        ]
    )
    low, high = np.array(surrogate.ranges.low), np.array(surrogate.ranges.high)
    return np.column_stack([motion, generator.uniform(low, high, (count, len(low)))])


def _rows(surrogate: Surrogate, *, running: bool) -> FloatArray:
    detector = surrogate.detector
    rolling = _rolling_rows(surrogate, ROWS // 2, _SEED)
    generator = np.random.default_rng(_SEED + 1)
    spread = generator.uniform(detector.low, detector.high, (ROWS - 1 - len(rolling), len(detector.low)))
    # The last ones leave the box: faster than in training.
    spread[-3:, :7] *= 2.0
    rest = spread[:1].copy()
    rest[:, :7] = 0.0
    # A block that asks for running belts has no force at rest.
    if running:
        rest[:, [0, 5, 6]] = 1.0
    rows: FloatArray = np.concatenate([rest, rolling, spread])
    return rows
