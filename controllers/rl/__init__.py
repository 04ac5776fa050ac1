"""Policies: trained by stable-baselines3, kept as data, judged, filmed and recorded on any backend."""

from .algorithms import ALGORITHMS, Architecture
from .driver import PolicyDriver
from .environment import EnvironmentSpec, environment_id, environment_ids, short_name
from .evaluation import EpisodeResult, Evaluation, evaluate
from .normalizer import ObservationNormalizer
from .policy import Policy, load_policy
from .recipe import Recipe, shipped_recipes
from .training import TrainingPlan, TrainingResult, read_curve, train_policy

__all__ = [
    "ALGORITHMS",
    "Architecture",
    "EnvironmentSpec",
    "EpisodeResult",
    "Evaluation",
    "ObservationNormalizer",
    "Policy",
    "PolicyDriver",
    "Recipe",
    "TrainingPlan",
    "TrainingResult",
    "environment_id",
    "environment_ids",
    "evaluate",
    "load_policy",
    "read_curve",
    "shipped_recipes",
    "short_name",
    "train_policy",
]
