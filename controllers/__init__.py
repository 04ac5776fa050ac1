"""Who drives: pure pursuit, model predictive control, and the slip model that both rest on."""

from .mpc import PathTrackingMPC, SolveRecord
from .mpc_problem import FAILURE_ACTIONS, SOLVERS, MPCConfig, Solution, Solver
from .pure_pursuit import PurePursuit, PurePursuitConfig
from .slip_model import PredictionModel, SlipParameters, identify_slip
from .speed_profile import SpeedProfile

__all__ = [
    "FAILURE_ACTIONS",
    "SOLVERS",
    "MPCConfig",
    "PathTrackingMPC",
    "PredictionModel",
    "PurePursuit",
    "PurePursuitConfig",
    "SlipParameters",
    "Solution",
    "SolveRecord",
    "Solver",
    "SpeedProfile",
    "identify_slip",
]
