"""One step of the body's equations of motion under a force function: implicit Euler, SDIRK2, explicit Euler.

m(V̇x − ωVy) = Qx + m g_x, m(V̇y + ωVx) = Qy + m g_y, I_z ω̇ = Mz, that is ẏ = f(y) for y = (Vx, Vy, ω). Near zero slip the forces are
as stiff as −2.6·10⁴ s⁻¹, and they saturate, so that neither explicit nor linearly implicit steps hold a vehicle still.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

from ..terrain import FloatArray, ForceFunction, TrackedVehicle

Integrator = Literal["implicit", "sdirk2", "euler"]
INTEGRATORS: Final[tuple[Integrator, ...]] = ("implicit", "sdirk2", "euler")

Body = tuple[float, float, float]

NEWTON_LIMIT: Final = 8
MAXIMUM_DIVISIONS: Final = 16
#: Residual in m/s and rad/s at which a stage counts as solved, for a force resolved to float64.
TOLERANCE: Final = 1e-11
# A force resolved to one part in 1/ε moves a body by up to about 10 m/s² · 10 ms · ε a tick; eight times that is
# above the rounding of a network's sums, too.
_TOLERANCE_PER_RESOLUTION: Final = 8.0
_LINE_SEARCH_LIMIT: Final = 8
_GAMMA: Final = 1.0 - 1.0 / math.sqrt(2.0)


class BodyStep(NamedTuple):
    """A solved step.

    Parameters
    ----------
    body : tuple of float
        (Vx, Vy, ω) at its end.
    row : ndarray, shape (d,)
        What the block received in the accepted evaluation.
    forces : ndarray, shape (3,)
        What it returned.
    iterations : int
        Newton steps taken.
    divisions : int
        Parts that the tick was solved in: 1, or up to 16 where Newton did not converge.
    """

    body: Body
    row: FloatArray
    forces: FloatArray
    iterations: int
    divisions: int


def tolerance(resolution: float) -> float:
    """Return the residual at which a stage counts as solved, in m/s and rad/s.

    Parameters
    ----------
    resolution : float
        The backend's relative force resolution: 2.2e-16 for float64, 1.2e-7 for a float32 network.
    """
    return max(TOLERANCE, _TOLERANCE_PER_RESOLUTION * resolution)


@dataclass(frozen=True)
class Dynamics:
    """What moves the body during one tick.

    Parameters
    ----------
    vehicle : TrackedVehicle
        Mass and yaw inertia.
    evaluate : callable
        Forces and Jacobian of one interface row.
    pull : tuple of float
        (g_x, g_y): gravity along the body axes in m/s², zero on level ground.
    """

    vehicle: TrackedVehicle
    evaluate: ForceFunction
    pull: tuple[float, float] = (0.0, 0.0)

    def rates(self, body: Body, forces: FloatArray) -> Body:
        """Return f(y) = (Qx/m + g_x + ωVy, Qy/m + g_y − ωVx, Mz/I_z)."""
        vx, vy, yaw_rate = body
        qx, qy, mz = forces.tolist()
        mass, (pull_x, pull_y) = self.vehicle.mass, self.pull
        return qx / mass + pull_x + yaw_rate * vy, qy / mass + pull_y - yaw_rate * vx, mz / self.vehicle.yaw_inertia


def implicit_step(
    dynamics: Dynamics,
    row: FloatArray,
    *,
    step: float,
    tolerance: float,
    integrator: Integrator = "implicit",
) -> BodyStep | None:
    """Advance the body by ``step`` s, in halved steps where Newton does not converge.

    Parameters
    ----------
    dynamics : Dynamics
        What moves the body.
    row : ndarray, shape (d,)
        Interface row with the body at the start; accelerations, belts and terrain stay as they are.
    step : float
        In s.
    tolerance : float
        Residual in m/s and rad/s at which a stage counts as solved.
    integrator : {"implicit", "sdirk2"}
        Backward Euler, or the two-stage method with γ = 1 − 1/√2.

    Returns
    -------
    BodyStep or None
        None if sixteenths of the step were not solved either.
    """
    divisions = 1
    while divisions <= MAXIMUM_DIVISIONS:
        result = _divided_step(dynamics, row, step / divisions, divisions, tolerance, integrator)
        if result is not None:
            return result
        divisions *= 2
    return None


def explicit_step(dynamics: Dynamics, row: FloatArray, *, step: float) -> BodyStep:
    """Advance the body by one explicit Euler step, y⁺ = y + h f(y): what a simple fixed-step solver does."""
    forces = dynamics.evaluate(row)[0]
    body: Body = (float(row[0]), float(row[1]), float(row[2]))
    return BodyStep(_along(body, step, dynamics.rates(body, forces)), row.copy(), forces, 0, 1)


def _divided_step(
    dynamics: Dynamics,
    row: FloatArray,
    part: float,
    divisions: int,
    tolerance: float,
    integrator: Integrator,
) -> BodyStep | None:
    row = row.copy()
    solution: _Stage | None = None
    iterations = 0
    for _ in range(divisions):
        body: Body = (float(row[0]), float(row[1]), float(row[2]))
        if integrator == "sdirk2":
            solution = _sdirk2(dynamics, row, body, part, tolerance)
        else:
            solution = _solve_from_two_guesses(dynamics, row, body, body, part, tolerance)
        if solution is None:
            return None
        iterations += solution.iterations
        row[:3] = solution.body
    return solution and BodyStep(solution.body, row, solution.forces, iterations, divisions)


class _Stage(NamedTuple):
    body: Body
    forces: FloatArray
    iterations: int


def _sdirk2(dynamics: Dynamics, row: FloatArray, body: Body, step: float, tolerance: float) -> _Stage | None:
    first = _solve_from_two_guesses(dynamics, row, body, body, _GAMMA * step, tolerance)
    if first is None:
        return None
    rates = dynamics.rates(first.body, first.forces)
    anchor = _along(body, (1.0 - _GAMMA) * step, rates)
    second = _solve_from_two_guesses(dynamics, row, anchor, first.body, _GAMMA * step, tolerance)
    return second and second._replace(iterations=first.iterations + second.iterations)


def _solve_from_two_guesses(
    dynamics: Dynamics,
    row: FloatArray,
    anchor: Body,
    guess: Body,
    gain: float,
    tolerance: float,
) -> _Stage | None:
    """Solve a stage from a guess, or from rolling without slip: where ground grips hard, the solution is near there."""
    stage = _solve_stage(dynamics, row, anchor, guess, gain, tolerance)
    if stage is None:
        left, right = row[5:7].tolist()
        rolling = ((left + right) / 2, 0.0, (right - left) / dynamics.vehicle.tread)
        stage = _solve_stage(dynamics, row, anchor, rolling, gain, tolerance)
    return stage


def _solve_stage(
    dynamics: Dynamics,
    row: FloatArray,
    anchor: Body,
    guess: Body,
    gain: float,
    tolerance: float,
) -> _Stage | None:
    """Solve y = anchor + gain·f(y) by damped Newton, or return None."""
    row = row.copy()
    body = guess
    row[:3] = body
    forces, jacobian = dynamics.evaluate(row)
    residual = _residual(dynamics, body, forces, anchor, gain)
    for iteration in range(NEWTON_LIMIT + 1):
        size = _size(residual)
        if size <= tolerance:
            return _Stage(body, forces, iteration)
        if iteration == NEWTON_LIMIT or not math.isfinite(size):
            return None
        direction = _newton_direction(dynamics.vehicle, body, jacobian, residual, gain)
        if direction is None:
            return None
        damping = 1.0
        for _ in range(_LINE_SEARCH_LIMIT):
            trial = _along(body, damping, direction)
            row[:3] = trial
            forces, jacobian = dynamics.evaluate(row)
            residual = _residual(dynamics, trial, forces, anchor, gain)
            # An inequality that NaN fails.
            if _size(residual) < size:
                break
            damping /= 2
        else:
            return None
        body = trial
    return None


def _residual(dynamics: Dynamics, body: Body, forces: FloatArray, anchor: Body, gain: float) -> Body:
    rates = dynamics.rates(body, forces)
    return (
        body[0] - anchor[0] - gain * rates[0],
        body[1] - anchor[1] - gain * rates[1],
        body[2] - anchor[2] - gain * rates[2],
    )


def _newton_direction(
    vehicle: TrackedVehicle, body: Body, jacobian: FloatArray, residual: Body, gain: float
) -> Body | None:
    """Solve (I − gain·∂f/∂y) δ = −residual by cofactors; None where the matrix is singular."""
    vx, vy, yaw_rate = body
    by_mass, by_inertia = gain / vehicle.mass, gain / vehicle.yaw_inertia
    (xx, xy, xw), (yx, yy, yw), (wx, wy, ww) = jacobian[:, :3].tolist()
    a, b, c = 1.0 - by_mass * xx, -by_mass * xy - gain * yaw_rate, -by_mass * xw - gain * vy
    d, e, f = -by_mass * yx + gain * yaw_rate, 1.0 - by_mass * yy, -by_mass * yw + gain * vx
    g, h, i = -by_inertia * wx, -by_inertia * wy, 1.0 - by_inertia * ww
    ca, cb, cc = e * i - f * h, f * g - d * i, d * h - e * g
    determinant = a * ca + b * cb + c * cc
    if not (math.isfinite(determinant) and determinant != 0.0):
        return None
    r, s, t = residual
    direction = (
        -(ca * r + (c * h - b * i) * s + (b * f - c * e) * t) / determinant,
        -(cb * r + (a * i - c * g) * s + (c * d - a * f) * t) / determinant,
        -(cc * r + (b * g - a * h) * s + (a * e - b * d) * t) / determinant,
    )
    return direction if math.isfinite(sum(direction)) else None


def _along(start: Body, length: float, direction: Body) -> Body:
    return (
        start[0] + length * direction[0],
        start[1] + length * direction[1],
        start[2] + length * direction[2],
    )


def _size(residual: Body) -> float:
    # Not max(): it would drop a NaN that is not first.
    return abs(residual[0]) + abs(residual[1]) + abs(residual[2])
