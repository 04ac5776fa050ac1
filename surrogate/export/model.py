"""An artifact as C tables: weights, normalizers, geometry of the block and of its fallback."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...terrain import (
    GRAVITY,
    ConfigurationError,
    FloatArray,
    PhysicsBackend,
    SwitchingPolicy,
    TrackedVehicle,
    block_geometry,
)
from ..artifact import Surrogate
from ..detector import BoxMahalanobisDetector
from ..guarded import fallback_of
from ..network import DenseNetwork
from ..track_model import shear_points
from . import core
from .declarations import enumerator
from .literals import braced, double, doubles, rows, singles, struct, table

Read = Callable[[str], str]

#: Residual at which a tick counts as solved is this many resolutions of the force, and never below the second; as in
#: the simulator's tick.
_PER_RESOLUTION: Final = 8.0
_LEAST_TOLERANCE: Final = 1e-11
_ARRAYS: Final = ("weights", "biases", "transposed")


def physics_fallback(surrogate: Surrogate) -> PhysicsBackend:
    """Return the block that an artifact falls back on: its teacher.

    Raises
    ------
    ConfigurationError
        If that is no block of the C core.
    """
    fallback = fallback_of(surrogate, surrogate.vehicle)
    if not isinstance(fallback, PhysicsBackend):
        raise ConfigurationError(
            f"the export falls back on the artifact's teacher, which must be 'physics' or 'exact', "
            f"got {fallback.name!r}; train the surrogate on one of them"
        )
    return fallback


def physics_table(read: Read, fallback: PhysicsBackend) -> str:
    """Return the definition of ``physics``, the fallback's block."""
    grid = fallback.grid
    block = _block(
        read(core.PHYSICS_HEADER),
        fallback.vehicle,
        fallback.mode,
        path=grid.path,
        precision=fallback.precision,
        contact=grid.contact,
        along=grid.along,
        across=grid.across,
        soft_speed=fallback.soft_speed,
    )
    return f"static const grouser_physics physics = {block};\n"


def surrogate_tables(read: Read, surrogate: Surrogate) -> str:
    """Return the definitions of the weights and of ``surrogate``, the network with its normalizers."""
    network = surrogate.network
    parts = [_layers(network)]
    dense = _dense(read(core.DENSE_HEADER), network)
    inputs, outputs = surrogate.input_normalizer, surrogate.output_normalizer
    values = {
        "dense": dense,
        "input_mean": doubles(inputs.mean),
        "input_scale": doubles(inputs.scale),
        "output_mean": doubles(outputs.mean),
        "output_scale": doubles(outputs.scale),
        "input_gain": doubles(1.0 / inputs.scale),
    }
    if surrogate.structured:
        vehicle, points = surrogate.vehicle, shear_points(surrogate.vehicle)
        values |= {
            "block": _block(read(core.PHYSICS_HEADER), vehicle, surrogate.mode, contact=vehicle.contact),
            "ends": doubles(np.concatenate([points.starts, points.stops])),
            "reach": doubles(points.reach),
            "half_travel": double(points.half_travel),
            "part_length": double(points.length),
            **{name: rows(values) for name, values in element_arrays(vehicle).items()},
            "arm": doubles(vehicle.element_centers),
        }
        initializer = struct(read(core.STRUCTURED_HEADER), "grouser_track_net", values)
        parts.append(f"static const grouser_track_net surrogate = {initializer};\n")
    else:
        initializer = struct(read(core.PLAIN_HEADER), "grouser_mlp", values)
        parts.append(f"static const grouser_mlp surrogate = {initializer};\n")
    return "\n".join(parts)


def kernel_values(
    read: Read, surrogate: Surrogate, fallback: PhysicsBackend, policy: SwitchingPolicy
) -> dict[str, str]:
    """Return what the template of the kernels takes: both kernels, the guard between them, and the vehicle."""
    kind = "grouser_track_net" if surrogate.structured else "grouser_mlp"
    resolution = float(np.finfo(np.float32).eps)
    return {
        "kind": kind,
        "forces": f"{kind}_forces",
        "primary": _kernel(read, "surrogate"),
        "fallback": _kernel(read, "fallback", "physics"),
        "guard": _guard(read, surrogate.detector, policy),
        "vehicle": _vehicle(read(core.TICK_HEADER), surrogate.vehicle),
        "surrogate_tolerance": double(_PER_RESOLUTION * resolution),
        "fallback_tolerance": double(max(_LEAST_TOLERANCE, _PER_RESOLUTION * fallback.resolution)),
    }


