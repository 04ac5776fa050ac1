"""Policies: trained by stable-baselines3, kept as data, judged, filmed and recorded on any backend."""

from .algorithms import ALGORITHMS, Architecture
from .driver import PolicyDriver
from .environment import EnvironmentSpec, environment_id, environment_ids, short_name
from .evaluation import EpisodeResult, Evaluation, evaluate
from .normalizer import ObservationNormalizer
from .plan import TrainingPlan
from .policy import Policy, load_policy
from .recipe import Recipe
from .recipe_file import read_value, recipe_text, shipped_recipes
from .recording import record_dataset
from .run_folder import read_curve
from .shipped import shipped_policies
from .training import TrainingResult, train_policy
from .tuning import TuningResult, tune
from .video import film

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
    "TuningResult",
    "environment_id",
    "environment_ids",
    "evaluate",
    "film",
    "load_policy",
    "read_curve",
    "read_value",
    "recipe_text",
    "record_dataset",
    "shipped_policies",
    "shipped_recipes",
    "short_name",
    "train_policy",
    "tune",
]
