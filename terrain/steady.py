"""Steady motion: the turn in which ground and vehicle are in balance, and the turn that given belt speeds lead to."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from .backend import ForceBackend
from .errors import InvalidInputError
from .interface import FloatArray
from .parameters import Terrain, require_in
from .steady_balance import belt_balance, motion_row, newton, solution_tolerance
from .steady_branch import SEARCH_SHARE, follow_turns

# Below this share of the whole way from no turn a continuation is at its end.
_SMALLEST_STEP: Final = 1e-4


@dataclass(frozen=True, eq=False)
class SteadyMotion:
    """A motion that goes on as it is: forces are mass times the centripetal acceleration, and no moment is left.

    Parameters
    ----------
    row : ndarray, shape (d,)
        Interface array: velocities, centripetal accelerations ax = −ω Vy and ay = ω Vx, belt speeds, θ.
    forces : ndarray, shape (3,)
        [Qx, Qy, Mz] in N, N, N m.
    tread : float
        B in m.
    """

    row: FloatArray
    forces: FloatArray
    tread: float

    @property
    def vx(self) -> float:
        """Forward velocity in m/s."""
        return float(self.row[0])

    @property
    def vy(self) -> float:
        """Leftward velocity in m/s."""
        return float(self.row[1])

    @property
    def yaw_rate(self) -> float:
        """ω in rad/s."""
        return float(self.row[2])

    @property
    def v_left(self) -> float:
        """Left belt speed in m/s."""
        return float(self.row[5])

    @property
    def v_right(self) -> float:
        """Right belt speed in m/s."""
        return float(self.row[6])

    @property
    def speed(self) -> float:
        """√(Vx² + Vy²) in m/s."""
        return math.hypot(self.vx, self.vy)

    @property
    def side_slip(self) -> float:
        """β = atan2(Vy, Vx) in rad."""
        return math.atan2(self.vy, self.vx)

    @property
    def curvature(self) -> float:
        """ω/√(Vx² + Vy²) in 1/m, positive to the left; infinite for a pivot, 0 at rest."""
        if self.speed == 0:
            return math.copysign(math.inf, self.yaw_rate) if self.yaw_rate else 0.0
        return self.yaw_rate / self.speed

    @property
    def radius(self) -> float:
        """R in m of the path of the CG, positive to the left, infinite on a straight run."""
        return 1 / self.curvature if self.curvature else math.inf

    @property
    def sliding(self) -> tuple[float, float]:
        """Longitudinal sliding speed of both belts at their centrelines in m/s: Vt − (Vx ∓ ω B/2)."""
        turn = self.yaw_rate * self.tread / 2
        return self.v_left - (self.vx - turn), self.v_right - (self.vx + turn)


def steady_turn(backend: ForceBackend, terrain: Terrain, speed: float, radius: float) -> SteadyMotion:
    """Return the steady turn of given speed and radius.

    Newton's method on belt speeds and side slip angle: Qx = −m ω Vy, Qy = m ω Vx, Mz = 0, with these accelerations
    as the block's memory, so that the load transfer is the turn's own. The turn is approached from the straight run.
    Forces of the exact path jump where a cell passes through zero sliding: a turn whose balance falls into such a
    jump is refused, while neighbouring ones are found.

    Parameters
    ----------
    backend : ForceBackend
        Who answers for the ground.
    terrain : Terrain
        The ground, of the backend's mode.
    speed : float
        Of the CG along its path, in m/s, positive.
    radius : float
        Of the path of the CG in m, positive to the left; infinite for a straight run.

    Raises
    ------
    InvalidInputError
        If a value is impossible, the ground has another mode, or there is no such steady turn.

    Examples
    --------
    >>> from grouser.terrain import make_backend, named
    >>> ground = named("asphalt")
    >>> turn = steady_turn(make_backend("physics", mode="rigid"), ground, speed=3.0, radius=20.0)
    >>> round(turn.v_right - turn.v_left, 2)
    0.43
    """
    if not (isinstance(radius, int | float | np.number) and abs(radius) > 0):
        raise InvalidInputError(f"radius must be a number other than 0, infinite for a straight run, got {radius!r}")
    wanted = 1 / float(radius)
    _check_turn(backend, terrain, speed)
    reached = _motion(backend, follow_turns(backend, terrain, speed, wanted, lambda row: True))
    if reached.curvature != wanted and abs(reached.curvature - wanted) > 1e-9 * abs(wanted):
        raise InvalidInputError(
            f"no steady turn of {radius:g} m radius at {speed:g} m/s on this ground: "
            f"the tightest that was found is {abs(reached.radius):.4g} m"
        )
    return reached


def tightest_turn(
    backend: ForceBackend,
    terrain: Terrain,
    speed: float,
    *,
    minimum_radius: float = 1.0,
    inner_belt_reverses: bool = True,
) -> SteadyMotion:
    """Return the tightest steady left turn of given speed that ground and drive allow, to a ten-thousandth.

    The turn is tightened from the straight run, also over the rest of the inner belt, until there is no steady turn, a
    belt would run faster than the vehicle's maximum speed, or the inner belt would run backward. Steady does not mean
    stable: a driver may have to hold the vehicle in this turn.

    Parameters
    ----------
    backend : ForceBackend
        Who answers for the ground.
    terrain : Terrain
        The ground, of the backend's mode.
    speed : float
        Of the CG along its path, in m/s, positive.
    minimum_radius : float
        Radius in m at which to stop.
    inner_belt_reverses : bool
        Whether the inner belt may run backward.

    Raises
    ------
    InvalidInputError
        If a value is impossible, the ground has another mode, or even a straight run has no steady state.
    """
    require_in("minimum_radius", minimum_radius, 0.0, 1e6, low_open=True)
    _check_turn(backend, terrain, speed)
    top = backend.vehicle.maximum_speed

    def drivable(row: FloatArray) -> bool:
        belts = row[5:7]
        return bool(np.abs(belts).max() <= top and (inner_belt_reverses or belts.min() >= 0))

    return _motion(backend, follow_turns(backend, terrain, speed, 1 / minimum_radius, drivable, share=SEARCH_SHARE))


def steady_motion(backend: ForceBackend, terrain: Terrain, v_left: float, v_right: float) -> SteadyMotion:
    """Return the steady motion that given belt speeds lead to.

    Newton's method on (Vx, Vy, ω) with the centripetal accelerations as the block's memory, from rolling without
    slip; where that fails, from both belts at their mean speed. Steady does not mean stable.

    Parameters
    ----------
    backend : ForceBackend
        Who answers for the ground.
    terrain : Terrain
        The ground, of the backend's mode.
    v_left, v_right : float
        Belt speeds in m/s.

    Raises
    ------
    InvalidInputError
        If a value is impossible, the ground has another mode, or there is no steady motion.
    """
    _check_mode(backend, terrain)
    require_in("v_left", v_left, -100.0, 100.0)
    require_in("v_right", v_right, -100.0, 100.0)
    mean, half = (v_left + v_right) / 2, (v_right - v_left) / 2
    tread = backend.vehicle.tread

    def solve(share: float, start: FloatArray) -> FloatArray | None:
        belts = np.array([mean - share * half, mean + share * half])
        if not belts.all() and getattr(backend, "soft_speed", 1.0) == 0:
            return None
        return newton(lambda z: belt_balance(backend, terrain, belts, z), start, solution_tolerance(backend))

    done, step, solution = 0.0, 1.0, np.array([mean, 0.0, 0.0])
    while done < 1.0:
        share = min(1.0, done + step)
        guess = solution + np.array([0.0, 0.0, (share - done) * 2 * half / tread])
        found = solve(share, guess)
        if found is None:
            step /= 2
            if step < _SMALLEST_STEP:
                raise InvalidInputError(
                    f"no steady motion with belts at {v_left:g} and {v_right:g} m/s on this ground: "
                    f"it follows up to {mean - done * half:.4g} and {mean + done * half:.4g}"
                )
            continue
        done, solution = share, found
    row = motion_row(terrain, solution[0], solution[1], solution[2], v_left, v_right)
    return _motion(backend, row)


def _motion(backend: ForceBackend, row: FloatArray) -> SteadyMotion:
    return SteadyMotion(row, backend.forces(row), backend.vehicle.tread)


def _check_turn(backend: ForceBackend, terrain: Terrain, speed: float) -> None:
    _check_mode(backend, terrain)
    require_in("speed", speed, 0.0, 100.0, low_open=True)


def _check_mode(backend: ForceBackend, terrain: Terrain) -> None:
    if terrain.mode != backend.mode:
        raise InvalidInputError(f"the backend is for {backend.mode} ground, the ground is {terrain.mode}")
