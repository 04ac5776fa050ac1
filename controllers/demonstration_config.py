"""The sizes of the demonstration, validated and frozen."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from ..surrogate.offline.generate import DataConfig
from ..surrogate.offline.training_config import TrainingConfig
from ..terrain import InvalidInputError, Mode


@dataclass(frozen=True)
class DemoConfig:
    """Sizes of the demonstration.

    Parameters
    ----------
    vehicle : str
        Preset name or catalogue file.
    rigid_ranges, soil_ranges : str
        Terrain ranges of the two datasets. Ice lies outside the ``paper`` ranges, LETE sand inside the ``wide`` ones.
    rigid_runs, soil_runs : int
        Runs of the two datasets.
    samples_per_run : int
        Logged ticks a run.
    training : TrainingConfig
        Of both surrogates.
    policy : str
        That drives on every ground: the name of a shipped one, or a file; of the same vehicle and reference speed.
    path : str
        Name of the path or a CSV file.
    speed : float
        Reference speed in m/s.
    ice_from : float
        x in m from which the third scenario's asphalt is ice.
    time_limit : float
        Of a drive, in s.
    seed : int
        Of everything that is drawn; takes the place of that of ``training``.
    """

    vehicle: str = "m113"
    rigid_ranges: str = "paper"
    soil_ranges: str = "wide"
    rigid_runs: int = 480
    soil_runs: int = 600
    samples_per_run: int = 300
    training: TrainingConfig = field(
        default_factory=lambda: TrainingConfig(epochs=8, batch_size=2048, learning_rate=3e-3, learning_rate_decay=0.85)
    )
    policy: str = "m113-path-tracking"
    path: str = "iso-3888-1"
    speed: float = 5.0
    ice_from: float = 40.0
    time_limit: float = 60.0
    seed: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "training", replace(self.training, seed=self.seed))
        for name in ("rigid_runs", "soil_runs"):
            if getattr(self, name) < 18:
                raise InvalidInputError(
                    f"{name} must be at least 18, three of each maneuver, got {getattr(self, name)}"
                )

    def data(self, mode: Mode) -> DataConfig:
        """Return what to generate for a mode."""
        rigid = mode == "rigid"
        return DataConfig(
            mode=mode,
            vehicle=self.vehicle,
            ranges=self.rigid_ranges if rigid else self.soil_ranges,
            runs=self.rigid_runs if rigid else self.soil_runs,
            samples_per_run=self.samples_per_run,
            transient=0.5,
            seed=self.seed,
        )
