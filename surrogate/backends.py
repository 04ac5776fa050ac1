"""The surrogate as a force backend: the network in torch, and in compiled C."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial
from typing import Any, ClassVar, Final

import numpy as np

from ..native import Mlp, TrackNet
from ..terrain import (
    MODES,
    CompiledBackend,
    ConfigurationError,
    FloatArray,
    ForceBackend,
    Mode,
    TrackedVehicle,
    block_geometry,
)
from .artifact import Surrogate
from .network import ACTIVATIONS, require_torch, torch_module, torch_network
from .track_model import SIDES, Side, shear_points

Artifact = str | os.PathLike[str] | Surrogate | None

_DOMAIN: Final = "k must be positive"


class _SurrogateBackend(ForceBackend):
    """What both evaluations of an artifact share: float32 between float64 columns and forces."""

    resolution = float(np.finfo(np.float32).eps)
    surrogate: Surrogate

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.vehicle, self.mode, self.surrogate)

    def describe(self) -> dict[str, Any]:
        """Return backend, mode, vehicle and the artifact's content hash."""
        return super().describe() | {"artifact": self.surrogate.content_hash}


class NativeSurrogate(_SurrogateBackend, CompiledBackend):
    """The network in compiled C, with an analytic Jacobian.

    Parameters
    ----------
    vehicle : TrackedVehicle
        The vehicle.
    mode : {"rigid", "soil"}
        Terrain mode.
    artifact : path or Surrogate, optional
        The shipped one of that vehicle and mode by default.

    Raises
    ------
    ArtifactError
        If the artifact cannot be read or is for another vehicle or mode.
    ConfigurationError
        If the network is larger than the compiled one holds.
    """

    name: ClassVar[str] = "native"

    def __init__(self, vehicle: TrackedVehicle, mode: Mode, artifact: Artifact = None) -> None:
        self.surrogate = surrogate = Surrogate.resolve(vehicle, mode, artifact)
        try:
            kernel = _track_kernel(surrogate) if surrogate.structured else _plain_kernel(surrogate)
        except ValueError as error:
            raise ConfigurationError(f"the compiled network cannot hold this one: {error}; use 'torch'") from error
        tracks = kernel if isinstance(kernel, TrackNet) else None
        super().__init__(vehicle, mode, kernel, domain=_DOMAIN if tracks else "", tracks=tracks)


def _plain_kernel(surrogate: Surrogate) -> Mlp:
    network = surrogate.network
    return Mlp(
        activation=ACTIVATIONS.index(network.activation),
        widths=network.widths,
        parameters=network.packed(),
        input_mean=surrogate.input_normalizer.mean,
        input_scale=surrogate.input_normalizer.scale,
        output_mean=surrogate.output_normalizer.mean,
        output_scale=surrogate.output_normalizer.scale,
    )


def _track_kernel(surrogate: Surrogate) -> TrackNet:
    vehicle, network = surrogate.vehicle, surrogate.network
    points = shear_points(vehicle)
    return TrackNet(
        mode=MODES.index(surrogate.mode),
        activation=ACTIVATIONS.index(network.activation),
        widths=network.widths,
        parameters=network.packed(),
        input_mean=surrogate.input_normalizer.mean,
        input_scale=surrogate.input_normalizer.scale,
        output_mean=surrogate.output_normalizer.mean,
        output_scale=surrogate.output_normalizer.scale,
        ends=np.concatenate([points.starts, points.stops]),
        reach=points.reach,
        half_travel=points.half_travel,
        part_length=points.length,
        mean=points.mean,
        moment=points.moment,
        **block_geometry(vehicle),
    )


