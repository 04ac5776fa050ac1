"""What an interrupted training needs to go on to the same weights, kept as safetensors: no pickle to trust."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...terrain import ArtifactError


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
    """Write module, optimizer and state, aside and renamed."""
    from safetensors.torch import save_file

    tensors = {f"module.{name}": value for name, value in module.state_dict().items()}
    tensors |= {f"best.{name}": value for name, value in state.best_parameters.items()}
    for index, entry in optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer.{index}.{name}": value for name, value in entry.items()}
    progress = {name: getattr(state, name) for name in ("rate", "epoch", "stale", "flat", "best_loss")}
    path.parent.mkdir(parents=True, exist_ok=True)
    aside = path.with_name(path.name + ".part")
    save_file(
        {name: value.contiguous() for name, value in tensors.items()},
        aside,
        metadata={"identity": _digest(identity), "progress": json.dumps(progress)},
    )
    os.replace(aside, path)


def load_checkpoint(path: Path, module: Any, optimizer: Any, identity: Mapping[str, Any]) -> TrainingState | None:
    """Restore module and optimizer from a checkpoint, if there is one.

    Raises
    ------
    ArtifactError
        If it is unreadable or belongs to another training.
    """
    if not path.exists():
        return None
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - not a mapping
        progress = json.loads(metadata["progress"])
    except (SafetensorError, OSError, KeyError, ValueError) as error:
        raise ArtifactError(f"{path} is not a training checkpoint; remove it to start anew: {error}") from error
    if metadata.get("identity") != _digest(identity):
        raise ArtifactError(
            f"{path} is of another dataset or recipe; remove it to start anew, or choose another output"
        )
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


def _digest(identity: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()
