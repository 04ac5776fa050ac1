"""The self-test of an export: golden vectors as C tables, and the checksum of everything else."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...terrain import PhysicsBackend, SwitchingPolicy
from ..artifact import Surrogate
from . import golden
from .checksum import Checksum
from .literals import braced, double, doubles, table
from .model import element_arrays, layer_arrays

#: Shares of the largest training speed that the self-test drives at, right belt; the left one is a tenth slower.
_CURVE, _FAST, _SLOW = 0.4, 1.3, 0.5


def self_test_values(surrogate: Surrogate, fallback: PhysicsBackend, policy: SwitchingPolicy) -> dict[str, str]:
    """Return what the template of the self-test takes."""
    rows = golden.golden_rows(surrogate, fallback)
    drive = golden.golden_drive(surrogate, fallback, policy, rows)
    terms, checksum = _checksum(surrogate)
    vehicle = surrogate.vehicle
    cruise, fast = vehicle.training_speed, min(_FAST * vehicle.training_speed, vehicle.maximum_speed)
    middle = (np.array(surrogate.ranges.low) + np.array(surrogate.ranges.high)) / 2
    tables: dict[str, NDArray[Any]] = {
        "rows": rows.x,
        "surrogate": rows.surrogate,
        "surrogate_jacobian": rows.surrogate_jacobian,
        "surrogate_scale": rows.surrogate_scale,
        "fallback": rows.physics,
        "fallback_jacobian": rows.physics_jacobian,
        "fallback_scale": rows.physics_scale,
        "scores": rows.score,
        "weights": drive.weight,
        "drive_forces": drive.forces,
    }
    sizes = {"ROWS": len(rows.x), "JACOBIANS": len(rows.surrogate_jacobian), "DRIVE": len(drive.index)}
    return {
        "tables": "enum { "
        + ", ".join(f"GOLDEN_{name} = {size}" for name, size in sizes.items())
        + " };\n"
        + "".join(table(f"golden_{name}", "double", doubles(values), values.size) for name, values in tables.items())
        + _whole("drive", drive.index)
        + _whole("modes", drive.fallback),
        "checksum_terms": "\n".join(f"  {term}" for term in terms),
        "checksum": str(checksum),
        "elapsed": double(golden.ELAPSED),
        "surrogate_share": double(golden.SURROGATE_TOLERANCE),
        "fallback_share": double(_fallback_share(fallback)),
        "jacobian_share": double(golden.JACOBIAN_TOLERANCE),
        "score_share": double(golden.SCORE_TOLERANCE),
        "curve": _command(_CURVE * cruise),
        "fast": _command(fast),
        "slow": _command(_SLOW * cruise),
        "cruise": double(cruise),
        # A drive that can go no faster than in training cannot leave the box this way.
        "leaves": str(int(fast > 1.1 * cruise)),
        "terrain": doubles(middle),
    }


def _fallback_share(fallback: PhysicsBackend) -> float:
    return golden.PHYSICS_TOLERANCE if fallback.precision == "float64" else golden.SURROGATE_TOLERANCE


def _command(speed: float) -> str:
    return braced([double(0.9 * speed), double(speed)])


def _whole(name: str, values: NDArray[np.int64]) -> str:
    return table(f"golden_{name}", "int", braced([str(value) for value in values.tolist()]), values.size)


def _checksum(surrogate: Surrogate) -> tuple[list[str], int]:
    """Return the C statements that take in every table that was learned or fitted, and what they come to."""
    network, detector = surrogate.network, surrogate.detector
    named: list[tuple[str, NDArray[Any]]] = list(layer_arrays(network).items())
    for side, normalizer in (("input", surrogate.input_normalizer), ("output", surrogate.output_normalizer)):
        named += [(f"surrogate.{side}_mean", normalizer.mean), (f"surrogate.{side}_scale", normalizer.scale)]
    if surrogate.structured:
        for name, values in element_arrays(surrogate.vehicle).items():
            named += [(f"surrogate.{name}[{i}]", row) for i, row in enumerate(values)]
    named += [
        (f"guard.detector.{name}", getattr(detector, name)) for name in ("low", "high", "center", "reach", "slack")
    ]
    named += [
        (f"guard.detector.whitening[{index}]", np.ascontiguousarray(column))
        for index, column in enumerate(detector.whitening.T)
    ]
    checksum, terms = Checksum(), []
    for name, values in named:
        checksum.add(values)
        kind = "floats" if values.dtype == np.float32 else "doubles"
        terms.append(f"sum = add_{kind}(sum, {name}, {values.size});")
    return terms, checksum.value
