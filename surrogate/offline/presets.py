"""The recipes of the shipped artifacts: what data each is made from, and how it is trained."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

from ...terrain import unknown_name
from .generate import DataConfig
from .training_config import TrainingConfig


@dataclass(frozen=True)
class Preset:
    """One artifact's recipe.

    Parameters
    ----------
    name : str
        Name of the artifact.
    summary : str
        What it is, in a few words.
    data : DataConfig
        Of its dataset; presets of one vehicle, mode and ranges share it.
    training : TrainingConfig
        The recipe.
    """

    name: str
    summary: str
    data: DataConfig
    training: TrainingConfig

    @property
    def dataset_name(self) -> str:
        """Name of the dataset's folder."""
        return f"{self.data.vehicle}-{self.data.mode}-{self.data.ranges}"


_STRUCTURED: Final = TrainingConfig(
    family="structured",
    # A layer is one vector of the widest units: 32 would leave a quarter to a half of the error, for 1.65 times the
    # time of a fleet's tick.
    hidden=(16, 16),
    space_filling_rows=200_000,
    schedule="cosine",
    epochs=40,
    patience=40,
    batch_size=4096,
    learning_rate=6e-3,
    symmetries=False,
)
# The recipe of the paper that the project starts from: logged rows alone, z-scores, Huber with Mz weighed three times,
# dropout and a little L2, early stopping and reduce-on-plateau.
_PAPER_RECIPE: Final = TrainingConfig(
    family="plain",
    hidden=(128, 128, 128, 128),
    activation="relu",
    dropout=0.05,
    weight_decay=1e-6,
    schedule="plateau",
    epochs=40,
    patience=8,
    plateau_patience=3,
    batch_size=2048,
    learning_rate=1e-3,
    perturbed_copies=0,
    symmetries=False,
    whiten=False,
)


def _presets() -> dict[str, Preset]:
    made = []
    for mode in ("rigid", "soil"):
        for vehicle in ("m113", "ugv"):
            summary = f"structured, {vehicle} on {mode} ground, wide ranges"
            data = DataConfig(mode=mode, vehicle=vehicle, ranges="wide")
            made.append(Preset(f"{vehicle}-{mode}", summary, data, _STRUCTURED))
        paper = DataConfig(mode=mode, vehicle="m113", ranges="paper")
        name = f"m113-{mode}-paper"
        made.append(Preset(name, f"structured, m113 on {mode} ground, the paper's ranges", paper, _STRUCTURED))
        summary = f"the paper's recipe, m113 on {mode} ground, the paper's ranges"
        made.append(Preset(f"{name}-recipe", summary, paper, _PAPER_RECIPE))
    return {preset.name: preset for preset in sorted(made, key=lambda preset: preset.name)}


PRESETS: Final[Mapping[str, Preset]] = _presets()


def preset(name: str, *, seed: int = 0) -> Preset:
    """Return a preset; another seed draws other runs, weights and orders.

    Raises
    ------
    ConfigurationError
        If the name is unknown.
    """
    if name not in PRESETS:
        raise unknown_name("preset", name, PRESETS)
    found = PRESETS[name]
    return replace(found, data=replace(found.data, seed=seed), training=replace(found.training, seed=seed))
