"""ONNX Runtime called from C: its library comes with the Python package, its header does not."""

from __future__ import annotations

import ctypes
from importlib.util import find_spec
from pathlib import Path
from typing import Final

import numpy as np

from ...surrogate import NUMPY_NETWORK, DenseNetwork
from ...terrain import ConfigurationError, FloatArray, missing_extra
from .compiled_rivals import TIMER, CompiledRival
from .python_rivals import onnx_model, silence_onnx_runtime
from .toolchain import Toolchain, Unit

#: The name that it has in tables.
ONNX_IN_C: Final = "ONNX Runtime, C API"
_LIBRARIES: Final = ("libonnxruntime.so*", "libonnxruntime.*dylib")
_TOLERANCE: Final = 1e-4

# The library hands out one table of functions, to which versions only append: a function is known by its place. Version
# 20 is that of the oldest package that the extra asks for. Session and binding live as long as the process.
_SOURCE: Final = """\
#include <math.h>
#include <stdint.h>
#include <stdio.h>
enum {
  GetErrorMessage = 2, CreateEnv = 3, CreateSessionFromArray = 8, CreateSessionOptions = 10,
  SetSessionExecutionMode = 13, SetSessionGraphOptimizationLevel = 23, SetIntraOpNumThreads = 24,
  SetInterOpNumThreads = 25, CreateRunOptions = 39, CreateTensorWithDataAsOrtValue = 49, CreateCpuMemoryInfo = 69,
  ReleaseStatus = 93, ReleaseMemoryInfo = 94, ReleaseSessionOptions = 100, RunWithBinding = 133, CreateIoBinding = 134,
  BindInput = 136, BindOutput = 137
};
enum { API_VERSION = 20, WARNINGS = 2, SEQUENTIAL = 0, ENABLE_ALL = 99, ARENA = 1, DEFAULT_MEMORY = 0, FLOAT32 = 1 };
typedef struct object object;
typedef void function(void);
typedef struct {
  function *const *(*functions)(uint32_t version);
  const char *(*version)(void);
} entry;

static function *const *functions;
static object *session, *run_options, *binding;
static _Alignas(64) float values[%(inputs)d], results[%(outputs)d];
static char message[200];

#define CALL(name, ...) ((object *(*)(__VA_ARGS__)) functions[name])
#define RELEASE(name, what) ((void (*)(object *))functions[name])(what)
#define TRY(status) if (failed(status)) return message

static int failed(object *status) {
  if (status == NULL) return 0;
  snprintf(message, sizeof message, "%%s",
           ((const char *(*)(const object *))functions[GetErrorMessage])(status));
  RELEASE(ReleaseStatus, status);
  return 1;
}

static object *bind(object *memory, int place, const char *name, float *data, int64_t count) {
  const int64_t shape[2] = {1, count};
  object *tensor = NULL;
  object *status = CALL(CreateTensorWithDataAsOrtValue, const object *, void *, size_t, const int64_t *, size_t, int,
                        object **)(memory, data, (size_t)count * sizeof *data, shape, 2, FLOAT32, &tensor);
  return status != NULL ? status : CALL(place, object *, const char *, const object *)(binding, name, tensor);
}

const char *load(const entry *library, const void *model, size_t size) {
  static const int settings[][2] = {{SetSessionExecutionMode, SEQUENTIAL},
                                    {SetSessionGraphOptimizationLevel, ENABLE_ALL},
                                    {SetIntraOpNumThreads, 1},
                                    {SetInterOpNumThreads, 1}};
  object *environment = NULL, *options = NULL, *memory = NULL;
  functions = library->functions(API_VERSION);
  if (functions == NULL) {
    snprintf(message, sizeof message, "version %%s has no C API %%d", library->version(), API_VERSION);
    return message;
  }
  TRY(CALL(CreateEnv, int, const char *, object **)(WARNINGS, "grouser", &environment));
  TRY(CALL(CreateSessionOptions, object **)(&options));
  for (size_t n = 0; n < sizeof settings / sizeof settings[0]; n++)
    TRY(CALL(settings[n][0], object *, int)(options, settings[n][1]));
  TRY(CALL(CreateSessionFromArray, const object *, const void *, size_t, const object *, object **)(
      environment, model, size, options, &session));
  RELEASE(ReleaseSessionOptions, options);
  TRY(CALL(CreateRunOptions, object **)(&run_options));
  TRY(CALL(CreateIoBinding, object *, object **)(session, &binding));
  TRY(CALL(CreateCpuMemoryInfo, int, int, object **)(ARENA, DEFAULT_MEMORY, &memory));
  TRY(bind(memory, BindInput, "rows", values, %(inputs)d));
  TRY(bind(memory, BindOutput, "forces", results, %(outputs)d));
  RELEASE(ReleaseMemoryInfo, memory);
  return NULL;
}

void evaluate(const double *row, double *forces) {
  for (int i = 0; i < %(inputs)d; i++) values[i] = (float)row[i];
  const object *status =
      CALL(RunWithBinding, object *, const object *, const object *)(session, run_options, binding);
  for (int i = 0; i < %(outputs)d; i++) forces[i] = status == NULL ? (double)results[i] : NAN;
}
"""


def onnx_in_c(
    toolchain: Toolchain, folder: Path, name: str, network: DenseNetwork, rows: FloatArray, shared: Path
) -> CompiledRival:
    """Return a ReLU network in ONNX Runtime, called through its C API: one float32 sample, bound memory, one thread.

    Parameters
    ----------
    toolchain : Toolchain
        Compiles what calls it.
    folder : Path
        Takes the files.
    name : str
        Of the library that calls it; each only once, since a loaded one stays.
    network : DenseNetwork
        From interface columns to forces.
    rows : ndarray, shape (n, d)
        Over which its forces have to be the network's.
    shared : Path
        ONNX Runtime's library, as of :func:`onnx_library`.

    Raises
    ------
    ConfigurationError
        If onnx is not installed, the compiler or ONNX Runtime refuses, or the forces are others.
    """
    silence_onnx_runtime()
    runtime = ctypes.CDLL(str(shared))
    runtime.OrtGetApiBase.restype = ctypes.c_void_p
    model = onnx_model(network, 1)
    source = _SOURCE % {"inputs": network.widths[0], "outputs": network.widths[-1]}
    library = toolchain.library(folder, name, [Unit(TIMER, ("-O2",)), Unit(source, ("-O2",))])
    library.load.restype = ctypes.c_char_p
    refusal = library.load(ctypes.c_void_p(runtime.OrtGetApiBase()), model, ctypes.c_size_t(len(model)))
    if refusal is not None:
        raise ConfigurationError(f"ONNX Runtime refuses: {refusal.decode(errors='replace')}")
    rival = CompiledRival(library)
    expected = network.forward(NUMPY_NETWORK, rows)
    error = (np.abs(rival.forces(rows) - expected) / np.abs(expected).max(axis=0)).max()
    if not error < _TOLERANCE:
        raise ConfigurationError(f"ONNX Runtime's forces, called from C, are off by {error:.1e} of the largest")
    return rival


def onnx_library() -> Path:
    """Return the library that comes with the package ``onnxruntime``.

    Raises
    ------
    ConfigurationError
        If the package is not installed or has none.
    """
    package = find_spec("onnxruntime")
    if package is None or package.origin is None:
        raise missing_extra("onnxruntime", "bench")
    place = Path(package.origin).parent / "capi"
    found = sorted(file for pattern in _LIBRARIES for file in place.glob(pattern))
    if not found:
        raise ConfigurationError("the onnxruntime that is installed has no library that C could call")
    return found[0]
