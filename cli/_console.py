"""Where text goes: results on stdout, progress and errors on stderr."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from types import TracebackType
from typing import Final, Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

# A pipe has no width of its own, and 80 columns would wrap the tables that someone wants to keep.
_PIPE_WIDTH: Final = None if sys.stdout.isatty() else 132

out: Final = Console(width=_PIPE_WIDTH, highlight=False)
err: Final = Console(stderr=True, highlight=False)


def print_facts(facts: Mapping[str, object]) -> None:
    """Print labelled values, one a line, never wrapped: a hash or a path is there to be copied."""
    width = max(map(len, facts))
    for label, value in facts.items():
        out.print(f"{label:<{width}}  {value}", soft_wrap=True, markup=False)


class StageBars:
    """Progress of named stages: one bar a stage on a terminal, one line a stage elsewhere."""

    def __init__(self) -> None:
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.fields[note]}"),
            console=err,
            disable=not err.is_terminal,
        )
        self._tasks: dict[str, TaskID] = {}
        self._finished: set[str] = set()

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._progress.stop()

    def __call__(self, stage: str, done: int, total: int, note: str = "") -> None:
        """Say how far a stage is.

        Parameters
        ----------
        stage : str
            Its name.
        done, total : int
            In whatever it counts.
        note : str
            Shown behind the bar.
        """
        if self._progress.disable:
            if (note or done >= total) and stage not in self._finished:
                err.print(f"{stage}: {done}/{total} {note}".rstrip(), soft_wrap=True, markup=False)
        else:
            if stage not in self._tasks:
                self._tasks[stage] = self._progress.add_task(stage, total=total, note="")
            self._progress.update(self._tasks[stage], completed=done, total=total, note=note)
        if done >= total:
            self._finished.add(stage)
