"""What a vector environment tells of its sub-environments: arrays by name, each with a mask of who has it.

The layout is that of :class:`gymnasium.vector.SyncVectorEnv`, filled by whole arrays.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..terrain import GuardedBackend
from .batch import Batch
from .footing import sloped_track_forces
from .task import ConfigT, EpisodeT

VectorInfo = dict[str, Any]
_Flags = NDArray[np.bool_]


def reset_info(batch: Batch[ConfigT, EpisodeT], begun: _Flags) -> VectorInfo:
    """Return the infos of resets where ``begun`` holds."""
    info = _measures(batch, begun)
    randomized = begun & batch.randomized
    if randomized.any():
        drawn: VectorInfo = {}
        for name, values in zip(batch.task.drawn_names, batch.drawn.T, strict=True):
            _put(drawn, name, values, randomized)
        info |= {"randomization": drawn, "_randomization": randomized}
    return info


def batch_info(batch: Batch[ConfigT, EpisodeT], stepped: _Flags, *, track_forces: bool = False) -> VectorInfo:
    """Return the infos of a step where ``stepped`` holds, what acts on each track among them where asked for."""
    fleet = batch.fleet
    info = _measures(batch, stepped)
    moved = stepped
    for name, lost in (("diverged", fleet.diverged), ("off_map", fleet.off_map)):
        lost &= stepped
        if lost.any():
            info |= {name: lost, f"_{name}": lost.copy()}
            moved = moved & ~lost
    if not moved.any():
        return info
    _put(info, "force", fleet.record.forces, moved)
    if track_forces:
        info |= _track_info(batch, moved)
    names = batch.backend_names.copy()
    if isinstance(fleet.backend, GuardedBackend):
        names[fleet.on_fallback] = fleet.backend.fallback.name
        _put(info, "ood_score", fleet.record.score, moved)
        _put(info, "fallback_weight", fleet.fallback_weight, moved)
    names[~moved] = None
    info |= {"backend": names, "_backend": moved.copy()}
    terms: VectorInfo = {}
    for name, values in zip(batch.term_names, batch.terms.T, strict=True):
        _put(terms, name, values, moved)
    return info | {"reward_terms": terms, "_reward_terms": moved.copy()}


def _track_info(batch: Batch[ConfigT, EpisodeT], moved: _Flags) -> VectorInfo:
    """The force block once more, and without rolling resistance: the engine keeps the sum over the tracks alone."""
    backend, records = batch.fleet.backend, [batch.record(index) for index in np.flatnonzero(moved).tolist()]
    left = np.array([record.row for record in records])
    right = np.array([record.footing.right_row(record.row) for record in records])
    ratio = np.array([record.footing.gravity.load_ratio for record in records])
    forces, power = np.zeros((len(batch), 2, 3)), np.zeros(len(batch))
    forces[moved] = sloped_track_forces(backend, left, right, ratio, rolling=True)
    shear = sloped_track_forces(backend, left, right, ratio, rolling=False)
    # Row by row: a product over all rows would round otherwise than a single environment's.
    power[moved] = [row[5:7] @ tracks[:, 0] for row, tracks in zip(left, shear, strict=True)]
    info: VectorInfo = {}
    _put(info, "track_forces", forces, moved)
    _put(info, "sprocket_power", power, moved)
    return info


def _measures(batch: Batch[ConfigT, EpisodeT], mask: _Flags) -> VectorInfo:
    info: VectorInfo = {}
    for name, values in zip(batch.task.measures, batch.measures.T, strict=True):
        _put(info, name, values, mask)
    return info


def merged(info: VectorInfo, other: VectorInfo) -> VectorInfo:
    """Return the infos of two disjoint sets of sub-environments as one."""
    both = info | other
    for name in info.keys() & other.keys():
        if not name.startswith("_"):
            mask = other[f"_{name}"]
            both[name] = np.where(mask, other[name], info[name])
            both[f"_{name}"] = mask | info[f"_{name}"]
    return both


def _put(info: VectorInfo, name: str, values: NDArray[Any], mask: _Flags) -> None:
    """Add a copy of the values, zero where the mask does not hold."""
    copy = np.array(values, order="C")
    if np.count_nonzero(mask) < len(mask):
        copy[~mask] = 0
    info[name], info[f"_{name}"] = copy, mask.copy()
