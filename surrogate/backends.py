"""The surrogate as a force backend: the network in torch, and in compiled C."""

from __future__ import annotations

import os
from typing import Any, ClassVar

import numpy as np

from ..native import Mlp
from ..terrain import (
    CompiledBackend,
    ConfigurationError,
    FloatArray,
    ForceBackend,
    Mode,
    TrackedVehicle,
)
from .artifact import Surrogate
from .network import ACTIVATIONS, require_torch, torch_module

Artifact = str | os.PathLike[str] | Surrogate | None


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
        network = surrogate.network
        try:
            kernel = Mlp(
                activation=ACTIVATIONS.index(network.activation),
                widths=network.widths,
                parameters=network.packed(),
                input_mean=surrogate.input_normalizer.mean,
                input_scale=surrogate.input_normalizer.scale,
                output_mean=surrogate.output_normalizer.mean,
                output_scale=surrogate.output_normalizer.scale,
            )
        except ValueError as error:
            raise ConfigurationError(f"the compiled network cannot hold this one: {error}; use 'torch'") from error
        super().__init__(vehicle, mode, kernel)


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

        self._torch = torch
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
        with self._torch.enable_grad():
            # One copy of each row an output: a single backward pass then gives all three rows of its Jacobian.
            copies = rows[..., None, :].repeat(*[1] * (rows.ndim - 1), 3, 1).requires_grad_(True)
            outputs = self._evaluate(copies)
            (jacobian,) = self._torch.autograd.grad(outputs, copies, self._directions.expand_as(outputs))
        return outputs.detach()[..., 0, :].numpy().copy(), jacobian.numpy()

    def _evaluate(self, rows: Any) -> Any:
        (mean, scale), (output_mean, output_scale) = self._input, self._output
        return output_mean + output_scale * self._network(((rows - mean) / scale).float()).double()

    def _writable(self, x: Any) -> FloatArray:
        # torch warns where it would share memory that is not writable.
        checked = self.interface.check(x)
        return checked if checked.flags.writeable else checked.copy()
