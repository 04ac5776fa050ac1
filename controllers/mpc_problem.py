"""The optimal control problem of path tracking: cost, constraints, and solving it with CasADi."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np

from ..terrain import FloatArray, TrackedVehicle, missing_extra
from .mpc_config import MPCConfig
from .slip_model import PredictionModel, SlipParameters

#: Reference of a stage: x, y, cos and sin of the path's heading, heading to hold, yaw rate, speed, room right and left.
REFERENCE_SIZE: Final = 9
_STATES: Final = 6
_INPUTS: Final = 3
_STAGE_ROWS: Final = _STATES + 6
_FEASIBLE: Final = 1e-5


@dataclass(frozen=True, eq=False)
class Solution:
    """What a solver returned, and what the next solve starts from.

    Parameters
    ----------
    states : ndarray
        Predicted x, y, heading, yaw rate and belt speeds, shape (N + 1, 6); x, y relative to the vehicle.
    inputs : ndarray
        Belt-speed commands and slack, shape (N, 3).
    bound_multipliers : ndarray
        Of the variables in their order x₀, u₀, x₁, …, x_N, shape (9 N + 6,).
    constraint_multipliers : ndarray
        Shape (12 N + 6,).
    objective : float
        Cost reached.
    status : str
        In the solver's words.
    success : bool
        Whether the solver converged and its point is finite and feasible.
    iterations : int
        Of the solver.
    """

    states: FloatArray
    inputs: FloatArray
    bound_multipliers: FloatArray
    constraint_multipliers: FloatArray
    objective: float = math.nan
    status: str = "guess"
    success: bool = False
    iterations: int = 0


class Solver(Protocol):
    """Whatever solves the problem for its parameters from a guess."""

    def __call__(self, parameters: FloatArray, guess: Solution) -> Solution:
        """Return the solution; ``success`` says whether it may be applied."""


class TrackingProblem:
    """Multiple shooting on :class:`~grouser.controllers.slip_model.PredictionModel`.

    Parameters of the problem are the initial state (6) and the references of N + 1 stages (9 each). The constraints of
    a stage are the gap to the model's next state, the belt acceleration |u − V| ≤ a T_d (which keeps the driveline in
    its linear range, where the prediction is exact), and the room at the front and rear of the contact length, widened
    by the slack. Stage 0 also holds the initial state, right after its gap.

    Parameters
    ----------
    vehicle : TrackedVehicle
        The vehicle.
    slip : SlipParameters
        How belt speeds become motion.
    config : MPCConfig
        Horizon, weights, solver.

    Raises
    ------
    ConfigurationError
        If CasADi is not installed.
    """

    def __init__(self, vehicle: TrackedVehicle, slip: SlipParameters, config: MPCConfig) -> None:
        try:
            import casadi
        except ImportError as error:
            raise missing_extra("casadi", "mpc") from error
        self.vehicle: Final = vehicle
        self.config: Final = config
        self.model: Final = PredictionModel(vehicle, slip, config.period)
        self._lower_g: list[float] = []
        self._upper_g: list[float] = []
        problem, residual = self._formulate(casadi)
        plugin, options = _solver_options(casadi, config, problem, residual)
        if plugin == "fatrop":
            options |= {
                "structure_detection": "manual",
                "N": config.horizon,
                "nx": [_STATES] * (config.horizon + 1),
                "nu": [_INPUTS] * config.horizon + [0],
                "ng": [_STAGE_ROWS] + [_STAGE_ROWS - _STATES] * (config.horizon - 1) + [0],
                "equality": [low == high for low, high in zip(self._lower_g, self._upper_g, strict=True)],
            }
        self._nlp: Final = casadi.nlpsol("path_tracking", plugin, problem, options)
        top = [vehicle.training_speed, vehicle.training_speed, math.inf]
        free = [math.inf] * _STATES
        bottom = [-vehicle.training_speed, -vehicle.training_speed, 0.0]
        self._upper_x: Final = np.array([*(free + top) * config.horizon, *free])
        self._lower_x: Final = np.array([*([-v for v in free] + bottom) * config.horizon, *[-v for v in free]])

    def _formulate(self, casadi: Any) -> tuple[dict[str, Any], Any]:
        config, sx = self.config, casadi.SX
        count = config.horizon
        start = sx.sym("start", _STATES)
        references = sx.sym("reference", REFERENCE_SIZE, count + 1)
        states = [sx.sym(f"x{k}", _STATES) for k in range(count + 1)]
        inputs = [sx.sym(f"u{k}", _INPUTS) for k in range(count)]
        swing = self.vehicle.belt_acceleration * self.vehicle.belt_time_constant
        residuals: list[Any] = []
        rows: list[Any] = []

        def constrain(row: Any, low: float, high: float) -> None:
            rows.append(row)
            self._lower_g += [low] * row.numel()
            self._upper_g += [high] * row.numel()

        for k, (state, move) in enumerate(zip(states, inputs, strict=False)):
            belts, slack, reference = state[4:6], move[2], references[:, k]
            constrain(states[k + 1] - casadi.vertcat(*self._step(casadi, state, move)), 0.0, 0.0)
            if k == 0:
                constrain(state - start, 0.0, 0.0)
            constrain(move[:2] - belts, -swing, swing)
            for reach in (0.5, -0.5):
                aside = self._errors(casadi, state, reference, reach * self.vehicle.contact_length)[0]
                constrain(aside - slack - reference[8], -math.inf, 0.0)
                constrain(aside + slack + reference[7], 0.0, math.inf)
            ease = math.sqrt(config.belt_acceleration) / self.vehicle.belt_time_constant
            residuals += [ease * (move[0] - belts[0]), ease * (move[1] - belts[1])]
            residuals.append(math.sqrt(config.slack_quadratic) * slack)
            if k > 0:
                residuals += self._weighted(casadi, state, reference, 1.0)
        residuals += self._weighted(casadi, states[-1], references[:, -1], config.terminal)

        residual = casadi.vertcat(*residuals)
        slope = config.slack_linear * sum(move[2] for move in inputs)
        pairs = [part for pair in zip(states, inputs, strict=False) for part in pair]
        problem = {
            "x": casadi.vertcat(*pairs, states[-1]),
            "p": casadi.vertcat(start, casadi.vec(references)),
            "f": casadi.sumsqr(residual) + slope,
            "g": casadi.vertcat(*rows),
        }
        return problem, residual

    def _step(self, casadi: Any, state: Any, move: Any) -> list[Any]:
        return self.model.step([state[i] for i in range(_STATES)], [move[0], move[1]], casadi)

    def _errors(self, casadi: Any, state: Any, reference: Any, ahead: float) -> tuple[Any, Any]:
        """Return the distance to the left of the path, and along it, of the point ``ahead`` m ahead of the CG."""
        dx = state[0] + ahead * casadi.cos(state[2]) - reference[0]
        dy = state[1] + ahead * casadi.sin(state[2]) - reference[1]
        return reference[2] * dy - reference[3] * dx, reference[2] * dx + reference[3] * dy

    def _weighted(self, casadi: Any, state: Any, reference: Any, factor: float) -> list[Any]:
        config = self.config
        lateral, longitudinal = self._errors(casadi, state, reference, 0.0)
        speed = self.model.slip.longitudinal_gain * (state[4] + state[5]) / 2
        weighted = (
            (config.lateral, lateral),
            (config.longitudinal, longitudinal),
            (config.heading, state[2] - reference[4]),
            (config.yaw_rate, state[3] - reference[5]),
            (config.speed_weight, speed - reference[6]),
        )
        return [math.sqrt(factor * weight) * error for weight, error in weighted]

    def __call__(self, parameters: FloatArray, guess: Solution) -> Solution:
        """Solve for the parameters, shape (6 + 9 (N + 1),), from a guess."""
        count, width = self.config.horizon, _STATES + _INPUTS
        inputs = guess.inputs.copy()
        inputs[:, 2] = self._needed_slack(parameters, guess.states[:-1])
        start = np.append(np.hstack([guess.states[:-1], inputs]).ravel(), guess.states[-1])
        result = self._nlp(
            x0=start,
            p=parameters,
            lbx=self._lower_x,
            ubx=self._upper_x,
            lbg=self._lower_g,
            ubg=self._upper_g,
            lam_x0=guess.bound_multipliers,
            lam_g0=guess.constraint_multipliers,
        )
        stats = self._nlp.stats()
        x, g, lam_x, lam_g = (
            np.asarray(result[name], dtype=np.float64).ravel() for name in ("x", "g", "lam_x", "lam_g")
        )
        status, success = str(stats["return_status"]), bool(stats["success"])
        if self.config.solver == "fatrop":
            status = "Solve_Succeeded" if success else f"fatrop code {status}"
        # A solver's own word is not enough: one has been seen to claim success for a point that breaks the constraints.
        excess = max(_excess(x, self._lower_x, self._upper_x), _excess(g, self._lower_g, self._upper_g))
        if success and not excess <= _FEASIBLE:
            status, success = f"{status}, but infeasible by {excess:.1g}", False
        stages = x[: count * width].reshape(count, width)
        return Solution(
            states=np.vstack([stages[:, :_STATES], x[count * width :]]),
            inputs=stages[:, _STATES:].copy(),
            bound_multipliers=lam_x,
            constraint_multipliers=lam_g,
            objective=float(result["f"]),
            status=status,
            success=success,
            iterations=int(stats["iter_count"]),
        )

    def _needed_slack(self, parameters: FloatArray, states: FloatArray) -> FloatArray:
        """Return the slack with which states of shape (N, 6) keep the corridor, shape (N,)."""
        reference = parameters[_STATES:].reshape(-1, REFERENCE_SIZE)[:-1]
        slack = np.zeros(len(states))
        for reach in (0.5, -0.5):
            dx, dy = (
                states[:, axis] + reach * self.vehicle.contact_length * turn(states[:, 2]) - reference[:, axis]
                for axis, turn in ((0, np.cos), (1, np.sin))
            )
            aside = reference[:, 2] * dy - reference[:, 3] * dx
            slack = np.maximum(slack, np.maximum(aside - reference[:, 8], -aside - reference[:, 7]))
        return slack

    def cold_guess(self, states: FloatArray, inputs: FloatArray) -> Solution:
        """Return a guess of states (N + 1, 6) and commands (N, 2) without multipliers."""
        size = states.size + len(inputs) * _INPUTS
        rows = _STAGE_ROWS * len(inputs) + _STATES
        slack = np.zeros((len(inputs), 1))
        return Solution(states, np.hstack([inputs, slack]), np.zeros(size), np.zeros(rows))

    def shifted(self, solution: Solution) -> Solution:
        """Return the solution one period on, as a guess: everything moves up a stage, the last stage repeats."""
        width = _STATES + _INPUTS
        last = np.array(self.model.step(list(solution.states[-1]), list(solution.inputs[-1, :2])))
        bounds = solution.bound_multipliers
        rows = solution.constraint_multipliers
        # Stage 0 alone holds the initial state, between its gap and the rest.
        tail = rows[_STAGE_ROWS + _STATES :]
        return Solution(
            states=np.vstack([solution.states[1:], last]),
            inputs=np.vstack([solution.inputs[1:], solution.inputs[-1:]]),
            bound_multipliers=np.concatenate(
                [bounds[width:-_STATES], bounds[-width - _STATES : -_STATES], bounds[-_STATES:]]
            ),
            constraint_multipliers=np.concatenate(
                [tail[:_STATES], rows[_STATES : 2 * _STATES], tail[_STATES:], tail[-_STAGE_ROWS:]]
            ),
        )


def _excess(values: FloatArray, low: Any, high: Any) -> float:
    """By how much the values leave their bounds; infinite where one is not a number."""
    excess = float(np.max(np.maximum(low - values, values - high)))
    return math.inf if math.isnan(excess) else excess


def _solver_options(
    casadi: Any, config: MPCConfig, problem: dict[str, Any], residual: Any
) -> tuple[str, dict[str, Any]]:
    """Return CasADi's plugin and its options."""
    common: dict[str, Any] = {"print_time": False, "error_on_fail": False, "expand": True}
    limit, tolerance = config.max_iterations, config.tolerance
    # A barrier parameter of 0.1 costs one more iteration on a good guess than the usual 1e-3 of warm starts, and needs
    # no cold restart on a bad one.
    if config.solver == "fatrop":
        tuned: dict[str, Any] = {"print_level": 0, "max_iter": limit, "tolerance": tolerance, "mu_init": 0.1}
        return "fatrop", common | {"fatrop": tuned}
    if config.solver == "ipopt":
        pushes = ("bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac", "mult_bound_push")
        tuned = {f"warm_start_{name}": 1e-6 for name in pushes}
        tuned |= {"print_level": 0, "sb": "yes", "max_iter": limit, "tol": tolerance, "mu_init": 0.1}
        return "ipopt", common | {"ipopt": tuned | {"warm_start_init_point": "yes"}}
    quadratic: dict[str, Any] = {"print_iter": False, "print_header": False, "print_info": False}
    if config.solver == "hpipm":
        quadratic = {"hpipm": {"iter_max": 100}}
    quiet = dict.fromkeys(("print_header", "print_iteration", "print_status"), False)
    return "sqpmethod", common | quiet | {
        "qpsol": config.solver,
        "qpsol_options": quadratic | {"error_on_fail": False},
        "hess_lag": _gauss_newton(casadi, problem, residual),
        "max_iter": limit,
        "tol_pr": tolerance,
        "tol_du": tolerance,
    }


def _gauss_newton(casadi: Any, problem: dict[str, Any], residual: Any) -> Any:
    """Return the Hessian that leaves out the curvature of residuals and constraints: never indefinite."""
    price, multipliers = casadi.SX.sym("price"), casadi.SX.sym("multipliers", problem["g"].numel())
    slope = casadi.jacobian(residual, problem["x"])
    arguments = [problem["x"], problem["p"], price, multipliers]
    return casadi.Function("gauss_newton", arguments, [2 * price * (slope.T @ slope)])
