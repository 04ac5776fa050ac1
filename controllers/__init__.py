"""Who drives, and what changes when the backend does? Pure pursuit, MPC, policies, and their comparison."""

from .comparison import compare, document, without_times
from .comparison_row import ComparisonRow, Drive
from .mpc import PathTrackingMPC, SolveRecord
from .mpc_config import FAILURE_ACTIONS, SOLVERS, MPCConfig
from .mpc_problem import Solution, Solver
from .pure_pursuit import PurePursuit, PurePursuitConfig
from .rl import (
    EnvironmentSpec,
    Evaluation,
    Policy,
    PolicyDriver,
    Recipe,
    TrainingPlan,
    TrainingResult,
    evaluate,
    load_policy,
    shipped_policies,
    train_policy,
)
from .scenario import Scenario
from .slip_model import PredictionModel, SlipParameters, identify_slip
from .speed_profile import SpeedProfile

__all__ = [
    "FAILURE_ACTIONS",
    "SOLVERS",
    "ComparisonRow",
    "Drive",
    "EnvironmentSpec",
    "Evaluation",
    "MPCConfig",
    "PathTrackingMPC",
    "Policy",
    "PolicyDriver",
    "PredictionModel",
    "PurePursuit",
    "PurePursuitConfig",
    "Recipe",
    "Scenario",
    "SlipParameters",
    "Solution",
    "SolveRecord",
    "Solver",
    "SpeedProfile",
    "TrainingPlan",
    "TrainingResult",
    "compare",
    "document",
    "evaluate",
    "identify_slip",
    "load_policy",
    "shipped_policies",
    "train_policy",
    "without_times",
]
