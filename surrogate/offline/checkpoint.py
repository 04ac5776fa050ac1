"""What an interrupted training needs to go on to the same weights, kept as safetensors: no pickle to trust."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from ...terrain import ArtifactError, write_aside
from ..container import pack, unpack

FORMAT_VERSION: Final = 1
_PROGRESS: Final = ("rate", "epoch", "stale", "flat", "best_loss")


@dataclass(frozen=True, eq=False)
class TrainingState:
    """Where a training stands between two epochs.

    Parameters
    ----------
    rate : float
        Learning rate of the next epoch.
    epoch : int
        Epochs done.
    stale : int
        Epochs since the validation loss improved.
    flat : int
        Epochs since it improved or the learning rate fell.
    best_loss : float
        Lowest validation loss.
    best_parameters : dict
        The module's parameters at that loss.
    """

    rate: float
    epoch: int = 0
    stale: int = 0
    flat: int = 0
    best_loss: float = math.inf
    best_parameters: Mapping[str, Any] = field(default_factory=dict)

    def after(
        self, loss: float, module: Any, *, plateau_patience: int, plateau_factor: float, decay: float
    ) -> TrainingState:
        """Return the state after one more epoch with this validation loss.

        Raises
        ------
        ArtifactError
            If the first epoch's loss is already not finite.
        """
        if loss < self.best_loss:
            best = {name: value.detach().clone() for name, value in module.state_dict().items()}
            return TrainingState(self.rate * decay, self.epoch + 1, 0, 0, loss, best)
        if not self.best_parameters:
            raise ArtifactError(f"training diverged in its first epoch (validation loss {loss}); lower learning_rate")
        falls = self.flat + 1 >= plateau_patience
        rate = self.rate * decay * (plateau_factor if falls else 1.0)
        flat = 0 if falls else self.flat + 1
        return TrainingState(rate, self.epoch + 1, self.stale + 1, flat, self.best_loss, self.best_parameters)


def save_checkpoint(path: Path, state: TrainingState, module: Any, optimizer: Any, identity: Mapping[str, Any]) -> None:
    """Write module, optimizer and state as one sealed file, aside and renamed."""
    tensors = {f"module.{name}": value for name, value in module.state_dict().items()}
    tensors |= {f"best.{name}": value for name, value in state.best_parameters.items()}
    for index, entry in optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer.{index}.{name}": value for name, value in entry.items()}
    progress = {name: getattr(state, name) for name in _PROGRESS}
    metadata = {"format_version": FORMAT_VERSION, "identity": dict(identity), "progress": progress}
    write_aside(path, pack({name: value.numpy() for name, value in tensors.items()}, metadata))


def load_checkpoint(path: Path, module: Any, optimizer: Any, identity: Mapping[str, Any]) -> TrainingState | None:
    """Restore module and optimizer from a checkpoint, if there is one.

    Raises
    ------
    ArtifactError
        If it is truncated or altered, or belongs to another training.
    """
    if not path.exists():
        return None
    import torch

    try:
        arrays, metadata = unpack(path.read_bytes(), str(path), FORMAT_VERSION)
        progress = metadata["progress"]
        if set(progress) != set(_PROGRESS):
            raise ArtifactError(f"its progress holds {sorted(progress)}, not {sorted(_PROGRESS)}")
    except (ArtifactError, KeyError, TypeError) as error:
        raise ArtifactError(f"{path} is not a training checkpoint; remove it to start anew: {error}") from error
    # The JSON round trip makes lists of tuples, on both sides.
    if metadata.get("identity") != json.loads(json.dumps(identity)):
        raise ArtifactError(
            f"{path} is of another dataset or recipe; remove it to start anew, or choose another output"
        )
    tensors = {name: torch.from_numpy(array.copy()) for name, array in arrays.items()}
    groups: dict[str, dict[str, Any]] = {"module": {}, "best": {}}
    moments: dict[int, dict[str, Any]] = {}
    for name, value in tensors.items():
        kind, _, rest = name.partition(".")
        if kind == "optimizer":
            index, _, key = rest.partition(".")
            moments.setdefault(int(index), {})[key] = value
        else:
            groups[kind][rest] = value
    module.load_state_dict(groups["module"])
    optimizer.load_state_dict(optimizer.state_dict() | {"state": moments})
    return TrainingState(**progress, best_parameters=groups["best"])
