"""A surrogate as named tensors and JSON metadata, and back."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ..terrain import OUTPUT_NAMES, ArtifactError, ParameterRanges, TrackedVehicle, interface
from .container import Tensors
from .detector import BoxMahalanobisDetector
from .network import DenseNetwork
from .normalizer import Normalizer

if TYPE_CHECKING:
    from .artifact import Surrogate

_DETECTOR_TENSORS: Final = ("low", "high", "center", "whitening")


def encode(surrogate: Surrogate) -> tuple[Tensors, dict[str, Any]]:
    """Return the tensors, float32 weights and float64 everything else, and the metadata."""
    network, detector, ranges = surrogate.network, surrogate.detector, surrogate.ranges
    tensors: Tensors = {f"detector.{name}": getattr(detector, name) for name in _DETECTOR_TENSORS}
    for layer, (weights, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        tensors |= {f"network.{layer}.weights": weights, f"network.{layer}.biases": bias}
    for side, normalizer in (("input", surrogate.input_normalizer), ("output", surrogate.output_normalizer)):
        tensors |= {f"{side}.mean": normalizer.mean, f"{side}.scale": normalizer.scale}
    return tensors, {
        "format_version": surrogate.format_version,
        "vehicle": surrogate.vehicle.to_dict(),
        "mode": surrogate.mode,
        "inputs": list(surrogate.interface.names),
        "outputs": list(OUTPUT_NAMES),
        "feature_map": surrogate.feature_map,
        "activation": network.activation,
        "layers": len(network.weights),
        "detector": detector.summary(),
        "ranges": {"name": surrogate.range_name, "low": list(ranges.low), "high": list(ranges.high)},
        "recipe": dict(surrogate.recipe),
        "dataset_hash": surrogate.dataset_hash,
        "metrics": dict(surrogate.metrics),
    }


def decode(tensors: Tensors, metadata: dict[str, Any]) -> dict[str, Any]:
    """Return what the surrogate's constructor takes, by name.

    Raises
    ------
    KeyError
        If a tensor or a key is missing.
    ArtifactError
        If a tensor is of another type, or the columns are not the interface's.
    GrouserError
        If a part is refused by its own constructor.
    """
    table = interface(metadata["mode"])
    columns = metadata["inputs"], metadata["outputs"]
    if columns != (list(table.names), list(OUTPUT_NAMES)):
        raise ArtifactError(f"its columns are {columns[0]} and {columns[1]}, not those of the {table.mode} interface")
    layers, ranges = range(metadata["layers"]), metadata["ranges"]
    return {
        "vehicle": TrackedVehicle.from_dict(metadata["vehicle"]),
        "mode": table.mode,
        "network": DenseNetwork(
            metadata["activation"],
            tuple(_typed(tensors, f"network.{layer}.weights", np.float32) for layer in layers),
            tuple(_typed(tensors, f"network.{layer}.biases", np.float32) for layer in layers),
        ),
        "input_normalizer": _normalizer(tensors, "input"),
        "output_normalizer": _normalizer(tensors, "output"),
        "detector": BoxMahalanobisDetector(
            mode=table.mode,
            **{name: _typed(tensors, f"detector.{name}", np.float64) for name in _DETECTOR_TENSORS},
            **metadata["detector"],
        ),
        "ranges": ParameterRanges(table.mode, tuple(ranges["low"]), tuple(ranges["high"])),
        "range_name": ranges["name"],
        **{name: metadata[name] for name in ("recipe", "dataset_hash", "metrics", "feature_map", "format_version")},
    }


def _typed(tensors: Tensors, name: str, dtype: type[np.floating[Any]]) -> Any:
    array = tensors[name]
    if array.dtype != dtype:
        raise ArtifactError(f"{name} must be {np.dtype(dtype)}, got {array.dtype}")
    return array


def _normalizer(tensors: Tensors, side: str) -> Normalizer:
    return Normalizer(_typed(tensors, f"{side}.mean", np.float64), _typed(tensors, f"{side}.scale", np.float64))
