"""Two small datasets, rigid and soil, made once a session, and a small training on the first."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from grouser.surrogate.offline.dataset import Dataset, load_dataset
from grouser.surrogate.offline.generate import DataConfig, generate_dataset
from grouser.surrogate.offline.training import TrainingResult, train_surrogate
from grouser.surrogate.offline.training_config import TrainingConfig
from grouser.terrain import MODES

#: Each maneuver three times, the fewest that a split takes.
RUNS, SAMPLES = 18, 40


@pytest.fixture(scope="session")
def data_config() -> Callable[..., DataConfig]:
    """A recipe of a second: ``data_config(mode="soil", seed=4, ...)``."""

    def make(**changes: Any) -> DataConfig:
        return DataConfig(**{"runs": RUNS, "samples_per_run": SAMPLES, "transient": 0.5, "seed": 3} | changes)

    return make


@pytest.fixture(scope="session")
def folders(tmp_path_factory: pytest.TempPathFactory, data_config: Callable[..., DataConfig]) -> dict[str, Path]:
    """Finished datasets by mode, made by one worker. Copy one before damaging it."""
    root = tmp_path_factory.mktemp("datasets")
    for mode in MODES:
        generate_dataset(data_config(mode=mode), root / mode)
    return {mode: root / mode for mode in MODES}


@pytest.fixture(scope="session")
def datasets(folders: dict[str, Path]) -> dict[str, Dataset]:
    return {mode: load_dataset(folder) for mode, folder in folders.items()}


@pytest.fixture(scope="session", params=MODES)
def dataset(request: pytest.FixtureRequest, datasets: dict[str, Dataset]) -> Dataset:
    return datasets[request.param]


@pytest.fixture(scope="session")
def rigid(datasets: dict[str, Dataset]) -> Dataset:
    return datasets["rigid"]


@pytest.fixture(scope="session")
def training_config() -> Callable[..., TrainingConfig]:
    """A recipe of a tenth of a second: ``training_config(dropout=0.2, ...)``."""

    def make(**changes: Any) -> TrainingConfig:
        small: dict[str, Any] = {
            "hidden": (8, 8),
            "epochs": 4,
            "batch_size": 256,
            "perturbed_copies": 1,
            "learning_rate": 1e-2,
        }
        return TrainingConfig(**small | changes)

    return make


@pytest.fixture(scope="session")
def trained(
    tmp_path_factory: pytest.TempPathFactory, rigid: Dataset, training_config: Callable[..., TrainingConfig]
) -> tuple[TrainingResult, Path]:
    """An uninterrupted training of the small recipe on the rigid dataset, and its artifact."""
    path = tmp_path_factory.mktemp("training") / "small.safetensors"
    return train_surrogate(rigid, training_config(), path), path