class TorchSurrogate(_SurrogateBackend):
    """The network in eager torch, float32, on the CPU; normalization in float64.

    Parameters
    ----------
    vehicle : TrackedVehicle
        The vehicle.
    mode : {"rigid", "soil"}
        Terrain mode.
    artifact : path or Surrogate, optional
        The shipped one of that vehicle and mode by default.

    Raises
    ------
    ArtifactError
        If the artifact cannot be read or is for another vehicle or mode.
    ConfigurationError
        If torch is not installed.
    """

    name: ClassVar[str] = "torch"

    def __init__(self, vehicle: TrackedVehicle, mode: Mode, artifact: Artifact = None) -> None:
        super().__init__(vehicle, mode)
        self.surrogate = Surrogate.resolve(vehicle, mode, artifact)
        require_torch()
        import torch

        self.has_track_forces = self.surrogate.structured
        self._torch = torch
        self._xp = torch_network()
        self._network = torch_module(self.surrogate.network).requires_grad_(False).eval()
        inputs, outputs = self.surrogate.input_normalizer, self.surrogate.output_normalizer
        self._input = torch.tensor(inputs.mean), torch.tensor(inputs.scale)
        self._output = torch.tensor(outputs.mean), torch.tensor(outputs.scale)
        self._directions = torch.eye(3, dtype=torch.float64)

    def forces(self, x: FloatArray) -> FloatArray:
        """Return [Qx, Qy, Mz], shape (3,) or (n, 3); see :meth:`ForceBackend.forces`."""
        rows = self._torch.from_numpy(self._writable(x))
        with self._torch.inference_mode():
            forces: FloatArray = self._evaluate(rows).numpy()
        return forces

    def forces_and_jacobian(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return forces and ∂Q/∂x over every column, by backpropagation."""
        rows = self._torch.from_numpy(self._writable(x))
        return self._with_jacobian(rows, self._evaluate)

    def track_forces_and_jacobian(self, x_left: FloatArray, x_right: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return track forces and the derivatives of each by its own input, by backpropagation."""
        if not self.has_track_forces:
            return super().track_forces_and_jacobian(x_left, x_right)
        parts = []
        for x, side in zip(self.check_tracks(x_left, x_right), SIDES, strict=True):
            rows = self._torch.from_numpy(self._writable(x))
            parts.append(self._with_jacobian(rows, partial(self._evaluate_track, side)))
        forces, jacobian = (np.stack(part, axis=1) for part in zip(*parts, strict=True))
        return forces, jacobian

    def _with_jacobian(self, rows: Any, evaluate: Callable[[Any], Any]) -> tuple[FloatArray, FloatArray]:
        with self._torch.enable_grad():
            # One copy of each row an output: a single backward pass then gives all three rows of its Jacobian.
            copies = rows[..., None, :].repeat(*[1] * (rows.ndim - 1), 3, 1).requires_grad_(True)
            outputs = evaluate(copies)
            (jacobian,) = self._torch.autograd.grad(outputs, copies, self._directions.expand_as(outputs))
        return outputs.detach()[..., 0, :].numpy().copy(), jacobian.numpy()

    def _evaluate_track(self, side: Side, rows: Any) -> Any:
        return self._torch.cat(self.surrogate.evaluate_track(self._xp, rows, side, self._forward), -1)

    def track_forces(self, x_left: FloatArray, x_right: FloatArray) -> FloatArray:
        """Return [Fx, Fy, M] of each track, shape (n, 2, 3); see :meth:`ForceBackend.track_forces`."""
        if not self.has_track_forces:
            return super().track_forces(x_left, x_right)
        left, right = self.check_tracks(x_left, x_right)
        tracks: list[Any] = []
        with self._torch.inference_mode():
            for x, side in zip((left, right), SIDES, strict=True):
                rows = self._torch.from_numpy(self._writable(x))
                tracks.append(self._evaluate_track(side, rows))
        forces: FloatArray = self._torch.stack(tracks, dim=-2).numpy()
        return forces

    def _forward(self, features: Any) -> Any:
        return self._network(features.float()).double()

    def _evaluate(self, rows: Any) -> Any:
        if self.surrogate.structured:
            return self.surrogate.evaluate(self._xp, rows, self._forward)
        (mean, scale), (output_mean, output_scale) = self._input, self._output
        return output_mean + output_scale * self._network(((rows - mean) / scale).float()).double()

    def _writable(self, x: Any) -> FloatArray:
        # torch warns where it would share memory that is not writable.
        checked = self.surrogate.check(x)
        return checked if checked.flags.writeable else checked.copy()
