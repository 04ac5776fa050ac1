"""Which numbers of a network are rounded to what, and the network that comes of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, Literal

import numpy as np

from grouser.surrogate import NUMPY_NETWORK, DenseNetwork
from grouser.terrain import FloatArray

from .rounding import Floats, activation_codes, to_bfloat16, to_float16, weight_codes

Number = Literal["float32", "float16", "bfloat16", "int8"]
_WEIGHTS: Final[dict[Number, Callable[[Floats], Floats]]] = {
    "float32": lambda weights: weights,
    "float16": to_float16,
    "bfloat16": to_bfloat16,
    "int8": lambda weights: weight_codes(weights).values,
}


@dataclass(frozen=True)
class Format:
    """How the numbers of a network are held.

    Parameters
    ----------
    weights : {"float32", "float16", "bfloat16", "int8"}
        Of every rounded layer; bytes have one scale for each output. Biases and sums stay float32.
    activations : {"float32", "bfloat16", "int8"}
        What enters a rounded layer; bytes have one scale a row, found while it is computed.
    first : bool
        Whether the first layer is rounded, too.
    """

    weights: Number
    activations: Number = "float32"
    first: bool = True

    @property
    def name(self) -> str:
        """In tables, and as a backend."""
        activations = "" if self.activations == "float32" else " and activations"
        weights = "" if self.weights == "float32" else " weights"
        return f"{self.weights}{weights}{activations}{'' if self.first else ', first layer float32'}"

    def network(self, network: DenseNetwork) -> DenseNetwork:
        """Return the network with rounded weights, held in float32 again.

        Raises
        ------
        InvalidInputError
            If a weight is beyond the range of the format.
        """
        rounded = [
            _WEIGHTS[self.weights](weights) if self._rounds(layer) else weights
            for layer, weights in enumerate(network.weights)
        ]
        return DenseNetwork(network.activation, tuple(rounded), network.biases)

    def forward(self, network: DenseNetwork) -> Callable[[Any], FloatArray]:
        """Return the evaluation of the rounded network on normalized features, its activations rounded as well.

        Products and sums are float64, so that nothing but the rounding differs from the network.
        """
        return partial(self._forward, _layers(self.network(network)), network.activation != "relu")

    def _forward(self, layers: list[DenseNetwork], signed: bool, row: FloatArray) -> FloatArray:
        for index, layer in enumerate(layers):
            if self._rounds(index):
                row = self._entering(row, signed=signed or index == 0)
            row = layer.forward(NUMPY_NETWORK, row)
        return row

    def _entering(self, values: FloatArray, *, signed: bool) -> FloatArray:
        if self.activations == "bfloat16":
            return to_bfloat16(values).astype(np.float64)
        if self.activations == "int8":
            return activation_codes(values, signed=signed).values.astype(np.float64)
        return values

    def _rounds(self, layer: int) -> bool:
        return self.first or layer > 0


def _layers(network: DenseNetwork) -> list[DenseNetwork]:
    """Return every layer as a network of its own, its activation included."""
    hidden = [
        DenseNetwork(network.activation, (weights, np.eye(len(bias), dtype=np.float32)), (bias, np.zeros_like(bias)))
        for weights, bias in zip(network.weights[:-1], network.biases[:-1], strict=True)
    ]
    return [*hidden, DenseNetwork(network.activation, network.weights[-1:], network.biases[-1:])]


#: What the others are held against.
FLOAT32: Final = Format("float32")
#: Of every study, by name.
FORMATS: Final = {
    kind.name: kind
    for kind in (
        FLOAT32,
        Format("float16"),
        Format("bfloat16"),
        Format("int8"),
        Format("bfloat16", "bfloat16"),
        Format("bfloat16", "bfloat16", first=False),
        Format("int8", "int8"),
        Format("int8", "int8", first=False),
    )
}
