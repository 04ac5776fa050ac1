"""A training recipe, validated and frozen."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

from ...terrain import InvalidInputError
from ..network import ACTIVATIONS, Activation

Family = Literal["plain", "structured"]
FAMILIES: Final[tuple[Family, ...]] = ("plain", "structured")
Schedule = Literal["plateau", "cosine"]
SCHEDULES: Final[tuple[Schedule, ...]] = ("plateau", "cosine")


@dataclass(frozen=True)
class TrainingConfig:
    """A training recipe, stored in the artifact.

    Parameters
    ----------
    family : {"plain", "structured"}
        A network from the interface columns to the forces, or the structured one of a single track; see
        :mod:`grouser.surrogate.track_model`.
    hidden : tuple of int
        Hidden layer widths.
    activation : {"relu", "silu", "tanh"}
        Between layers.
    dropout : float
        In [0, 1).
    weight_decay : float
        L2 penalty.
    output_weights : tuple of float
        Huber weights of Qx, Qy, Mz.
    huber_delta : float
        In standard deviations; for the structured family in 2 % of the available shear.
    learning_rate : float
        Of Adam, at the start.
    schedule : {"plateau", "cosine"}
        Whether the learning rate falls where the validation loss is flat, or rises over the first tenth of all steps
        and falls by a cosine to nothing; a cosine has no use for the decay and the plateau, and a patience below the
        number of epochs cuts it short.
    learning_rate_decay : float
        What the learning rate is multiplied by after every epoch, in (0, 1]; short trainings need it.
    batch_size : int
        Samples a step.
    epochs : int
        At most.
    patience : int
        Epochs without improvement before training stops.
    plateau_patience : int
        Epochs without improvement before the learning rate falls.
    plateau_factor : float
        What it falls by.
    perturbed_copies : int
        Copies of each training row with perturbed velocities, for which the teacher is asked again; see
        :mod:`grouser.surrogate.offline.perturbation`.
    space_filling_rows : int
        Rows that fill slip space, for which the teacher is asked; see :mod:`grouser.surrogate.offline.space_filling`.
    symmetries : bool
        Whether training rows are joined by their mirror images and, where the CG is centred, their fore-aft
        reversals: the block has both symmetries exactly. A structured surrogate has the mirror image by itself.
    whiten : bool
        Whether the first layer is trained in whitened coordinates, then folded back to normalized ones. Belt speeds
        nearly follow the body, and the forces hang on the small differences, which gradients otherwise hardly see.
        The features of a structured surrogate are those differences, and are left as they are.
    seed : int
        Of split, initial weights, shuffling and dropout.

    Raises
    ------
    InvalidInputError
        If a value is impossible.
    """

    family: Family = "plain"
    hidden: tuple[int, ...] = (128, 128)
    activation: Activation = "silu"
    dropout: float = 0.0
    weight_decay: float = 0.0
    output_weights: tuple[float, float, float] = (1.0, 1.0, 3.0)
    huber_delta: float = 1.0
    learning_rate: float = 2e-3
    schedule: Schedule = "plateau"
    learning_rate_decay: float = 1.0
    batch_size: int = 1024
    epochs: int = 60
    patience: int = 20
    plateau_patience: int = 4
    plateau_factor: float = 0.5
    perturbed_copies: int = 2
    space_filling_rows: int = 0
    symmetries: bool = True
    whiten: bool = True
    seed: int = 0

    def __post_init__(self) -> None:
        positive = ("huber_delta", "learning_rate", "batch_size", "epochs", "patience", "plateau_patience")
        for name in positive:
            if not 0 < getattr(self, name) < math.inf:
                raise InvalidInputError(f"{name} must be positive and finite, got {getattr(self, name)}")
        added = ("perturbed_copies", "space_filling_rows")
        whole = ("batch_size", "epochs", "patience", "plateau_patience", *added, "seed")
        for name, value in [*((name, getattr(self, name)) for name in whole), *(("hidden", w) for w in self.hidden)]:
            if isinstance(value, bool) or not isinstance(value, int):
                raise InvalidInputError(f"{name} must be a whole number, got {value!r}")
        if not self.hidden or any(width < 1 for width in self.hidden):
            raise InvalidInputError(f"hidden needs at least one positive width, got {self.hidden}")
        if not 0 < self.learning_rate_decay <= 1:
            raise InvalidInputError(f"learning_rate_decay must lie in (0, 1], got {self.learning_rate_decay}")
        for name in added:
            if getattr(self, name) < 0:
                raise InvalidInputError(f"{name} must not be negative, got {getattr(self, name)}")
        for name, known in (("family", FAMILIES), ("schedule", SCHEDULES)):
            if getattr(self, name) not in known:
                raise InvalidInputError(f"{name} must be one of {', '.join(known)}, got {getattr(self, name)!r}")
        if self.activation not in ACTIVATIONS:
            raise InvalidInputError(f"activation must be one of {', '.join(ACTIVATIONS)}, got {self.activation!r}")
        if (
            not 0 <= self.dropout < 1
            or not 0 <= self.weight_decay < math.inf
            or not 0 < self.plateau_factor < 1
            or self.seed < 0
        ):
            raise InvalidInputError("dropout in [0, 1), plateau_factor in (0, 1), weight_decay and seed not negative")
        finite = len(self.output_weights) == 3 and all(0 <= weight < math.inf for weight in self.output_weights)
        if not finite or not any(self.output_weights):
            raise InvalidInputError(
                f"output_weights are three finite numbers of at least 0, not all 0; got {self.output_weights}"
            )
