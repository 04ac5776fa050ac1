"""Forward passes in C for one sample of a ReLU network, a format each, compiled where they are timed."""

from __future__ import annotations

import ctypes
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from grouser.controllers.bench.compiled_rivals import TIMER, CompiledRival
from grouser.controllers.bench.toolchain import Toolchain, Unit
from grouser.surrogate import Surrogate
from grouser.terrain import ConfigurationError

from .formats import FLOAT32, FORMATS, Format
from .rounding import Floats, bfloat16_bits, to_bfloat16, weight_codes

_SOURCES: Final = Path(__file__).parent / "kernels"
#: Those of the core's kernels at x86-64-v4.
LEVEL_FLAGS: Final = (
    *("-O3", "-mavx512f", "-mavx512dq", "-mavx512bw", "-mavx512vl", "-mfma", "-mprefer-vector-width=512"),
    *("-ffp-contract=off", "-fno-math-errno"),
)
_LANES: Final = 16
_ALIGNMENT: Final = 64
#: What the processor may have, by the function that tells.
AVX512, AVX512_BF16, AVX512_VNNI = "avx512", "avx512_bf16", "avx512_vnni"


@dataclass(frozen=True)
class Prototype:
    """A forward pass.

    Parameters
    ----------
    name : str
        In tables.
    source : str
        C file, without ending.
    kind : Format
        That it holds the network in.
    inputs_a_word : int
        Neighbouring inputs that stand side by side for each output, behind the first layer; 1 where rows of outputs do.
    skipping : bool
        Whether it leaves out the inputs that are zero.
    needs : str
        What the processor has to have.
    """

    name: str
    source: str
    kind: Format
    inputs_a_word: int = 1
    skipping: bool = False
    needs: str = AVX512

    @property
    def flags(self) -> tuple[str, ...]:
        """For the compiler."""
        extra = {AVX512_BF16: ("-mavx512bf16",), AVX512_VNNI: ("-mavx512vnni",)}.get(self.needs, ())
        skip = () if self.inputs_a_word > 1 else (f"-DSKIP={int(self.skipping)}",)
        return (*LEVEL_FLAGS, *extra, *skip, f"-I{_SOURCES}")

    def layers(self, surrogate: Surrogate) -> list[Layer]:
        """Return every layer as the C file reads it."""
        network = surrogate.network
        return [
            _layer(self.kind if self.kind.first or index else FLOAT32, self.inputs_a_word if index else 1, *parts)
            for index, parts in enumerate(zip(network.weights, network.biases, strict=True))
        ]

    def compile(self, toolchain: Toolchain, folder: Path, label: str, surrogate: Surrogate) -> Compiled:
        """Return the forward pass with a network.

        Parameters
        ----------
        toolchain : Toolchain
            The compiler.
        folder : Path
            Takes the files, and keeps what is compiled for the next network.
        label : str
            Of the network; each only once, since a loaded library stays.
        surrogate : Surrogate
            Plain, with ReLU.

        Raises
        ------
        ConfigurationError
            If the compiler refuses, or the network is not a plain one with ReLU.
        """
        if surrogate.structured or surrogate.network.activation != "relu":
            raise ConfigurationError("the prototypes take plain networks with ReLU")
        units = [
            Unit(TIMER, ("-O2",)),
            Unit((_SOURCES / f"{self.source}.c").read_text(encoding="utf-8"), self.flags),
        ]
        stem = f"{self.source}_{int(self.skipping)}"
        if not (folder / f"{stem}.so").exists():
            toolchain.library(folder, stem, units)
        # A copy has a network of its own.
        copy = shutil.copy(folder / f"{stem}.so", folder / f"{stem}_{label}.so")
        return Compiled(ctypes.CDLL(str(copy)), self.layers(surrogate), surrogate)


@dataclass(frozen=True, eq=False)
class Layer:
    """A layer in memory, every array aligned and padded to whole vectors of outputs.

    Parameters
    ----------
    inputs : int
        Their number.
    weights : ndarray
        Rows of outputs, an input each; or for each word of inputs and output, the inputs' weights.
    scales : ndarray, shape (outputs,), optional
        Of bytes.
    biases : ndarray, shape (outputs,)
        float32.
    """

    inputs: int
    weights: NDArray[Any]
    scales: Floats | None
    biases: Floats


