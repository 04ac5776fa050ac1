"""An exported artifact, compiled and called through ctypes."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from grouser.envs import BeltCommand
from grouser.terrain import FloatArray

WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror")
GCC = shutil.which("gcc")
CLANG = shutil.which("clang")
GUARDED, SURROGATE_ALONE, FALLBACK_ALONE = range(3)
REFUSED = 16
MAX_COLUMNS = 11


class Detection(ctypes.Structure):
    _fields_ = (("score", ctypes.c_double), ("reason", ctypes.c_int), ("worst_column", ctypes.c_int))


class GuardState(ctypes.Structure):
    _fields_ = (
        ("mode", ctypes.c_int),
        ("samples", ctypes.c_int),
        ("flags", ctypes.c_uint32),
        ("dwell", ctypes.c_double),
        ("calm", ctypes.c_double),
        ("fallback_weight", ctypes.c_double),
    )


class VehicleState(ctypes.Structure):
    _fields_ = (
        *(
            (name, ctypes.c_double)
            for name in ["x", "y", "heading", "vx", "vy", "yaw_rate", "v_left", "v_right", "ax", "ay", "time"]
        ),
        ("guard", GuardState),
    )


class TickRecord(ctypes.Structure):
    _fields_ = (
        ("row", ctypes.c_double * MAX_COLUMNS),
        ("force", ctypes.c_double * 3),
        ("iterations", ctypes.c_int),
        ("divisions", ctypes.c_int),
        ("detection", Detection),
    )


def compiled(command: Sequence[str | Path], cwd: Path) -> None:
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False, cwd=cwd)
    assert done.returncode == 0, f"{' '.join(map(str, command))}\n{done.stderr[:4000]}"


class Exported:
    """The functions of one export.

    Parameters
    ----------
    folder : Path
        Of the export.
    name : str
        After ``grouser_``.
    library : Path
        Shared library made of it.
    """

    def __init__(self, folder: Path, name: str, library: Path, columns: int) -> None:
        self.folder, self.prefix, self.columns = folder, f"grouser_{name}", columns
        self._library = ctypes.CDLL(str(library))
        for function, result in (
            ("score", Detection),
            ("fresh_guard", GuardState),
            ("at_rest", VehicleState),
        ):
            self.function(function).restype = result

    @property
    def source(self) -> Path:
        return self.folder / f"{self.prefix}.c"

    def function(self, name: str) -> ctypes._NamedFuncPointer:
        function: ctypes._NamedFuncPointer = getattr(self._library, f"{self.prefix}_{name}")
        return function

    def call(self, name: str) -> int:
        return int(self.function(name)())

    def text(self, name: str, size: int) -> str:
        return (ctypes.c_char * size).in_dll(self._library, f"{self.prefix}_{name}").value.decode()

    def forces(self, source: str, x: FloatArray) -> FloatArray:
        return np.array([self._evaluate(source, row, None)[0] for row in x])

    def jacobian(self, source: str, x: FloatArray) -> FloatArray:
        return np.array([self._evaluate(source, row, np.empty((3, self.columns)))[1] for row in x])

    def _evaluate(self, source: str, row: FloatArray, jacobian: FloatArray | None) -> tuple[FloatArray, object]:
        force = np.empty(3)
        status = self.function(f"{source}_forces")(
            _pointer(row), _pointer(force), None if jacobian is None else _pointer(jacobian)
        )
        assert status == 0
        return force, jacobian

    def refuses(self, row: FloatArray) -> int:
        return int(self.function("refused_column")(_pointer(row)))

    def score(self, row: FloatArray) -> Detection:
        detection: Detection = self.function("score")(_pointer(row))
        return detection

    def guarded(self, guard: GuardState, elapsed: float, row: FloatArray) -> tuple[FloatArray, FloatArray, Detection]:
        force, by_body, detection = np.empty(3), np.empty((3, 3)), Detection()
        status = self.function("guarded_forces")(
            ctypes.byref(guard),
            ctypes.c_double(elapsed),
            _pointer(row),
            _pointer(force),
            _pointer(by_body),
            ctypes.byref(detection),
        )
        assert status == 0
        return force, by_body, detection

    def tick(
        self,
        source: int,
        command: BeltCommand,
        terrain: FloatArray,
        state: VehicleState,
        *,
        seconds: float = 0.01,
        slope: FloatArray | None = None,
    ) -> tuple[int, TickRecord]:
        record = TickRecord()
        status = self.function("vehicle_tick")(
            source,
            ctypes.c_double(seconds),
            _pointer(np.array(command, dtype=np.float64)),
            _pointer(np.array(terrain, dtype=np.float64)),
            None if slope is None else _pointer(slope),
            ctypes.byref(state),
            ctypes.byref(record),
        )
        return int(status), record


def _pointer(array: FloatArray) -> ctypes.c_void_p:
    assert array.dtype == np.float64
    assert array.flags.c_contiguous
    return ctypes.c_void_p(array.ctypes.data)