def _kernel(read: Read, name: str, table: str = "") -> str:
    values = {
        "self": f"&{table or name}",
        "columns": "GROUSER_COLUMNS",
        "evaluate": f"evaluate_{name}",
        "refuses": f"{name}_refuses",
        "evaluate_track": "NULL",
        "evaluate_block": "NULL",
        "evaluate_rows": "NULL",
        "evaluate_body": "NULL",
        "prepare_block": "NULL",
        "prepared_rows": "0",
    }
    return struct(read(core.KERNEL_HEADER), "grouser_kernel", values)


def _guard(read: Read, detector: BoxMahalanobisDetector, policy: SwitchingPolicy) -> str:
    header = read(core.GUARD_HEADER)
    window = enumerator(header, core.ENTRY_WINDOW)
    if policy.entry_window > window:
        raise ConfigurationError(
            f"the C core's guard remembers {window} samples, entry_window is {policy.entry_window}"
        )
    parts = {
        "columns": "GROUSER_COLUMNS",
        "threshold": double(detector.threshold),
        "low": doubles(detector.low),
        "high": doubles(detector.high),
        "center": doubles(detector.center),
        # The core keeps it by column.
        "whitening": rows(detector.whitening.T),
        "reach": doubles(detector.reach),
        "slack": doubles(detector.slack),
    }
    switching = {
        field.name: double(value) if isinstance(value, float) else str(value)
        for field in fields(policy)
        for value in (getattr(policy, field.name),)
    }
    return struct(
        header,
        "grouser_guard",
        {
            "fallback": "&fallback",
            "detector": struct(read(core.DETECTOR_HEADER), "grouser_detector", parts),
            "policy": struct(header, "grouser_switching_policy", switching),
        },
    )


def _vehicle(header: str, vehicle: TrackedVehicle) -> str:
    names = ("mass", "yaw_inertia", "tread", "contact_center", "belt_time_constant", "belt_acceleration")
    values = {name: double(getattr(vehicle, name)) for name in names} | {"gravity": double(GRAVITY)}
    return struct(header, "grouser_vehicle", values)


def element_arrays(vehicle: TrackedVehicle) -> dict[str, FloatArray]:
    """Return what a structured surrogate's elements take of its shear points, each of shape (n, 4)."""
    points = shear_points(vehicle)
    mean, moment = points.mean.T, points.moment.T
    turning = vehicle.element_centers[:, None] * mean + vehicle.element_length / 2 * moment
    return {"mean": mean, "moment": moment, "turning": turning}


def layer_arrays(network: DenseNetwork) -> dict[str, NDArray[np.float32]]:
    """Return the arrays of a network by the names of their tables, laid out as the core reads them."""
    arrays = {}
    for layer, (weights, biases) in enumerate(zip(network.weights, network.biases, strict=True)):
        arrays[f"weights_{layer}"] = _padded(weights)
        arrays[f"biases_{layer}"] = _padded(biases[None, :])
        arrays[f"transposed_{layer}"] = _padded(weights.T)
    return arrays


def _padded(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return rows with zeros up to whole panels."""
    missing = core.padded(values.shape[1]) - values.shape[1]
    return np.pad(np.ascontiguousarray(values), ((0, 0), (0, missing)))


def _layers(network: DenseNetwork) -> str:
    return "".join(table(name, "float", singles(values), values.size) for name, values in layer_arrays(network).items())


def _dense(header: str, network: DenseNetwork) -> str:
    names = {kind: [f"{kind}_{layer}" for layer in range(len(network.weights))] for kind in _ARRAYS}
    return struct(
        header,
        "grouser_dense",
        {
            "activation": f"GROUSER_{network.activation.upper()}",
            "layers": str(len(network.weights)),
            "widths": braced([str(width) for width in network.widths]),
            "widest": str(core.padded(max(network.widths[1:]))),
            **{kind: braced(tables) for kind, tables in names.items()},
        },
    )


def _block(
    header: str,
    vehicle: TrackedVehicle,
    mode: str,
    *,
    contact: str,
    path: str = "soft",
    precision: str = "float64",
    along: int = 1,
    across: int = 1,
    soft_speed: float | None = None,
) -> str:
    values = {
        name: str(value) if isinstance(value, int) else double(value) for name, value in block_geometry(vehicle).items()
    }
    values |= {
        "mode": f"GROUSER_{mode.upper()}",
        "contact": f"GROUSER_{contact.upper()}",
        "path": f"GROUSER_{path.upper()}_PATH",
        "precision": "GROUSER_DOUBLE" if precision == "float64" else "GROUSER_SINGLE",
        "along": str(along),
        "across": str(across),
    }
    if soft_speed is not None:
        values["soft_speed"] = double(soft_speed)
    return struct(header, "grouser_physics", values)
