"""One step of the body's equations of motion under a force function: implicit Euler, SDIRK2, explicit Euler.

m(V̇x − ωVy) = Qx + m g_x, m(V̇y + ωVx) = Qy + m g_y, I_z ω̇ = Mz, that is ẏ = f(y) for y = (Vx, Vy, ω). Near zero slip the forces are
as stiff as −2.6·10⁴ s⁻¹, and they saturate, so that neither explicit nor linearly implicit steps hold a vehicle still.

A step is solved by Broyden's method from one Jacobian, where the forces of the last tick take the body: nearly always
that is a good guess. Where its steps do not contract, damped Newton takes over, from other guesses and in parts of the
step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

from ..terrain import FloatArray, ForceFunction, TrackedVehicle

Integrator = Literal["implicit", "sdirk2", "euler"]
INTEGRATORS: Final[tuple[Integrator, ...]] = ("implicit", "sdirk2", "euler")

Body = tuple[float, float, float]
_Matrix = tuple[Body, Body, Body]

BROYDEN_LIMIT: Final = 12
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
        Broyden's or Newton's steps taken.
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
    yaw_acceleration : float
        That is to be expected, in rad/s²: of the first guess alone.
    """

    vehicle: TrackedVehicle
    evaluate: ForceFunction
    pull: tuple[float, float] = (0.0, 0.0)
    yaw_acceleration: float = 0.0

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
    """Advance the body by ``step`` s: by Broyden's method, or by damped Newton, in halved steps where need be.

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
    result = _broyden_step(dynamics, row, step, tolerance, integrator)
    if result is not None:
        return result
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


def _broyden_step(
    dynamics: Dynamics, row: FloatArray, step: float, tolerance: float, integrator: Integrator
) -> BodyStep | None:
    """Solve the whole step from one Jacobian, at the body that the last tick's forces extrapolate to."""
    row = row.copy()
    body: Body = (float(row[0]), float(row[1]), float(row[2]))
    gain = _GAMMA * step if integrator == "sdirk2" else step
    accelerations = float(row[3]), float(row[4]), dynamics.yaw_acceleration
    guess = _extrapolated(body, accelerations, dynamics.pull, gain, tolerance)
    row[:3] = guess
    forces, jacobian = dynamics.evaluate(row)
    inverse = _inverse(dynamics.vehicle, guess, jacobian, gain)
    if inverse is None:
        return None
    solver = _Broyden(dynamics, row, gain, tolerance, inverse)
    stage = solver.solve(body, _Stage(guess, forces, 0), extrapolated=guess != body)
    if stage is not None and integrator == "sdirk2":
        anchor = _along(body, (1.0 - _GAMMA) * step, dynamics.rates(stage.body, stage.forces))
        stage = solver.solve(anchor, stage)
    return stage and BodyStep(stage.body, row, stage.forces, stage.iterations, 1)


def _extrapolated(body: Body, accelerations: Body, pull: tuple[float, float], gain: float, tolerance: float) -> Body:
    """Return where the accelerations take the body, or the body itself if that is within the tolerance."""
    vx, vy, yaw_rate = body
    change = (
        gain * (accelerations[0] + pull[0] + yaw_rate * vy),
        gain * (accelerations[1] + pull[1] - yaw_rate * vx),
        gain * accelerations[2],
    )
    return body if _size(change) <= tolerance else _along(body, 1.0, change)


@dataclass
class _Broyden:
    """Stages of one step: they share the inverse of I − gain·∂f/∂y, which every evaluation corrects."""

    dynamics: Dynamics
    row: FloatArray
    gain: float
    tolerance: float
    inverse: _Matrix

    def solve(self, anchor: Body, start: _Stage, *, extrapolated: bool = False) -> _Stage | None:
        """Solve y = anchor + gain·f(y) from a body whose forces are known, or return None.

        An extrapolated body is not taken for a solved one: a vehicle near rest would chatter within the tolerance.
        """
        body, forces, iterations = start
        residual = _residual(self.dynamics, body, forces, anchor, self.gain)
        direction = _direction(self.inverse, residual)
        size = _size(residual)
        if size <= self.tolerance and not extrapolated:
            return start
        for _ in range(BROYDEN_LIMIT):
            if not math.isfinite(sum(direction)):
                return None
            size_before = size
            body = _along(body, 1.0, direction)
            self.row[:3] = body
            forces = self.dynamics.evaluate(self.row)[0]
            residual = _residual(self.dynamics, body, forces, anchor, self.gain)
            direction = self._update(direction, residual)
            size = _size(residual)
            iterations += 1
            # A good guess may be nearer than the rounding of a step.
            if size <= self.tolerance:
                return _Stage(body, forces, iterations)
            # An inequality that NaN fails.
            if not size < size_before:
                return None
        return None

    def _update(self, step: Body, residual: Body) -> Body:
        """Correct the inverse H after a step s that left a residual, and return the next step.

        With u = −H·residual they are H + u (sᵀH)/(sᵀ(s − u)) and u sᵀs/(sᵀ(s − u)).
        """
        u = _direction(self.inverse, residual)
        square = _dot(step, step)
        below = square - _dot(step, u)
        if below == 0.0:
            return math.nan, math.nan, math.nan
        share = 1.0 / below
        first, second, third = (share * _dot(step, column) for column in zip(*self.inverse, strict=True))
        a, b, c = (
            (row[0] + part * first, row[1] + part * second, row[2] + part * third)
            for row, part in zip(self.inverse, u, strict=True)
        )
        self.inverse = (a, b, c)
        length = share * square
        return length * u[0], length * u[1], length * u[2]


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
        inverse = _inverse(dynamics.vehicle, body, jacobian, gain)
        if inverse is None:
            return None
        direction = _direction(inverse, residual)
        if not math.isfinite(sum(direction)):
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


def _inverse(vehicle: TrackedVehicle, body: Body, jacobian: FloatArray, gain: float) -> _Matrix | None:
    """Invert I − gain·∂f/∂y by cofactors; None where it is singular."""
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
    return (
        (ca / determinant, (c * h - b * i) / determinant, (b * f - c * e) / determinant),
        (cb / determinant, (a * i - c * g) / determinant, (c * d - a * f) / determinant),
        (cc / determinant, (b * g - a * h) / determinant, (a * e - b * d) / determinant),
    )


def _direction(inverse: _Matrix, residual: Body) -> Body:
    first, second, third = inverse
    return -_dot(first, residual), -_dot(second, residual), -_dot(third, residual)


def _dot(a: Body, b: Body) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _along(start: Body, length: float, direction: Body) -> Body:
    return (
        start[0] + length * direction[0],
        start[1] + length * direction[1],
        start[2] + length * direction[2],
    )


def _size(residual: Body) -> float:
    # Not max(): it would drop a NaN that is not first.
    return abs(residual[0]) + abs(residual[1]) + abs(residual[2])
