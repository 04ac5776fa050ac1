"""Whether an artifact is whole, computes alike everywhere, and keeps the block's laws."""

from __future__ import annotations

import os
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Final

import numpy as np

from ...terrain import (
    MOTION_SIZE,
    ArtifactError,
    ConfigurationError,
    FloatArray,
    ForceBackend,
    GrouserError,
    interface,
    mirror_forces,
)
from ..artifact import FORMAT_VERSION, SUFFIX, Surrogate, shipped_names
from ..backends import NativeSurrogate, TorchSurrogate
from ..container import Tensors, unpack
from ..detector import BoxMahalanobisDetector
from ..network import torch_network
from ..threads import torch_threads
from .finding import Finding, counted, refused

#: Largest difference of forces from the NumPy float64 evaluation, in standard deviations of the output.
PARITY_LIMIT: Final = 1e-5
#: The same of the Jacobian, each column times the standard deviation of its input.
JACOBIAN_LIMIT: Final = 1e-3
_ROWS: Final = 256
# From the middle of the box, in half widths: well beyond the slack at its edge.
_BEYOND: Final = 1.01


def read_artifact(artifact: str | os.PathLike[str]) -> tuple[list[Finding], Surrogate | None]:
    """Return the findings on an artifact's file, and the surrogate if there is one in it.

    Parameters
    ----------
    artifact : str or path-like
        File, or one of :func:`grouser.surrogate.shipped_names`.
    """
    name = os.fspath(artifact)
    try:
        tensors, _ = unpack(_bytes(name), name, FORMAT_VERSION)
    except ArtifactError as error:
        return [refused("whole and sealed", "file", error)], None
    findings = [Finding("whole and sealed", "file", 0.0, 0.0, "1"), *_tensor_findings(tensors)]
    try:
        surrogate = Surrogate.load(artifact)
    except GrouserError as error:
        return [*findings, refused("sizes and parts fit together", "file", error)], None
    sizes = f"{'-'.join(map(str, surrogate.network.widths))}, {surrogate.network.parameter_count} parameters"
    return [*findings, Finding("sizes and parts fit together", "file", 0.0, 0.0, "1", sizes)], surrogate


def _bytes(name: str) -> bytes:
    if name in shipped_names():
        return files("grouser.surrogate").joinpath("artifacts", name + SUFFIX).read_bytes()
    try:
        return Path(name).read_bytes()
    except OSError as error:
        raise ArtifactError(f"cannot read artifact {name!r}: {error.strerror}") from error


def _tensor_findings(tensors: Tensors) -> list[Finding]:
    broken = sorted(name for name, tensor in tensors.items() if not np.isfinite(tensor).all())
    scales = {name: tensor for name, tensor in tensors.items() if name.endswith(".scale")}
    flat = sorted(name for name, scale in scales.items() if not (scale > 0).all())
    return [
        counted("finite weights and scales", "tensors", broken, "tensors"),
        counted("positive scales", "normalizers", flat, "normalizers"),
    ]


def verify_behaviour(surrogate: Surrogate) -> list[Finding]:
    """Return whether torch and native evaluate the artifact alike, and whether it keeps the block's laws.

    Raises
    ------
    ConfigurationError
        If torch is not installed.
    """
    rows = rows_inside(surrogate.detector)
    with torch_threads(1):
        return [*_parity(surrogate, rows), *_laws(surrogate, rows), *_detector(surrogate.detector)]


def rows_inside(detector: BoxMahalanobisDetector) -> FloatArray:
    """Draw rows inside a detector's box as far from its centre as it allows, shape (256, d)."""
    generator = np.random.default_rng(0)
    directions = generator.standard_normal((_ROWS, len(detector.center)))
    reach = detector.threshold * generator.random((_ROWS, 1)) / np.linalg.norm(directions, axis=1, keepdims=True)
    rows = detector.center + (reach * directions) @ np.linalg.pinv(detector.whitening).T
    inside: FloatArray = np.clip(rows, detector.low, detector.high)
    return inside


