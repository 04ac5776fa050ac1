"""How is a surrogate made and judged? Maneuvers, datasets, splits, training, metrics. Needs ``grouser[torch]``."""

from .dataset import Dataset, load_dataset
from .engines import ENGINES, Engine
from .generate import DataConfig, generate_dataset
from .ingest import OriginLog, ingest_logs
from .joining import join_datasets
from .maneuvers import MANEUVERS, Maneuver, draw_maneuver
from .manifest import Manifest, RunRecord
from .metrics import OutputMetrics, RunError, force_metrics, metrics_to_dict, output_metrics, worst_runs
from .presets import PRESETS, Preset, preset
from .space_filling import space_filling_rows
from .split import RunSplit, split_runs
from .training import EpochReport, TrainingResult, train_surrogate
from .training_config import TrainingConfig
from .verification import Finding, verify_artifact, verify_dataset

__all__ = [
    "ENGINES",
    "MANEUVERS",
    "PRESETS",
    "DataConfig",
    "Dataset",
    "Engine",
    "EpochReport",
    "Finding",
    "Maneuver",
    "Manifest",
    "OriginLog",
    "OutputMetrics",
    "Preset",
    "RunError",
    "RunRecord",
    "RunSplit",
    "TrainingConfig",
    "TrainingResult",
    "draw_maneuver",
    "force_metrics",
    "generate_dataset",
    "ingest_logs",
    "join_datasets",
    "load_dataset",
    "metrics_to_dict",
    "output_metrics",
    "preset",
    "space_filling_rows",
    "split_runs",
    "train_surrogate",
    "verify_artifact",
    "verify_dataset",
    "worst_runs",
]
