"""Who drives, and what changes when the backend does? Pure pursuit, MPC, policies, and their comparison."""

from .comparison import ComparisonRow, Drive, Scenario, compare, document, without_times
from .mpc import PathTrackingMPC, SolveRecord
from .mpc_config import FAILURE_ACTIONS, SOLVERS, MPCConfig
from .mpc_problem import Solution, Solver
from .policy import PolicyDriver, TrackingPolicy
from .pure_pursuit import PurePursuit, PurePursuitConfig
from .reinforcement import PPOConfig, train_policy
from .slip_model import PredictionModel, SlipParameters, identify_slip
from .speed_profile import SpeedProfile

__all__ = [
    "FAILURE_ACTIONS",
    "SOLVERS",
    "ComparisonRow",
    "Drive",
    "MPCConfig",
    "PPOConfig",
    "PathTrackingMPC",
    "PolicyDriver",
    "PredictionModel",
    "PurePursuit",
    "PurePursuitConfig",
    "Scenario",
    "SlipParameters",
    "Solution",
    "SolveRecord",
    "Solver",
    "SpeedProfile",
    "TrackingPolicy",
    "compare",
    "document",
    "identify_slip",
    "train_policy",
    "without_times",
]
