"""The C view of a compiled backend's kernel, as other compiled code gets it from its capsule."""

import ctypes
import enum
from typing import Any

import numpy as np

from grouser.terrain import FloatArray

BLOCK = 16
_MAXIMUM_COLUMNS = 11
_double_p = ctypes.POINTER(ctypes.c_double)


class _Rows(ctypes.Structure):
    _fields_ = (("column", (ctypes.c_double * BLOCK) * _MAXIMUM_COLUMNS),)


class _Forces(ctypes.Structure):
    _fields_ = (
        ("force", (ctypes.c_double * BLOCK) * 3),
        ("slope", ((ctypes.c_double * BLOCK) * 3) * 3),
    )


class _Kernel(ctypes.Structure):
    _fields_ = (
        ("self", ctypes.c_void_p),
        ("columns", ctypes.c_int),
        ("evaluate", ctypes.CFUNCTYPE(None, ctypes.c_void_p, _double_p, _double_p, _double_p)),
        ("refuses", ctypes.CFUNCTYPE(ctypes.c_char_p, ctypes.c_void_p, _double_p)),
        ("evaluate_track", ctypes.CFUNCTYPE(None, ctypes.c_void_p, _double_p, ctypes.c_int, _double_p, _double_p)),
        (
            "evaluate_block",
            ctypes.CFUNCTYPE(
                None,
                ctypes.c_void_p,
                ctypes.POINTER(_Rows),
                ctypes.POINTER(_Rows),
                _double_p,
                ctypes.c_int,
                ctypes.POINTER(_Forces),
            ),
        ),
        ("evaluate_rows", ctypes.c_void_p),
        (
            "evaluate_body",
            ctypes.CFUNCTYPE(None, ctypes.c_void_p, _double_p, _double_p, ctypes.c_int, _double_p, _double_p),
        ),
        (
            "prepare_block",
            ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.POINTER(_Rows), ctypes.POINTER(_Rows), _double_p),
        ),
        ("prepared_rows", ctypes.c_int),
    )


def kernel_of(compiled: Any) -> _Kernel:
    """Return the kernel behind an object of ``grouser.native``; it must outlive the result."""
    read = ctypes.pythonapi.PyCapsule_GetPointer
    read.restype, read.argtypes = ctypes.c_void_p, (ctypes.py_object, ctypes.c_char_p)
    return _Kernel.from_address(read(compiled.kernel, b"grouser.kernel"))


class Slopes(enum.IntEnum):
    """Those that are wanted, as in the C header."""

    NONE = 0
    LEADING = 1
    EXACT = 2


def _block_rows(x: FloatArray) -> _Rows:
    rows = _Rows()
    for column, values in enumerate(x.T):
        rows.column[column][:] = values.tolist()
    return rows


def block_forces(
    compiled: Any,
    left: FloatArray,
    right: FloatArray,
    wanted: Slopes = Slopes.EXACT,
    *,
    prepared_from: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return forces (16, 3) and slopes by vx, vy, yaw rate (16, 3, 3) of 16 rows a track.

    They are prepared from other rows if there are such, of both tracks.
    """
    kernel = kernel_of(compiled)
    rows = [_block_rows(x) for x in (left, right)]
    given = rows if prepared_from is None else [_block_rows(prepared_from)] * 2
    out = _Forces()
    numbers = np.empty((kernel.prepared_rows, BLOCK))
    prepared = numbers.ctypes.data_as(_double_p)
    if kernel.prepare_block:
        kernel.prepare_block(kernel.self, given[0], given[1], prepared)
    kernel.evaluate_block(kernel.self, rows[0], rows[1], prepared, wanted, out)
    return np.array(out.force).T, np.moveaxis(np.array(out.slope), -1, 0)


def body_forces(
    compiled: Any, left: FloatArray, right: FloatArray | None, wanted: Slopes = Slopes.EXACT
) -> tuple[FloatArray, FloatArray]:
    """Return forces (3,) and slopes by vx, vy, yaw rate (3, 3) of one row, or of one a track."""
    kernel = kernel_of(compiled)
    forces, slopes = np.empty(3), np.empty((3, 3))
    x, y, q, dq = (None if a is None else a.ctypes.data_as(_double_p) for a in (left, right, forces, slopes))
    kernel.evaluate_body(kernel.self, x, y, wanted, q, dq)
    return forces, slopes
