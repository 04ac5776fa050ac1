"""Single samples, in C and from Python, and batches: our kernels, the physics, and everybody else."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

from ...surrogate import DenseNetwork
from ...terrain import CompiledBackend, FloatArray, GrouserError
from ...terrain.physics import Precision
from .absences import Absences
from .compiled_rivals import PLAIN_FLAGS, plain_network, scalar_physics
from .limits import Limits
from .onnx_in_c import ONNX_IN_C, onnx_in_c, onnx_library
from .python_rivals import RIVALS, casadi_rival
from .subjects import BATCH, GRIDS, NETWORKS, Subjects, folded
from .timing import Burst, Contender, statement
from .toolchain import Toolchain

OURS: Final = "grouser"
WITH_JACOBIAN: Final = "grouser, with Jacobian"
SCALAR: Final = "float64, scalar -O2"
STRUCTURED, GATED = "structured", "structured + detector"
FROM_PYTHON: Final = ("64x64", "128x128")
BATCHED: Final = ("64x64", "128x128", "128x4")
PRECISIONS: Final[tuple[Precision, ...]] = ("float64", "float32")


def grid_name(grid: tuple[int, int]) -> str:
    """Return a grid as tables name it."""
    return "x".join(map(str, grid))


def batched_physics(grid: str, precision: str) -> str:
    """Return the name of the physics on a grid among the batches."""
    return f"physics {grid}, {precision}"


class Calls:
    """What is timed call by call.

    Parameters
    ----------
    subjects : Subjects
        Ours.
    toolchain : Toolchain, optional
        Compiles the rivals in C.
    folder : Path
        Takes what it compiles.
    absent : Absences
        Gets what could not be had.
    """

    def __init__(self, subjects: Subjects, toolchain: Toolchain | None, folder: Path, absent: Absences) -> None:
        self.subjects = subjects
        self._folder = folder
        self._absent = absent
        self._toolchain = toolchain
        self._networks = {name: subjects.native(hidden) for name, hidden in NETWORKS.items()}
        self.limits: Limits | None = None
        if toolchain is None:
            absent["rivals and limits in C"] = "no C compiler: set CC, or install gcc or clang"
        else:
            with absent.noting("limits of the processor"):
                self.limits = Limits(toolchain, folder)

    def networks_in_c(self) -> Iterator[Contender]:
        """Yield single samples in C, each call waiting for the last, and the loops that bound them."""
        rows, subjects = self.subjects.rows, self.subjects
        for name, backend in self._networks.items():
            yield Contender(name, OURS, _in_c(backend, rows))
            if self._toolchain is not None:
                yield from self._rivals_in_c(self._toolchain, name, folded(backend.surrogate))
        others: dict[str, CompiledBackend] = {
            "64x64 silu": subjects.native((64, 64), "silu"),
            "64x64 tanh": subjects.native((64, 64), "tanh"),
            STRUCTURED: subjects.structured,
        }
        for name, other in others.items():
            yield Contender(name, OURS, _in_c(other, rows))
        gate = subjects.gate
        yield Contender(GATED, OURS, _in_c(gate, rows))
        for name, differentiated in {
            "64x64": self._networks["64x64"],
            STRUCTURED: subjects.structured,
            GATED: gate,
        }.items():
            yield Contender(name, WITH_JACOBIAN, _in_c(differentiated, rows, want_jacobian=True))
        if self.limits is not None:
            yield from self.limits.contenders()

    def physics_in_c(self) -> Iterator[Contender]:
        """Yield the compiled physics on every grid, and without vectors."""
        rows = self.subjects.rows
        for grid in GRIDS:
            name = grid_name(grid)
            for precision in PRECISIONS:
                yield Contender(name, precision, _in_c(self.subjects.physics(grid, precision), rows))
            double = self.subjects.physics(grid)
            yield Contender(name, "float64, with Jacobian", _in_c(double, rows, want_jacobian=True))
            if self._toolchain is not None:
                with self._absent.noting(f"physics, {SCALAR}"):
                    yield Contender(name, SCALAR, scalar_physics(self._toolchain, self._folder, double).burst(rows))

    def from_python(self) -> Iterator[Contender]:
        """Yield single samples called from Python."""
        row = self.subjects.rows[0]
        subjects: dict[str, CompiledBackend] = {name: self._networks[name] for name in FROM_PYTHON}
        subjects |= {STRUCTURED: self.subjects.structured, GATED: self.subjects.gate}
        subjects["physics 16x4"] = self.subjects.physics((16, 4))
        for name, backend in subjects.items():
            yield from _from_python(name, backend, row.copy())
        for name in FROM_PYTHON:
            network = folded(self._networks[name].surrogate)
            for make in (*RIVALS, lambda network, rows: {"CasADi, buffer": casadi_rival(network, rows)}):
                yield from self._rivals(name, make, network, row[None].astype(np.float32))

    def batched(self) -> Iterator[Contender]:
        """Yield batches of 256 rows, timed by the row."""
        rows = self.subjects.rows
        given = rows.astype(np.float32)
        for name in BATCHED:
            backend = self._networks[name]
            yield Contender(name, OURS, _by_row(_batch(backend, rows)))
            for make in RIVALS:
                for contender in self._rivals(name, make, folded(backend.surrogate), given):
                    yield contender._replace(burst=_by_row(contender.burst))
        yield Contender(STRUCTURED, OURS, _by_row(_batch(self.subjects.structured, rows)))
        for grid in GRIDS:
            for precision in PRECISIONS:
                physics = _by_row(_batch(self.subjects.physics(grid, precision), rows))
                yield Contender(batched_physics(grid_name(grid), precision), OURS, physics)

    def bound_steps(self) -> dict[str, Callable[[], None]]:
        """Return bound calls whose latency is looked at one by one."""
        row = self.subjects.rows[0]
        chosen: dict[str, CompiledBackend] = {
            "64x64": self._networks["64x64"],
            "128x128": self._networks["128x128"],
            GATED: self.subjects.gate,
        }
        return {name: backend.bind(row.copy(), np.empty(3)) for name, backend in chosen.items()}

    def widths(self) -> dict[str, tuple[int, ...]]:
        """Return the widths of the plain networks, inputs and outputs included."""
        return {name: backend.surrogate.network.widths for name, backend in self._networks.items()}

    def _rivals_in_c(self, toolchain: Toolchain, case: str, network: DenseNetwork) -> Iterator[Contender]:
        rows, library = self.subjects.rows, case.replace("-", "_")
        for index, (rival, flags) in enumerate(PLAIN_FLAGS.items()):
            with self._absent.noting(rival):
                compiled = plain_network(toolchain, self._folder, f"plain_{library}_{index}", network, flags)
                yield Contender(case, rival, compiled.burst(rows))
        with self._absent.noting(ONNX_IN_C):
            called = onnx_in_c(toolchain, self._folder, f"onnx_{library}", network, rows, onnx_library())
            yield Contender(case, ONNX_IN_C, called.burst(rows))

    def _rivals(self, case: str, make: Callable[..., dict[str, Any]], network: Any, rows: Any) -> Iterator[Contender]:
        made: dict[str, Any] = {}
        try:
            made = make(network, rows)
        except GrouserError as error:
            self._absent[str(error).split()[0]] = str(error)
        for name, rival in made.items():
            yield Contender(case, name, rival.burst)


def _in_c(backend: CompiledBackend, rows: FloatArray, *, want_jacobian: bool = False) -> Burst:
    return lambda calls: backend.kernel.time_calls(rows, calls, want_jacobian)


def _batch(backend: CompiledBackend, rows: FloatArray) -> Burst:
    return statement("forces(x, out)", forces=backend.kernel.forces, x=rows, out=np.empty((len(rows), 3)))


def _by_row(burst: Burst) -> Burst:
    return lambda calls: burst(calls) / BATCH


def _from_python(name: str, backend: CompiledBackend, row: FloatArray) -> Iterator[Contender]:
    out = np.empty(3)
    yield Contender(name, "grouser, bound step()", statement("step()", step=backend.bind(row, out)))
    kernel_call = statement("forces(x, out)", forces=backend.kernel.forces, x=row, out=out)
    yield Contender(name, "grouser, kernel.forces", kernel_call)
    yield Contender(name, "grouser, backend.forces", statement("forces(x)", forces=backend.forces, x=row))
