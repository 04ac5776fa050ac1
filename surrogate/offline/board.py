"""A training's curves on TensorBoard."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Any, Self

from ...terrain import missing_extra
from .training import EpochReport


class Board:
    """Writes losses and learning rate of every epoch; a context manager.

    Parameters
    ----------
    folder : Path
        Gets the event file.

    Raises
    ------
    ConfigurationError
        If TensorBoard is not installed.
    """

    def __init__(self, folder: Path) -> None:
        try:
            from torch.utils.tensorboard import SummaryWriter
        except ImportError as error:
            raise missing_extra("tensorboard", "torch") from error
        self._writer: Any = SummaryWriter(str(folder))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._writer.close()

    def __call__(self, epoch: EpochReport) -> None:
        """Add one epoch."""
        self._writer.add_scalar("loss/train", epoch.train_loss, epoch.epoch)
        self._writer.add_scalar("loss/validation", epoch.validation_loss, epoch.epoch)
        self._writer.add_scalar("learning rate", epoch.learning_rate, epoch.epoch)
