"""Several datasets as one, for training."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from ...terrain import ConfigurationError, InvalidInputError
from .dataset import Dataset

#: Between the content hashes of the parts.
HASH_SEPARATOR: Final = "+"


def join_datasets(datasets: Sequence[Dataset]) -> Dataset:
    """Return datasets of one block as one, their runs numbered on from the first's.

    Tick, integrator, transient and samples a run may differ: they say how states were visited, not what the block
    answers there. The manifest keeps the first one's; its content hash is the parts' hashes with ``+`` between.

    Parameters
    ----------
    datasets : sequence of Dataset
        At least one.

    Raises
    ------
    InvalidInputError
        If there is none, or one comes twice.
    ConfigurationError
        If vehicle, mode, ranges or teacher differ.
    """
    if not datasets:
        raise InvalidInputError("there are no datasets to join")
    first = datasets[0]
    if len(datasets) == 1:
        return first
    hashes = [dataset.manifest.content_hash for dataset in datasets]
    if len(set(hashes)) < len(hashes):
        raise InvalidInputError("a dataset comes twice: its runs would fall on two sides of the split")
    for other in datasets[1:]:
        same = {
            "vehicle": other.vehicle == first.vehicle,
            "mode": other.manifest.mode == first.manifest.mode,
            "ranges": other.manifest.ranges == first.manifest.ranges,
            # The teacher is asked again beside the rows, and there can be only one.
            "teacher": dict(other.manifest.backend) == dict(first.manifest.backend),
        }
        different = [name for name, alike in same.items() if not alike]
        if different:
            raise ConfigurationError(f"datasets that are joined have one {' and one '.join(different)}; these differ")
    offsets = np.cumsum([0] + [1 + max(record.run for record in dataset.records) for dataset in datasets])
    records = [
        replace(record, run=record.run + int(offset))
        for dataset, offset in zip(datasets, offsets, strict=False)
        for record in dataset.records
    ]
    return Dataset(
        replace(first.manifest, runs=len(records), content_hash=HASH_SEPARATOR.join(hashes)),
        tuple(records),
        np.concatenate([dataset.inputs for dataset in datasets]),
        np.concatenate([dataset.forces for dataset in datasets]),
        np.concatenate([dataset.run_index + offset for dataset, offset in zip(datasets, offsets, strict=False)]),
    )
