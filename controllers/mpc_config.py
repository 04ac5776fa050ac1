"""Settings of the path-tracking MPC, validated and frozen."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

from ..terrain import unknown_name
from ..terrain.parameters import require_in

FailureAction = Literal["shift", "brake"]
SolverName = Literal["fatrop", "ipopt", "hpipm", "qrqp"]
SOLVERS: Final = ("fatrop", "ipopt", "hpipm", "qrqp")
FAILURE_ACTIONS: Final = ("shift", "brake")


@dataclass(frozen=True)
class MPCConfig:
    """Settings of :class:`~grouser.controllers.PathTrackingMPC`. Weights multiply squares of SI values.

    Parameters
    ----------
    speed : float
        Target speed in m/s, in (0, training speed].
    lateral_acceleration : float
        Limit on speed² · curvature of the reference in m/s²; by default none.
    stop_at_end : bool
        Whether to come to rest at the end of an open path.
    horizon : int
        N, stages.
    period : float
        Length of a stage in s, which is the control period and the deadline.
    solver : {"fatrop", "ipopt", "hpipm", "qrqp"}
        Interior points with the exact Hessian (fatrop uses the stage structure, ipopt does not), or Gauss-Newton
        sequential quadratic programming with the quadratic solver of that name: as good near the path, but from far
        off it often does not converge.
    max_iterations : int
        Of the solver.
    tolerance : float
        Of the solver.
    lateral, longitudinal, heading, yaw_rate, speed_weight, belt_acceleration : float
        Weights of the errors across and along the path, in heading, yaw rate and speed, and of belt acceleration.
    terminal : float
        Factor on the errors of the last stage.
    slack_linear, slack_quadratic : float
        Price of each metre, and squared metre, beyond the corridor.
    half_width : float
        Room for the CG to either side of the path in m, where the path has no lane.
    on_failure : {"shift", "brake"}
        What is applied where a solve fails: the next move of the last good plan, at most ``shift_limit`` times in a
        row, and then as ``brake``: belts ramped to rest with ``brake_deceleration``, their ratio kept.
    shift_limit : int
        See ``on_failure``.
    brake_deceleration : float
        Of the faster belt, in m/s².

    Raises
    ------
    ConfigurationError
        If a name is unknown.
    InvalidInputError
        If a number is out of range.
    """

    speed: float = 5.0
    lateral_acceleration: float = math.inf
    stop_at_end: bool = False
    horizon: int = 20
    period: float = 0.1
    solver: SolverName = "fatrop"
    max_iterations: int = 100
    tolerance: float = 1e-6
    lateral: float = 10.0
    longitudinal: float = 0.5
    heading: float = 5.0
    yaw_rate: float = 5.0
    speed_weight: float = 2.0
    belt_acceleration: float = 0.02
    terminal: float = 3.0
    slack_linear: float = 20.0
    slack_quadratic: float = 20.0
    half_width: float = 1.0
    on_failure: FailureAction = "shift"
    shift_limit: int = 5
    brake_deceleration: float = 2.0

    def __post_init__(self) -> None:
        if self.solver not in SOLVERS:
            raise unknown_name("solver", self.solver, SOLVERS)
        if self.on_failure not in FAILURE_ACTIONS:
            raise unknown_name("failure action", self.on_failure, FAILURE_ACTIONS)
        require_in("horizon", self.horizon, 2, 500)
        require_in("max_iterations", self.max_iterations, 1, 10_000)
        require_in("shift_limit", self.shift_limit, 0, self.horizon - 1)
        for name in ("lateral", "longitudinal", "heading", "yaw_rate", "speed_weight", "slack_linear", "half_width"):
            require_in(name, getattr(self, name), 0.0, 1e6)
        for name in ("speed", "period", "tolerance", "terminal", "belt_acceleration", "slack_quadratic"):
            require_in(name, getattr(self, name), 0.0, 1e6, low_open=True)
        require_in("lateral_acceleration", self.lateral_acceleration, 0.0, math.inf, low_open=True)
        require_in("brake_deceleration", self.brake_deceleration, 0.0, 1e3, low_open=True)
