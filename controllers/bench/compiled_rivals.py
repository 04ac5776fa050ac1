"""C compiled on this machine: networks as a hand export writes them, scalar physics, and what the processor can do."""

from __future__ import annotations

import ctypes
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from ...surrogate import DenseNetwork
from ...terrain import MODES, OUTPUT_NAMES, FloatArray, PhysicsBackend, block_geometry
from .timing import Burst
from .toolchain import Toolchain, Unit, core_sources

#: Flags by the name that a rival has in tables.
PLAIN_FLAGS: Final = {
    "plain C, -O2": ("-O2",),
    "plain C, -O3 -march=native -ffast-math": ("-O3", "-march=native", "-ffast-math"),
}
#: The project's physics without vectors.
SCALAR_FLAGS: Final = ("-O2", "-DGROUSER_SCALAR", "-fno-tree-vectorize", "-ffp-contract=off", "-fno-math-errno")

# As time_calls of the core: every call takes a little of the last one's force into its row.
TIMER: Final = """\
#include <string.h>
#include <time.h>
static double now_ns(void) {
  struct timespec t;
  timespec_get(&t, TIME_UTC);
  return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}
double time_calls(void (*evaluate)(const double *, double *), const double *x, long rows, int columns, long calls) {
  double row[16], forces[3] = {0, 0, 0};
  const double begin = now_ns();
  for (long call = 0; call < calls; call++) {
    memcpy(row, x + (call % rows) * columns, sizeof(double) * (size_t)columns);
    row[0] += 1e-300 * forces[0];
    evaluate(row, forces);
  }
  return (now_ns() - begin) / (double)calls;
}
"""

_PHYSICS: Final = """\
#define GROUSER_CORE static
#include "load.c"
#include "soft_cells.c"
#include "soft_cells_single.c"
#include "exact_cells.c"
#include "physics.c"
static const grouser_physics block = {
  .mode = %(mode)d, .contact = %(contact)d, .path = 0, .precision = 0, .wheels = %(wheels)d,
  .along = %(along)d, .across = %(across)d, .mass = %(mass)r, .gravity = %(gravity)r,
  .contact_length = %(contact_length)r, .element_length = %(element_length)r,
  .element_spacing = %(element_spacing)r, .tread = %(tread)r, .track_width = %(track_width)r,
  .cg_height = %(cg_height)r, .contact_center = %(contact_center)r, .soft_speed = %(soft_speed)r};
void evaluate(const double *row, double *forces) { grouser_physics_forces(&block, row, forces, NULL); }
"""


class CompiledRival:
    """A force function in a library compiled here.

    Parameters
    ----------
    library : ctypes.CDLL
        With ``time_calls`` and the function.
    symbol : str
        Name of the function: float64 row in, three float64 forces out.
    """

    def __init__(self, library: ctypes.CDLL, symbol: str = "evaluate") -> None:
        self._library = library
        self._evaluate = library[symbol]
        library.time_calls.restype = ctypes.c_double

    def forces(self, rows: FloatArray) -> FloatArray:
        """Return the forces, shape (n, 3), of rows (n, d)."""
        out = np.empty((len(rows), len(OUTPUT_NAMES)))
        for row, force in zip(np.ascontiguousarray(rows), out, strict=True):
            self._evaluate(ctypes.c_void_p(row.ctypes.data), ctypes.c_void_p(force.ctypes.data))
        return out

    def burst(self, rows: FloatArray) -> Burst:
        """Return what times calls, each waiting for the last, in turn on the rows."""
        held = np.ascontiguousarray(rows)

        def run(calls: int) -> float:
            time: float = self._library.time_calls(
                self._evaluate,
                ctypes.c_void_p(held.ctypes.data),
                ctypes.c_long(len(held)),
                ctypes.c_int(held.shape[1]),
                ctypes.c_long(calls),
            )
            return time

        return run


def plain_network(
    toolchain: Toolchain, folder: Path, name: str, network: DenseNetwork, flags: tuple[str, ...]
) -> CompiledRival:
    """Compile a ReLU network as a hand export writes it: row-wise dot products over arrays, one float32 sample.

    Parameters
    ----------
    toolchain : Toolchain
        The compiler.
    folder : Path
        Takes the files.
    name : str
        Of the library; each only once, since a loaded one stays.
    network : DenseNetwork
        From interface columns to forces.
    flags : tuple of str
        For the compiler.
    """
    library = toolchain.library(folder, name, [Unit(TIMER, ("-O2",)), Unit(plain_source(network.widths), flags)])
    packed = b"".join(
        np.ascontiguousarray(weights.T).tobytes() + biases.tobytes()
        for weights, biases in zip(network.weights, network.biases, strict=True)
    )
    library.load(packed)
    return CompiledRival(library)


def plain_source(widths: tuple[int, ...]) -> str:
    """Return the C text of a ReLU network of these widths, inputs and outputs included."""
    lines = ["#include <string.h>"]
    loads, layers = [], []
    last = len(widths) - 2
    for layer, (inputs, outputs) in enumerate(pairwise(widths)):
        lines.append(f"static float weights_{layer}[{outputs}][{inputs}], biases_{layer}[{outputs}];")
        loads += [
            f"  memcpy({array}_{layer}, from, sizeof {array}_{layer}); from += sizeof {array}_{layer};"
            for array in ("weights", "biases")
        ]
        result = "forces[n] = (double)sum" if layer == last else f"value_{layer + 1}[n] = sum > 0.0f ? sum : 0.0f"
        layers += [
            *([] if layer == last else [f"  float value_{layer + 1}[{outputs}];"]),
            f"  for (int n = 0; n < {outputs}; n++) {{",
            f"    float sum = biases_{layer}[n];",
            f"    for (int i = 0; i < {inputs}; i++) sum += weights_{layer}[n][i] * value_{layer}[i];",
            f"    {result};",
            "  }",
        ]
    return "\n".join(
        [
            *lines,
            "void load(const char *from) {",
            *loads,
            "}",
            "void evaluate(const double *row, double *forces) {",
            f"  float value_0[{widths[0]}];",
            f"  for (int i = 0; i < {widths[0]}; i++) value_0[i] = (float)row[i];",
            *layers,
            "}",
            "",
        ]
    )


def scalar_physics(toolchain: Toolchain, folder: Path, backend: PhysicsBackend) -> CompiledRival:
    """Compile the project's own physics for one number at a time.

    Raises
    ------
    ConfigurationError
        If the core's sources are not installed or the compiler refuses.
    """
    place = core_sources(folder)
    grid = backend.grid
    text = _PHYSICS % (
        block_geometry(backend.vehicle)
        | {
            "mode": MODES.index(backend.mode),
            "along": grid.along,
            "across": grid.across,
            "soft_speed": backend.soft_speed,
        }
    )
    flags = (*SCALAR_FLAGS, f"-I{place / 'src'}", f"-I{place / 'include'}")
    name = f"physics_{grid.along}_{grid.across}"
    return CompiledRival(toolchain.library(folder, name, [Unit(TIMER, ("-O2",)), Unit(text, flags)]))