class Compiled(CompiledRival):
    """A forward pass that is compiled and has its network.

    Parameters
    ----------
    library : ctypes.CDLL
        Of the C file.
    layers : list of Layer
        As it reads them; they are kept.
    surrogate : Surrogate
        Whose normalizers go around them.
    """

    def __init__(self, library: ctypes.CDLL, layers: list[Layer], surrogate: Surrogate) -> None:
        super().__init__(library)
        self._layers = layers
        for index, layer in enumerate(layers):
            library.set_layer(
                index, layer.inputs, len(layer.biases), *map(_pointer, (layer.weights, layer.scales, layer.biases))
            )
        inputs, outputs = surrogate.input_normalizer, surrogate.output_normalizer
        library.set_normalizers(inputs.size, *map(_pointer, (inputs.mean, inputs.scale, outputs.mean, outputs.scale)))

    @property
    def bytes(self) -> int:
        """Size of weights, scales and biases without padding bytes between them."""
        return sum(
            each.nbytes
            for layer in self._layers
            for each in (layer.weights, layer.scales, layer.biases)
            if each is not None
        )


def processor(toolchain: Toolchain, folder: Path) -> frozenset[str]:
    """Return what the processor has of what prototypes need.

    Raises
    ------
    ConfigurationError
        If the compiler refuses to ask: it is no x86 processor.
    """
    library = toolchain.library(
        folder, "processor", [Unit((_SOURCES / "processor.c").read_text(encoding="utf-8"), ("-O2",))]
    )
    return frozenset(name for name in (AVX512, AVX512_BF16, AVX512_VNNI) if library[f"has_{name}"]())


def _layer(kind: Format, inputs_a_word: int, weights: Floats, biases: Floats) -> Layer:
    codes, scales = _CODES[kind.weights](weights)
    inputs, outputs = codes.shape
    padded = -(-outputs // _LANES) * _LANES
    # The inputs of a hidden layer are padded, too: their weights are zero.
    words = -(-inputs // inputs_a_word)
    rows = np.zeros((words * inputs_a_word, padded), dtype=codes.dtype)
    rows[:inputs, :outputs] = codes
    together = rows.reshape(words, inputs_a_word, padded).swapaxes(1, 2)
    return Layer(
        inputs,
        _aligned(together),
        None if scales is None else _aligned(_padded(scales, padded)),
        _aligned(_padded(biases, padded)),
    )


def _padded(values: Floats, size: int) -> Floats:
    return np.concatenate([values, np.zeros(size - len(values), dtype=np.float32)])


def _aligned(values: NDArray[Any]) -> NDArray[Any]:
    held = np.empty(values.nbytes + _ALIGNMENT, dtype=np.uint8)
    begin = -held.ctypes.data % _ALIGNMENT
    made = held[begin : begin + values.nbytes].view(values.dtype).reshape(values.shape)
    made[...] = values
    return made


def _pointer(values: NDArray[Any] | None) -> ctypes.c_void_p:
    return ctypes.c_void_p(None if values is None else values.ctypes.data)


_CODES: Final[dict[str, Callable[[Floats], tuple[NDArray[Any], Floats | None]]]] = {
    "float32": lambda weights: (weights, None),
    "float16": lambda weights: (weights.astype(np.float16), None),
    "bfloat16": lambda weights: (bfloat16_bits(to_bfloat16(weights)), None),
    "int8": lambda weights: (weight_codes(weights).codes, weight_codes(weights).scales),
}
_BFLOAT16_DOT: Final = Format("bfloat16", "bfloat16", first=False)
_INT8_DOT: Final = Format("int8", "int8", first=False)
SKIPPING: Final = ", skipping"
PROTOTYPES: Final = (
    *(
        Prototype(f"{kind.weights}{suffix}", kind.weights, kind, skipping=bool(suffix))
        for kind in FORMATS.values()
        if kind.activations == "float32"
        for suffix in ("", SKIPPING)
    ),
    Prototype("bfloat16, vdpbf16ps", "bfloat16_dot", _BFLOAT16_DOT, 2, needs=AVX512_BF16),
    Prototype("int8, vpdpbusd", "int8_dot", _INT8_DOT, 4, needs=AVX512_VNNI),
)