def _parity(surrogate: Surrogate, rows: FloatArray) -> Iterator[Finding]:
    expected, slopes = surrogate.reference_forces(rows), _reference_jacobian(surrogate, rows)
    spread = _spread(expected)
    forces_check, jacobian_check = "forces against NumPy float64", "Jacobian against float64"
    for kind in (NativeSurrogate, TorchSurrogate):
        try:
            backend = kind(surrogate.vehicle, surrogate.mode, surrogate)
        except ConfigurationError as error:
            # A network that C cannot hold: torch remains.
            yield refused(forces_check, kind.name, error, limit=None, unit="σ")
            continue
        alone = backend.forces(rows)
        beside, jacobian = backend.forces_and_jacobian(rows)
        # Forces with and without their Jacobian come from different code.
        error_of_forces = np.maximum(np.abs(alone - expected), np.abs(beside - expected)) / spread
        error_of_slopes = np.abs(jacobian - slopes) * rows.std(axis=0) / spread[:, None]
        yield Finding(forces_check, kind.name, float(error_of_forces.max()), PARITY_LIMIT, "σ")
        yield Finding(jacobian_check, kind.name, float(error_of_slopes.max()), JACOBIAN_LIMIT, "σ")


def _reference_jacobian(surrogate: Surrogate, rows: FloatArray) -> FloatArray:
    """Return ∂Q/∂x of the float64 evaluation, shape (n, 3, d)."""
    import torch

    inputs = torch.tensor(rows, requires_grad=True)
    outputs = surrogate.evaluate(torch_network(), inputs)
    parts = [torch.autograd.grad(outputs[:, i].sum(), inputs, retain_graph=True)[0].numpy() for i in range(3)]
    jacobian: FloatArray = np.stack(parts, axis=1)
    return jacobian


def _laws(surrogate: Surrogate, rows: FloatArray) -> list[Finding]:
    """Return the block's mirror symmetry and its silence at rest: laws of a structured surrogate, told of a plain one."""
    limit = 0.0 if surrogate.structured else None
    resting = (surrogate.detector.low + surrogate.detector.high) / 2
    resting[:MOTION_SIZE] = 0.0
    try:
        backend: ForceBackend = NativeSurrogate(surrogate.vehicle, surrogate.mode, surrogate)
    except ConfigurationError as error:
        return [refused(check, "native", error, limit=None, unit="σ") for check in ("mirror symmetry", "force at rest")]
    forces = backend.forces(rows)
    mirrored = mirror_forces(backend.forces(surrogate.interface.mirror(rows)))
    spread = _spread(forces)
    values = ", ".join(f"{value:.3g}" for value in backend.forces(resting))
    return [
        Finding("mirror symmetry", "native", float(np.max(np.abs(mirrored - forces) / spread)), limit, "σ"),
        Finding(
            "force at rest",
            "native",
            float(np.max(np.abs(backend.forces(resting)) / spread)),
            limit,
            "σ",
            f"{values} N, N, N m",
        ),
    ]


def _detector(detector: BoxMahalanobisDetector) -> list[Finding]:
    """Return whether the detector accepts the middle of its box, and refuses what lies beyond a side or is NaN."""
    names = interface(detector.mode).names
    middle, half = (detector.low + detector.high) / 2, (detector.high - detector.low) / 2
    side = np.where(half > 0, half, np.where(middle != 0, np.abs(middle), 1.0)) * np.eye(len(middle))
    rows = [middle + _BEYOND * side, middle - _BEYOND * side, np.where(side > 0, np.nan, middle)]
    score = detector.score(np.concatenate(rows))
    accepted = [names[row % len(names)] for row in np.flatnonzero(score <= 1.0).tolist()]
    return [
        Finding("score in the middle of the box", "detector", float(detector.score(middle)[0]), 1.0, "1"),
        counted("accepted outside the box, or not finite", "detector", accepted, "rows"),
    ]


def _spread(forces: FloatArray) -> FloatArray:
    """Return the standard deviation of each output; 1 where it is 0."""
    spread: FloatArray = forces.std(axis=0)
    return np.where(spread > 0, spread, 1.0)
