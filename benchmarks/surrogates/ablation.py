"""What each ingredient of the structured surrogate is worth: the same training with one of them taken away."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from grouser.surrogate import torch_module
from grouser.surrogate.offline import PRESETS, Dataset, TrainingConfig, split_runs
from grouser.surrogate.offline.objective import StructuredObjective
from grouser.surrogate.offline.preparation import training_rows
from grouser.surrogate.offline.training import optimize
from grouser.surrogate.track_model import POINTS, Side, TrackState
from grouser.terrain import OUTPUT_NAMES, FloatArray

SEEDS: Final = (0, 1, 2)

Change = Callable[[TrackState], TrackState]


@dataclass(frozen=True)
class Variant:
    """One ablation.

    Parameters
    ----------
    name : str
        What is taken away or added.
    change : callable
        What becomes of a track's state.
    even : bool
        Whether errors are over their standard deviation instead of the available shear.
    recipe : dict
        Fields of the recipe that differ.
    """

    name: str
    change: Change = lambda state: state
    even: bool = False
    recipe: tuple[tuple[str, int], ...] = ()


def _without_features(first: int, last: int) -> Change:
    def change(state: TrackState) -> TrackState:
        features = state.features.copy()
        features[:, first:last] = 0.0
        return replace(state, features=features)

    return change


_SHEAR: Final = 2 * POINTS
VARIANTS: Final = (
    Variant("complete"),
    Variant("no quadrature", lambda state: replace(state, quadrature=np.zeros_like(state.quadrature))),
    Variant("no gate", lambda state: replace(state, gate=np.ones_like(state.gate))),
    Variant("no shear features", _without_features(0, _SHEAR)),
    Variant("no slip size feature", _without_features(_SHEAR, _SHEAR + 1)),
    Variant("errors over their standard deviation", even=True),
    Variant("no space-filling rows", recipe=(("space_filling_rows", 0),)),
    Variant("logged rows alone", recipe=(("perturbed_copies", 0), ("space_filling_rows", 0))),
)


class AblatedObjective(StructuredObjective):
    """The structured objective with a change to every track's state."""

    def __init__(self, variant: Variant, config: TrainingConfig, dataset: Dataset, inputs: FloatArray) -> None:
        self._variant = variant
        self._even = dataset.forces.std(axis=0) / 20
        super().__init__(config, dataset.vehicle, dataset.manifest.mode, inputs)

    def state(self, inputs: FloatArray, side: Side) -> TrackState:
        """Return the changed state."""
        return self._variant.change(super().state(inputs, side))

    def scale(self, states: Sequence[TrackState]) -> FloatArray:
        """Return the available shear, or one scale for all rows, Mz over L/4 as much as the forces."""
        if not self._variant.even:
            return super().scale(states)
        force = float(self._even[:2].mean())
        return np.broadcast_to(force * self._levers, (len(states[0].gate), 3))

    def residuals(self, module: Any, inputs: FloatArray, forces: FloatArray) -> FloatArray:
        """Return predicted less given forces in their units, shape (n, 3)."""
        import torch

        with torch.inference_mode():
            errors = self.errors(module, self.tensors(inputs, forces)).double().numpy()
        return np.asarray(errors * self.scale([self.state(inputs, "left"), self.state(inputs, "right")]))


def quadrature_alone(dataset: Dataset) -> dict[str, float]:
    """R² of the analytic part on the test runs, without any network."""
    test = dataset.select(split_runs(dataset.records).test)
    config = PRESETS[f"m113-{dataset.manifest.mode}-paper"].training
    objective = AblatedObjective(Variant("complete"), config, dataset, test.inputs)
    _, _, left = objective.tensors(test.inputs, test.forces)
    states = [objective.state(test.inputs, side) for side in ("left", "right")]
    return _explained(left.double().numpy() * objective.scale(states), test.forces)


def ablations(dataset: Dataset, epochs: int) -> Iterator[tuple[str, Callable[[], dict[str, float]]]]:
    """Yield name and computation of every variant and seed."""
    for seed in SEEDS:
        for variant in VARIANTS:
            yield (
                f"{variant.name}, seed {seed}",
                lambda variant=variant, seed=seed: train_variant(dataset, variant, epochs, seed),  # type: ignore[misc]
            )


def train_variant(dataset: Dataset, variant: Variant, epochs: int, seed: int) -> dict[str, float]:
    """Train one variant, and return its R² on the test runs of the seed's split."""
    preset = PRESETS[f"m113-{dataset.manifest.mode}-paper"].training
    changes: dict[str, Any] = {"epochs": epochs, "patience": epochs, "seed": seed, **dict(variant.recipe)}
    config = replace(preset, **changes)
    split = split_runs(dataset.records, seed=seed)
    train, validation, test = (dataset.select(side) for side in (split.train, split.validation, split.test))
    inputs, forces = training_rows(train, config)
    objective = AblatedObjective(variant, config, dataset, inputs)
    with TemporaryDirectory() as folder:
        network, _ = optimize(
            config,
            objective,
            [(inputs, forces), (validation.inputs, validation.forces)],
            Path(folder) / "variant.checkpoint",
            {"config": asdict(config)},
            None,
        )
    return _explained(objective.residuals(torch_module(network), test.inputs, test.forces), test.forces)


def _explained(residuals: FloatArray, forces: FloatArray) -> dict[str, float]:
    shares = 1.0 - np.mean(residuals**2, axis=0) / forces.var(axis=0)
    return dict(zip(OUTPUT_NAMES, shares.tolist(), strict=True))
