"""One surrogate in one ``.safetensors`` file: weights, normalizers, detector, and where they come from."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

import numpy as np

from ..terrain import (
    OUTPUT_NAMES,
    ArtifactError,
    FloatArray,
    GrouserError,
    Interface,
    InvalidInputError,
    Mode,
    ParameterRanges,
    TrackedVehicle,
    interface,
    write_aside,
)
from .codec import decode, encode
from .container import content_hash, pack, unpack
from .detector import BoxMahalanobisDetector
from .network import NUMPY_NETWORK, DenseNetwork, NetworkNamespace, casadi_network
from .normalizer import Normalizer
from .track_model import FEATURES, SIDES, Side, shear_points, track_forces

FORMAT_VERSION: Final = 1
#: How the interface columns become network inputs: as they are, or as the slip of each track.
FEATURE_MAPS: Final = ("interface", "track")
SUFFIX: Final = ".safetensors"

#: Normalized features to normalized outputs.
Forward = Callable[[Any], Any]


@dataclass(frozen=True, eq=False)
class Surrogate:
    """A trained network with everything that is needed to use it, trust it and make it again.

    Parameters
    ----------
    vehicle : TrackedVehicle
        Vehicle that it was trained for.
    mode : {"rigid", "soil"}
        Terrain mode.
    network : DenseNetwork
        Normalized features to normalized forces; of a structured surrogate, the features of one track to what its
        contact elements return at unit strength.
    input_normalizer, output_normalizer : Normalizer
        Of the features, and of [Qx, Qy, Mz] or of the elements' forces.
    detector : BoxMahalanobisDetector
        Where to trust it.
    ranges : ParameterRanges
        Terrain that it was trained on.
    range_name : str
        Name of the ranges, such as ``"wide"``.
    recipe : Mapping
        How it was trained, as JSON can hold it.
    dataset_hash : str
        What it was trained on.
    metrics : Mapping
        What was measured, as JSON can hold it.
    feature_map : {"interface", "track"}
        How interface columns become features: as they are (a plain network), or as the slip of each track (the
        structured surrogate of :mod:`grouser.surrogate.track_model`).
    format_version : int
        Of the file.

    Raises
    ------
    ArtifactError
        If the parts do not fit together.
    ConfigurationError
        If it is structured, and the vehicle has wheels that its shear points cannot be shared among.
    """

    vehicle: TrackedVehicle
    mode: Mode
    network: DenseNetwork
    input_normalizer: Normalizer
    output_normalizer: Normalizer
    detector: BoxMahalanobisDetector
    ranges: ParameterRanges
    range_name: str = "wide"
    recipe: Mapping[str, Any] = field(default_factory=dict)
    dataset_hash: str = ""
    metrics: Mapping[str, Any] = field(default_factory=dict)
    feature_map: str = "interface"
    format_version: int = FORMAT_VERSION

    def __post_init__(self) -> None:
        table = interface(self.mode)
        if self.feature_map not in FEATURE_MAPS:
            raise ArtifactError(f"unknown feature map {self.feature_map!r} (known: {', '.join(FEATURE_MAPS)})")
        if self.detector.mode != self.mode or self.ranges.mode != self.mode:
            raise ArtifactError(
                f"a {self.mode} surrogate takes a detector and ranges of its mode, "
                f"got {self.detector.mode} and {self.ranges.mode}"
            )
        if not len(self.ranges.low) == len(self.ranges.high) == len(table.parameter_names):
            raise ArtifactError(f"{self.mode} ranges bound {', '.join(table.parameter_names)}, got {self.ranges}")
        if self.structured and not self.vehicle.soft_speed > 0:
            raise ArtifactError("a structured surrogate needs a vehicle with soft_speed above 0: its slip is over that")
        if self.structured:
            shear_points(self.vehicle)
        widths = self.network.widths
        inputs = FEATURES if self.structured else table.size
        outputs = 3 * self.vehicle.road_wheels if self.structured else len(OUTPUT_NAMES)
        for name, got, expected in (
            ("network inputs", widths[0], inputs),
            ("network outputs", widths[-1], outputs),
            ("input normalizer columns", self.input_normalizer.size, inputs),
            ("output normalizer columns", self.output_normalizer.size, outputs),
        ):
            if got != expected:
                raise ArtifactError(f"a {self.mode} surrogate has {expected} {name}, got {got}")

    @property
    def interface(self) -> Interface:
        """The interface of the mode."""
        return interface(self.mode)

    @cached_property
    def content_hash(self) -> str:
        """SHA-256 over tensors and metadata, in hexadecimal: names the surrogate in logs."""
        return content_hash(*encode(self))

    @property
    def structured(self) -> bool:
        """Whether it knows the tracks apart; see :mod:`grouser.surrogate.track_model`."""
        return self.feature_map == "track"

    def evaluate(self, xp: NetworkNamespace, x: Any, forward: Forward | None = None) -> Any:
        """Return [Qx, Qy, Mz] over an array namespace, in float64.

        Parameters
        ----------
        xp : NetworkNamespace
            NumPy, torch or CasADi.
        x : array (..., d), or CasADi column (d, 1)
            Interface array.
        forward : callable, optional
            Evaluates the network on normalized features; the network itself in float64 by default.
        """
        if not self.structured:
            return self._apply(xp, x, forward)
        left, right = (self.evaluate_track(xp, x, side, forward) for side in SIDES)
        return xp.array.join([a + b for a, b in zip(left, right, strict=True)])

    def evaluate_track(self, xp: NetworkNamespace, x: Any, side: Side, forward: Forward | None = None) -> list[Any]:
        """Return [Fx, Fy, M] of one track of a structured surrogate, as columns; arguments as of :meth:`evaluate`."""
        return track_forces(xp, self.vehicle, self.mode, x, side, lambda features: self._apply(xp, features, forward))

    def _apply(self, xp: NetworkNamespace, features: Any, forward: Forward | None) -> Any:
        z = self.input_normalizer.normalize(features, xp.array)
        z = self.network.forward(xp, z) if forward is None else forward(z)
        return self.output_normalizer.denormalize(z, xp.array)

    def reference_forces(self, x: FloatArray) -> FloatArray:
        """Return [Qx, Qy, Mz] in NumPy float64, shape (3,) or (n, 3): the oracle of every other implementation.

        Raises
        ------
        InvalidInputError
            If the shape is wrong or a value is not finite.
        """
        forces: FloatArray = self.evaluate(NUMPY_NETWORK, self.check(x))
        return forces

    def check(self, x: FloatArray) -> FloatArray:
        """Return interface rows as float64, once they are seen to be what the surrogate can take.

        Raises
        ------
        InvalidInputError
            If the shape is wrong, a value is not finite, or k is not positive where the slip is taken over it.
        """
        checked = self.interface.check(x)
        if self.structured and not np.all(checked[..., -1] > 0):
            raise InvalidInputError("k must be positive")
        return checked

    def casadi(self) -> Any:
        """Return the CasADi function x (d) → q (3), float64.

        Raises
        ------
        ConfigurationError
            If CasADi is not installed.
        """
        xp = casadi_network()
        import casadi

        x = casadi.MX.sym("x", self.interface.size)
        return casadi.Function(f"surrogate_{self.mode}", [x], [self.evaluate(xp, x)], ["x"], ["q"])

    def require(self, vehicle: TrackedVehicle, mode: str) -> Surrogate:
        """Return the surrogate itself, if it is for this mode and for a vehicle of the same block.

        Raises
        ------
        ArtifactError
            If it is not.
        """
        if self.mode != mode or not self.vehicle.same_block(vehicle):
            why = "" if self.vehicle.name != vehicle.name or self.mode != mode else " (another mass or geometry)"
            raise ArtifactError(
                f"the artifact is for {self.vehicle.name} on {self.mode} ground, asked for {vehicle.name} on {mode} "
                f"ground{why}; pass one of that vehicle and mode, or train it with 'grouser train'"
            )
        return self

    def with_metrics(self, metrics: Mapping[str, Any]) -> Surrogate:
        """Return the surrogate with other measured metrics, and so another content hash."""
        return replace(self, metrics=metrics)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the artifact aside and rename it, so that the file is whole or not there; return its path.

        Raises
        ------
        ArtifactError
            If the name does not end in ``.safetensors``, or recipe or metrics cannot be held by JSON.
        """
        target = Path(path)
        if target.suffix != SUFFIX:
            raise ArtifactError(f"an artifact's name ends in {SUFFIX}, got {target.name!r}")
        return write_aside(target, pack(*encode(self)))

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Surrogate:
        """Read an artifact, checking that it is whole and unaltered.

        Parameters
        ----------
        path : str or path-like
            File, or one of :func:`shipped_names`.

        Raises
        ------
        ArtifactError
            If there is no such file, or it is truncated, altered, of a newer format, incomplete or inconsistent.
        """
        if str(path) in shipped_names():
            return cls._shipped(str(path))
        try:
            data = Path(path).read_bytes()
        except OSError as error:
            raise ArtifactError(f"cannot read artifact {str(path)!r}: {error.strerror}") from error
        return cls._from_bytes(data, str(path))

    @classmethod
    def shipped(cls, vehicle: str | TrackedVehicle, mode: str) -> Surrogate:
        """Load the artifact that grouser ships for a vehicle and mode.

        Raises
        ------
        ArtifactError
            If none is shipped, or the vehicle of that name has another block.
        ConfigurationError
            If the mode is unknown.
        """
        name = vehicle if isinstance(vehicle, str) else vehicle.name
        stem = f"{name}-{interface(mode).mode}"
        if stem not in shipped_names():
            raise ArtifactError(
                f"no artifact is shipped for {name} on {mode} ground (shipped: {', '.join(shipped_names()) or 'none'}); "
                "make one with 'grouser train' and pass its path as artifact="
            )
        surrogate = cls._shipped(stem)
        return surrogate if isinstance(vehicle, str) else surrogate.require(vehicle, mode)

    @classmethod
    def resolve(
        cls, vehicle: TrackedVehicle, mode: str, artifact: str | os.PathLike[str] | Surrogate | None = None
    ) -> Surrogate:
        """Return the surrogate that ``artifact`` means: itself, a path, or None for the shipped one.

        Raises
        ------
        ArtifactError
            If it cannot be read or is for another vehicle or mode.
        """
        if artifact is None:
            return cls.shipped(vehicle, mode)
        return (artifact if isinstance(artifact, Surrogate) else cls.load(artifact)).require(vehicle, mode)

    @classmethod
    def _shipped(cls, name: str) -> Surrogate:
        return cls._from_bytes(_artifacts().joinpath(name + SUFFIX).read_bytes(), f"shipped {name}")

    @classmethod
    def _from_bytes(cls, data: bytes, source: str) -> Surrogate:
        tensors, metadata = unpack(data, source, FORMAT_VERSION)
        try:
            return cls(**decode(tensors, metadata))
        except KeyError as error:
            raise ArtifactError(f"artifact {source!r} lacks {error.args[0]!r}; write it with Surrogate.save") from error
        except (GrouserError, TypeError, ValueError) as error:
            raise ArtifactError(f"artifact {source!r} does not hold a surrogate: {error}") from error


def shipped_names() -> tuple[str, ...]:
    """Names of the artifacts that grouser ships, sorted: ``{vehicle}-{mode}``, the backends' own, and others."""
    folder = _artifacts()
    if not folder.is_dir():
        return ()
    return tuple(sorted(entry.name[: -len(SUFFIX)] for entry in folder.iterdir() if entry.name.endswith(SUFFIX)))


def _artifacts() -> Any:
    return files(__package__).joinpath("artifacts")
