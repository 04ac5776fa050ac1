"""The branch of steady turns that begins at the straight run, followed to a curvature or to its end."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from .backend import ForceBackend
from .errors import InvalidInputError
from .interface import FloatArray
from .parameters import Terrain
from .steady_balance import newton, solution_tolerance, turn_balance, turn_row

# A step changes the curvature and the lateral acceleration by at most this much, in 1/m and m/s².
_CURVATURE_STEP: Final = 0.1
_ACCELERATION_STEP: Final = 1.0
#: The search for the tightest turn also keeps to this share of the curvature, so as to see where belts run too fast in
#: the middle of the branch.
SEARCH_SHARE: Final = 0.08
_SEARCH_STEP: Final = 0.005
# Below this share of the curvature that has been reached the branch is at its end.
_SMALLEST_STEP: Final = 1e-4
# In V_ε: an inner belt slower than the first may be about to stop; beyond its stop it is looked for at the others.
_SLOW: Final = 10.0
_REVERSED: Final = (5.0, 2.0, 10.0, 20.0)


def follow_turns(
    backend: ForceBackend,
    terrain: Terrain,
    speed: float,
    wanted: float,
    allowed: Callable[[FloatArray], bool],
    share: float = math.inf,
) -> FloatArray:
    """Return the interface row of the last allowed steady turn between the straight run and the wanted curvature.

    Where the inner belt comes to rest its rolling resistance changes sign, which on soft ground folds the branch back.
    The turns beyond the fold, with that belt reversed, are jumped to.

    Parameters
    ----------
    backend : ForceBackend
        Who answers for the ground.
    terrain : Terrain
        The ground, of the backend's mode.
    speed : float
        Of the CG along its path, in m/s, positive.
    wanted : float
        Curvature in 1/m, positive to the left; 0 for the straight run.
    allowed : callable
        Tells of a row whether the turn counts.
    share : float
        Largest step in shares of the curvature that has been reached.

    Raises
    ------
    InvalidInputError
        If even the straight run has no steady state, or is not allowed.
    """
    tolerance = solution_tolerance(backend)

    def balanced(curvature: float, start: FloatArray) -> FloatArray | None:
        return newton(lambda z: turn_balance(backend, terrain, speed, curvature, z), start, tolerance)

    def solve(curvature: float, start: FloatArray) -> FloatArray | None:
        found = balanced(curvature, start)
        # Beyond a quarter turn of side slip the vehicle spins: another branch, not this turn.
        if found is None or abs(found[2]) >= math.pi / 2:
            return None
        return found if allowed(turn_row(terrain, speed, curvature, found)) else None

    now = balanced(0.0, np.array([speed, speed, 0.0]))
    if now is None:
        raise InvalidInputError(f"no steady run at {speed:g} m/s: this ground resists more than it holds")
    if not allowed(turn_row(terrain, speed, 0.0, now)):
        raise InvalidInputError(f"no steady run at {speed:g} m/s: it takes belts at {now[0]:.4g} m/s on this ground")

    largest = min(_CURVATURE_STEP, _ACCELERATION_STEP / speed**2)
    curvature, step = 0.0, min(largest, abs(wanted), _SEARCH_STEP if share < math.inf else math.inf)
    # Tightening the turn at first takes the belts apart by ωB.
    slope = math.copysign(speed, wanted) * np.array([-backend.vehicle.tread / 2, backend.vehicle.tread / 2, 0.0])
    while curvature < abs(wanted):
        following = min(curvature + step, abs(wanted))
        width = following - curvature
        signed = math.copysign(following, wanted)
        found = solve(signed, now + width * slope)
        if found is not None:
            slope = (found - now) / width
            step = min(1.6 * step, largest, max(share * following, _SEARCH_STEP))
        else:
            step = width / 2
            if step >= _SMALLEST_STEP * max(curvature, 1e-4):
                continue
            found = _beyond_rest(solve, signed, now, backend.vehicle.soft_speed)
            if found is None:
                break
        now, curvature = found, following
    return turn_row(terrain, speed, math.copysign(curvature, wanted), now)


def _beyond_rest(
    solve: Callable[[float, FloatArray], FloatArray | None], curvature: float, near: FloatArray, soft_speed: float
) -> FloatArray | None:
    """Return the turn near z = (v_left, v_right, β) whose inner belt runs backward; None if it is far from that."""
    inner = 0 if curvature > 0 else 1
    if not 0 < near[inner] < _SLOW * soft_speed:
        return None
    for multiple in _REVERSED:
        start = near.copy()
        start[inner] = -multiple * soft_speed
        found = solve(curvature, start)
        if found is not None and found[inner] < 0:
            return found
    return None
