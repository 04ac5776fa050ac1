"""The dense network as data, and its forward pass written once for NumPy, torch and CasADi."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from ..terrain import (
    NUMPY,
    ArrayNamespace,
    FloatArray,
    InvalidInputError,
    casadi_namespace,
    missing_extra,
    torch_namespace,
    unknown_name,
)
from .normalizer import frozen_array

if TYPE_CHECKING:
    import torch

Activation = Literal["relu", "silu", "tanh"]
#: In the order of the compiled network's enumeration.
ACTIVATIONS: Final[tuple[Activation, ...]] = ("relu", "silu", "tanh")


@dataclass(frozen=True)
class NetworkNamespace:
    """An array namespace with the two operations that a network adds to it.

    Parameters
    ----------
    array : ArrayNamespace
        NumPy, torch or CasADi, float64.
    affine : callable
        ``affine(row, weights, bias)``: row (..., inputs) by NumPy weights (inputs, outputs) and bias (outputs,).
    tanh : callable
        Hyperbolic tangent.
    """

    array: ArrayNamespace
    affine: Callable[[Any, FloatArray, FloatArray], Any]
    tanh: Callable[[Any], Any]


NUMPY_NETWORK: Final = NetworkNamespace(NUMPY, lambda row, weights, bias: row @ weights + bias, np.tanh)


@cache
def torch_network() -> NetworkNamespace:
    """Return the namespace of float64 torch tensors.

    Raises
    ------
    ConfigurationError
        If torch is not installed.
    """
    array = torch_namespace()
    import torch

    def affine(row: Any, weights: FloatArray, bias: FloatArray) -> Any:
        return row @ torch.as_tensor(weights) + torch.as_tensor(bias)

    return NetworkNamespace(array, affine, torch.tanh)


@cache
def casadi_network() -> NetworkNamespace:
    """Return the namespace of CasADi symbols, one sample, a column, at a time.

    Raises
    ------
    ConfigurationError
        If CasADi is not installed.
    """
    array = casadi_namespace()
    import casadi

    def affine(row: Any, weights: FloatArray, bias: FloatArray) -> Any:
        return casadi.mtimes(casadi.DM(weights.T), row) + casadi.DM(bias)

    return NetworkNamespace(array, affine, casadi.tanh)


@dataclass(frozen=True, eq=False)
class DenseNetwork:
    """A multilayer perceptron: affine layers with one activation between them, the last layer linear.

    Parameters
    ----------
    activation : {"relu", "silu", "tanh"}
        Between the layers.
    weights : tuple of ndarray, shape (inputs, outputs)
        One float32 matrix a layer.
    biases : tuple of ndarray, shape (outputs,)
        One float32 vector a layer.

    Raises
    ------
    ConfigurationError
        If the activation is unknown.
    InvalidInputError
        If the layers do not follow on one another, there is none, or a value is not finite.
    """

    activation: Activation
    weights: tuple[NDArray[np.float32], ...]
    biases: tuple[NDArray[np.float32], ...]

    def __post_init__(self) -> None:
        if self.activation not in ACTIVATIONS:
            raise unknown_name("activation", self.activation, ACTIVATIONS)
        for name in ("weights", "biases"):
            object.__setattr__(self, name, tuple(frozen_array(array, np.float32) for array in getattr(self, name)))
        if not self.weights or len(self.weights) != len(self.biases):
            raise InvalidInputError(
                f"a network has a bias for each of at least one layer, "
                f"got {len(self.weights)} weights and {len(self.biases)} biases"
            )
        inputs: int | None = None
        for layer, (weights, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            follows = weights.ndim == 2 and weights.size and inputs in (None, weights.shape[0])
            if not follows or bias.shape != weights.shape[1:]:
                raise InvalidInputError(
                    f"layer {layer} takes weights ({inputs or 'inputs'}, outputs) and biases (outputs,), "
                    f"got {weights.shape} and {bias.shape}"
                )
            if not (np.isfinite(weights).all() and np.isfinite(bias).all()):
                raise InvalidInputError(f"layer {layer} holds weights or biases that are not finite")
            inputs = weights.shape[1]

    @property
    def widths(self) -> tuple[int, ...]:
        """Inputs, hidden widths, outputs."""
        return (self.weights[0].shape[0], *(weights.shape[1] for weights in self.weights))

    @property
    def parameter_count(self) -> int:
        """Number of weights and biases."""
        return sum(array.size for array in (*self.weights, *self.biases))

    def packed(self) -> bytes:
        """Return every layer's weights, then its biases, as the compiled network takes them."""
        return b"".join(w.tobytes() + b.tobytes() for w, b in zip(self.weights, self.biases, strict=True))

    def forward(self, xp: NetworkNamespace, row: Any) -> Any:
        """Evaluate the network in float64.

        Parameters
        ----------
        xp : NetworkNamespace
            NumPy, torch or CasADi.
        row : array (..., inputs), or CasADi column (inputs, 1)
            Normalized features.

        Returns
        -------
        array (..., outputs), or CasADi column (outputs, 1)
        """
        activate = {"relu": _relu, "silu": _silu, "tanh": _tanh}[self.activation]
        last = len(self.weights) - 1
        for layer, (weights, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            row = xp.affine(row, weights.astype(np.float64), bias.astype(np.float64))
            row = row if layer == last else activate(xp, row)
        return row

    @classmethod
    def from_torch(cls, module: torch.nn.Module) -> DenseNetwork:
        """Read a ``torch.nn.Sequential`` of Linear layers and one kind of activation; Dropout is passed over.

        Raises
        ------
        InvalidInputError
            If the module holds anything else, or activations of two kinds, or misses one between two layers.
        """
        require_torch()
        import torch

        kinds = _torch_activations(torch)
        weights: list[Any] = []
        biases: list[Any] = []
        found: list[str] = []
        for part in module.children():
            if isinstance(part, torch.nn.Linear):
                weights.append(part.weight.detach().cpu().numpy().T)
                biases.append(np.zeros(part.out_features) if part.bias is None else part.bias.detach().cpu().numpy())
            elif type(part) in kinds.values():
                found.append(next(name for name, kind in kinds.items() if type(part) is kind))
            elif not isinstance(part, torch.nn.Dropout):
                raise InvalidInputError(
                    f"expected Linear, Dropout, {', '.join(ACTIVATIONS)}; got {type(part).__name__}"
                )
        layout = [
            isinstance(part, torch.nn.Linear) for part in module.children() if not isinstance(part, torch.nn.Dropout)
        ]
        alternates = layout == [index % 2 == 0 for index in range(len(layout))] and len(layout) % 2 == 1
        if len(set(found)) > 1 or not alternates:
            raise InvalidInputError(
                f"expected one kind of activation between layers, got {len(weights)} layers, {found}"
            )
        activation: Any = found[0] if found else "relu"
        return cls(activation, tuple(weights), tuple(biases))


def require_torch() -> None:
    """Raise ConfigurationError, naming the extra, if torch is not installed."""
    if find_spec("torch") is None:
        raise missing_extra("torch", "torch")


def torch_module(network: DenseNetwork) -> torch.nn.Sequential:
    """Return the network as a trainable float32 ``torch.nn.Sequential`` of Linear layers and activations.

    Raises
    ------
    ConfigurationError
        If torch is not installed.
    """
    require_torch()
    import torch

    parts: list[Any] = []
    for weights, bias in zip(network.weights, network.biases, strict=True):
        # On the meta device nothing is drawn, so the global generator stays where it was.
        linear = torch.nn.Linear(weights.shape[0], weights.shape[1], device="meta").float().to_empty(device="cpu")
        with torch.no_grad():
            linear.weight.copy_(torch.tensor(weights).T)
            linear.bias.copy_(torch.tensor(bias))
        parts += [linear, _torch_activations(torch)[network.activation]()]
    return torch.nn.Sequential(*parts[:-1])


def random_network(widths: Sequence[int], activation: Activation, generator: np.random.Generator) -> DenseNetwork:
    """Draw a network to start training from: uniform weights of variance 2/inputs, zero biases."""
    weights = [
        generator.uniform(-1.0, 1.0, (inputs, outputs)) * np.sqrt(6.0 / inputs) for inputs, outputs in pairwise(widths)
    ]
    return DenseNetwork(
        activation,
        tuple(layer.astype(np.float32) for layer in weights),
        tuple(np.zeros(outputs, dtype=np.float32) for outputs in widths[1:]),
    )


def _relu(xp: NetworkNamespace, z: Any) -> Any:
    return xp.array.clip(z, 0.0, np.inf)


def _silu(xp: NetworkNamespace, z: Any) -> Any:
    # z/(1 + exp(−z)), in a form that cannot overflow.
    return z * (0.5 + 0.5 * xp.tanh(0.5 * z))


def _tanh(xp: NetworkNamespace, z: Any) -> Any:
    return xp.tanh(z)


def _torch_activations(torch: Any) -> dict[str, Any]:
    return {"relu": torch.nn.ReLU, "silu": torch.nn.SiLU, "tanh": torch.nn.Tanh}
