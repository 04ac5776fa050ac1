"""Figures of a drive, from its log."""

from __future__ import annotations

from time import perf_counter
from typing import Final

import numpy as np

from ..envs import InterfaceLog, Path
from ..surrogate.offline.metrics import output_metrics
from ..terrain import FloatArray, ForceBackend, TrackedVehicle

_TIMED_CALLS: Final = 400
_NOISE_SHARE: Final = 1e-6


def force_noise(vehicle: TrackedVehicle) -> tuple[float, float, float]:
    """Return the spreads of Qx, Qy, Mz up to which they are round-off: a straight drive has no Qy to explain."""
    force = _NOISE_SHARE * vehicle.weight
    return force, force, force * vehicle.contact_length / 4


def force_r2(forces: FloatArray, truth: FloatArray, noise: float) -> float | None:
    """Return R² of forces against the truth, both (n,); None where there is none or the truth varies by noise alone."""
    return output_metrics(forces, truth, noise=noise).r2 if len(truth) else None


def rms_over(differences: FloatArray, scale: float) -> float | None:
    """Return the root mean square of the norms of differences, shape (n, 2), over a scale; None where there are none."""
    return float(np.sqrt(np.mean(np.sum(differences**2, axis=1))) / scale) if len(differences) else None


def corridor_violation(path: Path, vehicle: TrackedVehicle, log: InterfaceLog) -> float | None:
    """Return the largest distance in m of a corner of the footprint beyond its lane; None without a corridor."""
    if path.corridor is None:
        return None
    x, y, heading = (log.state(name) for name in ("x", "y", "heading"))
    return float(path.corridor.violations(x, y, heading, vehicle.contact_length, vehicle.overall_width).max())


def force_call_ns(backend: ForceBackend, inputs: FloatArray) -> float | None:
    """Return the median time of one force call from Python in ns, over rows of ``inputs`` (n, d); None without rows."""
    if not len(inputs):
        return None
    rows = inputs[:: max(1, len(inputs) // _TIMED_CALLS)]
    times = []
    for row in rows:
        began = perf_counter()
        backend.forces(row)
        times.append(perf_counter() - began)
    return float(np.median(times) * 1e9)
