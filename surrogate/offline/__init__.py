"""How is a surrogate made and judged? Maneuvers, datasets, splits, training, metrics. Needs ``grouser[torch]``."""

from .dataset import Dataset, load_dataset
from .generate import DataConfig, generate_dataset
from .maneuvers import MANEUVERS, Maneuver, draw_maneuver
from .manifest import Manifest, RunRecord
from .metrics import OutputMetrics, RunError, force_metrics, metrics_to_dict, output_metrics, worst_runs
from .split import RunSplit, split_runs
from .training import EpochReport, TrainingResult, train_surrogate
from .training_config import TrainingConfig

__all__ = [
    "MANEUVERS",
    "DataConfig",
    "Dataset",
    "EpochReport",
    "Maneuver",
    "Manifest",
    "OutputMetrics",
    "RunError",
    "RunRecord",
    "RunSplit",
    "TrainingConfig",
    "TrainingResult",
    "draw_maneuver",
    "force_metrics",
    "generate_dataset",
    "load_dataset",
    "metrics_to_dict",
    "output_metrics",
    "split_runs",
    "train_surrogate",
    "worst_runs",
]
