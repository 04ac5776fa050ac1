"""What ``info`` tells of a step beside the task's own: what an episode drew, the last tick's forces, and the guard."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from ..terrain import ForceBackend, GuardedBackend, GuardMode, Mode
from .footing import track_forces_on
from .simulator import TickRecord
from .surroundings import drawn_names


def drawn_info(mode: Mode, drawn: Iterable[float] | None) -> dict[str, Any]:
    """Return what ``info`` tells of what an episode drew, where anything is randomized."""
    return {} if drawn is None else {"randomization": dict(zip(drawn_names(mode), drawn, strict=True))}


def force_info(backend: ForceBackend, record: TickRecord) -> dict[str, Any]:
    """Return what ``info`` tells of the last tick's forces, and of the guard where there is one."""
    info: dict[str, Any] = {"force": record.forces.copy(), "backend": backend.name}
    if backend.has_track_forces:
        shear = track_forces_on(record.footing, backend, record.row, rolling=False)
        info |= {
            "track_forces": track_forces_on(record.footing, backend, record.row),
            "sprocket_power": float(record.row[5:7] @ shear[:, 0]),
        }
    return info | guard_info(backend, record)


def guard_info(backend: ForceBackend, record: TickRecord) -> dict[str, Any]:
    """Return what ``info`` tells of the guard in the last tick, where there is one."""
    if not isinstance(backend, GuardedBackend) or record.detection is None:
        return {}
    guard = record.state.guard
    active = backend.primary if guard.mode is GuardMode.PRIMARY else backend.fallback
    return {"backend": active.name, "ood_score": record.detection.score, "fallback_weight": guard.fallback_weight}
