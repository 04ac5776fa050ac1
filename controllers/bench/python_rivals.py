"""Libraries that evaluate a network from Python, each the fastest way it has, on one thread."""

from __future__ import annotations

import ctypes
import os
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ...surrogate import DenseNetwork, casadi_network, torch_module
from ...terrain import FloatArray, missing_extra
from .timing import Burst, statement

#: Opset and file format that every ONNX Runtime of the last years reads.
_OPSET, _IR_VERSION = 17, 9

Rows = NDArray[np.float32]


@dataclass(frozen=True)
class PythonRival:
    """A way to evaluate a network on rows that are held ready.

    Parameters
    ----------
    call : callable
        Evaluates it.
    arguments : tuple
        Of the call.
    result : callable
        Returns the forces, shape (n, 3), that a call has left or would return.
    held : tuple
        What the call reads and holds no reference to.
    """

    call: Callable[..., object]
    arguments: tuple[object, ...]
    result: Callable[[], FloatArray]
    held: tuple[object, ...] = ()

    @property
    def burst(self) -> Burst:
        """What times the call."""
        names = {f"a{index}": argument for index, argument in enumerate(self.arguments)}
        return statement(f"call({', '.join(names)})", call=self.call, held=self.held, **names)

    def forces(self) -> FloatArray:
        """Call once and return the forces."""
        self.call(*self.arguments)
        return self.result()


def numpy_rival(network: DenseNetwork, rows: Rows) -> PythonRival:
    """Return float32 NumPy with one array a layer held ready."""
    layers = [(weights, bias, np.empty((len(rows), len(bias)), np.float32)) for weights, bias in _pairs(network)]
    hidden, (last, last_bias, out) = layers[:-1], layers[-1]

    def forward(value: Rows) -> Rows:
        for weights, bias, into in hidden:
            np.matmul(value, weights, out=into)
            into += bias
            value = np.maximum(into, 0.0, out=into)
        np.matmul(value, last, out=out)
        return np.add(out, last_bias, out=out)

    return PythonRival(forward, (rows,), lambda: forward(rows).astype(np.float64))


def torch_rivals(network: DenseNetwork, rows: Rows) -> dict[str, PythonRival]:
    """Return eager torch and a frozen trace.

    Raises
    ------
    ConfigurationError
        If torch is not installed.
    """
    module = torch_module(network).requires_grad_(False).eval()
    import torch

    given = torch.from_numpy(rows.copy())
    with warnings.catch_warnings():
        # Deprecated, and still the fastest that torch has for a network this small.
        warnings.simplefilter("ignore", DeprecationWarning)
        warnings.simplefilter("ignore", FutureWarning)
        jit: Any = torch.jit
        frozen = jit.freeze(jit.trace(module, given))
    for _ in range(20):
        # The trace is compiled on its first calls.
        frozen(given)
    # No weight asks for a gradient, so that none is recorded: inference_mode would only add to the call.
    return {
        name: PythonRival(
            call,
            (given,),
            lambda call=call: call(given).double().numpy(),  # type: ignore[misc]
        )
        for name, call in (("torch, eager", module), ("torch.jit, frozen", frozen))
    }


def onnx_rivals(network: DenseNetwork, rows: Rows) -> dict[str, PythonRival]:
    """Return ONNX Runtime with bound memory, and as it is usually called.

    Raises
    ------
    ConfigurationError
        If onnx or onnxruntime is not installed.
    """
    silence_onnx_runtime()
    try:
        import onnxruntime
    except ImportError as error:
        raise missing_extra("onnxruntime", "bench") from error
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
    options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_ENABLE_ALL
    session = onnxruntime.InferenceSession(onnx_model(network, len(rows)), options, ["CPUExecutionProvider"])
    given = onnxruntime.OrtValue.ortvalue_from_numpy(rows)
    out = onnxruntime.OrtValue.ortvalue_from_numpy(np.zeros((len(rows), network.widths[-1]), np.float32))
    binding = session.io_binding()
    binding.bind_ortvalue_input("rows", given)
    binding.bind_ortvalue_output("forces", out)
    return {
        "ONNX Runtime, bound": PythonRival(session.run_with_iobinding, (binding,), lambda: out.numpy().astype(float)),
        "ONNX Runtime, run()": PythonRival(
            session.run,
            (["forces"], {"rows": rows}),
            lambda: session.run(["forces"], {"rows": rows})[0].astype(float),
        ),
    }


def silence_onnx_runtime() -> None:
    """Ask ONNX Runtime, before it is loaded, not to report what it is used for, unless the user has said otherwise.

    By default it writes an identifier and a cache to disk and sends events while it is being timed.
    """
    os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")


def onnx_model(network: DenseNetwork, rows: int) -> bytes:
    """Return a network as an ONNX model of Gemm and Relu, for a number of rows.

    Raises
    ------
    ConfigurationError
        If onnx is not installed.
    """
    try:
        import onnx
        from onnx import TensorProto, helper, numpy_helper
    except ImportError as error:
        raise missing_extra("onnx", "bench") from error
    nodes, constants, value = [], [], "rows"
    last = len(network.weights) - 1
    for layer, (weights, bias) in enumerate(_pairs(network)):
        constants += [numpy_helper.from_array(weights, f"w{layer}"), numpy_helper.from_array(bias, f"b{layer}")]
        out = "forces" if layer == last else f"z{layer}"
        nodes.append(helper.make_node("Gemm", [value, f"w{layer}", f"b{layer}"], [out]))
        if layer < last:
            nodes.append(helper.make_node("Relu", [out], [f"a{layer}"]))
            value = f"a{layer}"
    described = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, [rows, width])
        for name, width in (("rows", network.widths[0]), ("forces", network.widths[-1]))
    ]
    graph = helper.make_graph(nodes, "network", described[:1], described[1:], constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", _OPSET)], ir_version=_IR_VERSION)
    onnx.checker.check_model(model)
    return bytes(model.SerializeToString())


def casadi_rival(network: DenseNetwork, rows: Rows) -> PythonRival:
    """Return a CasADi function on a buffer, float64 as CasADi is; it takes the first row alone.

    Raises
    ------
    ConfigurationError
        If CasADi is not installed.
    """
    xp = casadi_network()
    import casadi

    column = casadi.MX.sym("row", network.widths[0])
    function = casadi.Function("forces", [column], [network.forward(xp, column)])
    row, out = rows[0].astype(np.float64), np.zeros(network.widths[-1])
    buffer: Any
    buffer, evaluate = function.buffer()
    buffer.set_arg(0, memoryview(row.data))
    buffer.set_res(0, memoryview(out.data))
    return PythonRival(evaluate, (), lambda: out[None].copy(), held=(buffer, row, out, function))


def single_blas_thread() -> str:
    """Ask NumPy's OpenBLAS for one thread, and say whether it took it."""
    for library in sorted(Path(np.__file__).parents[1].glob("numpy.libs/libscipy_openblas*")):
        loaded = ctypes.CDLL(str(library))
        for symbol in ("scipy_openblas_set_num_threads64_", "scipy_openblas_set_num_threads"):
            if hasattr(loaded, symbol):
                getattr(loaded, symbol)(1)
                return "1"
    return "as set outside"


def _pairs(network: DenseNetwork) -> list[tuple[Rows, Rows]]:
    return [(np.array(w), np.array(b)) for w, b in zip(network.weights, network.biases, strict=True)]


RIVALS: Final[tuple[Callable[[DenseNetwork, Rows], dict[str, PythonRival]], ...]] = (
    lambda network, rows: {"NumPy": numpy_rival(network, rows)},
    torch_rivals,
    onnx_rivals,
)
