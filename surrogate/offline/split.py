"""Split a dataset by run, so that no time step of a run is on two sides."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...terrain import InvalidInputError
from .manifest import RunRecord


@dataclass(frozen=True)
class RunSplit:
    """Runs by side; sides are disjoint.

    Parameters
    ----------
    train, validation, test : tuple of int
        Run indices, sorted.
    """

    train: tuple[int, ...]
    validation: tuple[int, ...]
    test: tuple[int, ...]

    def to_dict(self) -> dict[str, list[int]]:
        """Return the sides as JSON can hold them."""
        return {"train": list(self.train), "validation": list(self.validation), "test": list(self.test)}


def split_runs(
    records: Sequence[RunRecord], *, seed: int = 0, validation: float = 0.15, test: float = 0.15
) -> RunSplit:
    """Split runs at random, maneuver by maneuver, so that each side has every maneuver.

    Parameters
    ----------
    records : sequence of RunRecord
        The run table.
    seed : int
        Of the shuffle.
    validation, test : float
        Shares of each maneuver's runs, at least one run each.

    Raises
    ------
    InvalidInputError
        If there is no run, the shares leave no training data, or a maneuver has fewer than three runs.
    """
    if not (0 < validation < 1 and 0 < test < 1 and validation + test < 1):
        raise InvalidInputError(f"validation and test shares must be in (0, 1) and sum below 1: {validation}, {test}")
    if not records:
        raise InvalidInputError("there are no runs to split")
    generator = np.random.default_rng((seed, len(records)))
    sides: dict[str, list[int]] = {"train": [], "validation": [], "test": []}
    due = {"test": 0.0, "validation": 0.0}
    for maneuver in sorted({record.maneuver for record in records}):
        runs = np.array(sorted(record.run for record in records if record.maneuver == maneuver))
        if len(runs) < 3:
            raise InvalidInputError(
                f"maneuver {maneuver!r} has {len(runs)} runs; train, validation and test need one each"
            )
        rest = generator.permutation(runs).tolist()
        for side, share in (("test", test), ("validation", validation)):
            # What rounding keeps from one maneuver is owed to the next, so that the sides have their shares in all.
            due[side] += share * len(runs)
            spare = len(rest) - (2 if side == "test" else 1)
            count = min(max(1, math.floor(due[side] + 0.5)), spare)
            due[side] -= count
            sides[side] += rest[:count]
            rest = rest[count:]
        sides["train"] += rest
    return RunSplit(**{name: tuple(sorted(side)) for name, side in sides.items()})
