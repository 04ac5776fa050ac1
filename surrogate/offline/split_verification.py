"""Whether a split leaks: runs or rows that are on two sides, and maneuvers that a side lacks."""

from __future__ import annotations

from collections import Counter
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...terrain import InvalidInputError
from .dataset import Dataset
from .finding import Finding, counted, refused
from .split import RunSplit, split_runs

#: Largest ratio of the runs of two maneuvers; they take turns, so that it is near 1.
BALANCE_LIMIT: Final = 2.0
#: Runs that train, validation and test need of each maneuver, one each.
FEWEST_RUNS: Final = 3


def verify_balance(dataset: Dataset) -> list[Finding]:
    """Return whether every maneuver has enough runs, and about as many as the others."""
    counts = Counter(record.maneuver for record in dataset.records)
    short = [f"{name} has {count}" for name, count in sorted(counts.items()) if count < FEWEST_RUNS]
    listed = ", ".join(f"{name} {count}" for name, count in sorted(counts.items()))
    ratio = max(counts.values()) / min(counts.values())
    return [
        counted("at least 3 runs a maneuver", "run table", short, "maneuvers"),
        Finding("balance of maneuvers", "run table", ratio, BALANCE_LIMIT, "most / fewest", listed),
    ]


def verify_default_split(dataset: Dataset) -> list[Finding]:
    """Return whether the split of seed 0 can be made, and what :func:`verify_split` says of it."""
    try:
        split = split_runs(dataset.records)
    except InvalidInputError as error:
        return [refused("split by run", "seed 0", error)]
    return verify_split(dataset, split, "split of seed 0")


def verify_split(dataset: Dataset, split: RunSplit, subject: str) -> list[Finding]:
    """Return whether sides are disjoint, whole, without a common row, and have every maneuver.

    Parameters
    ----------
    dataset : Dataset
        What is split.
    split : RunSplit
        Runs by side.
    subject : str
        What the findings call the split.
    """
    sides = split.to_dict()
    times = Counter(run for side in sides.values() for run in side)
    known = {record.run for record in dataset.records}
    maneuvers = {record.run: record.maneuver for record in dataset.records}
    missing = [
        f"{maneuver} in {side}"
        for maneuver in sorted(set(maneuvers.values()))
        for side, runs in sides.items()
        if maneuver not in {maneuvers.get(run) for run in runs}
    ]
    return [
        counted("run on two sides", subject, sorted(run for run, count in times.items() if count > 1), "runs"),
        counted("run on no side, or unknown", subject, sorted(known ^ set(times)), "runs"),
        counted("row on two sides", subject, _shared_rows(dataset, sides), "rows"),
        counted("maneuver missing from a side", subject, missing, "sides"),
    ]


def identical_runs(dataset: Dataset) -> Finding:
    """Return whether two runs hold the same rows, whatever their sides."""
    first: dict[bytes, int] = {}
    pairs = []
    for record in dataset.records:
        content = np.ascontiguousarray(dataset.inputs[dataset.run_index == record.run]).tobytes()
        before = first.setdefault(content, record.run)
        if before != record.run:
            pairs.append(f"{record.run} is {before}")
    return counted("identical runs", "samples", pairs, "runs")


def _shared_rows(dataset: Dataset, sides: dict[str, list[int]]) -> list[str]:
    rows = np.ascontiguousarray(dataset.inputs)
    keys = rows.view(f"V{rows.itemsize * rows.shape[1]}").ravel()
    _, first, group = np.unique(keys, return_index=True, return_inverse=True)
    present = np.zeros((len(first), len(sides)), dtype=bool)
    for index, runs in enumerate(sides.values()):
        present[group[np.isin(dataset.run_index, runs)], index] = True
    shared: NDArray[np.intp] = np.sort(first[present.sum(axis=1) > 1])
    return [f"row {row} of run {dataset.run_index[row]}" for row in shared]
