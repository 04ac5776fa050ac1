"""Numbers, arrays and structs as C literals that a compiler reads back to the same bits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...terrain import ArtifactError, ConfigurationError, FloatArray
from .declarations import struct_fields

_WIDTH: Final = 114


def double(value: float) -> str:
    """Return a double literal: the fewest digits that name this number and no other.

    Raises
    ------
    ArtifactError
        If it is not finite.
    """
    if not math.isfinite(value):
        raise ArtifactError(f"an export holds finite numbers, got {value!r}")
    return repr(float(value))


def single(value: np.float32) -> str:
    """Return a float literal; as :func:`double`."""
    if not np.isfinite(value):
        raise ArtifactError(f"an export holds finite weights, got {value!r}")
    text = str(value)
    return f"{text}f" if "." in text or "e" in text else f"{text}.0f"


def braced(items: Sequence[str]) -> str:
    """Return ``{a, b, ...}``, on several lines where it is long."""
    lines, current = [], ""
    for item in items:
        longer = f"{current}, {item}" if current else item
        if len(longer) > _WIDTH:
            lines.append(current)
            longer = item
        current = longer
    lines.append(current)
    return f"{{{lines[0]}}}" if len(lines) == 1 else "{\n  " + ",\n  ".join(lines) + "}"


def doubles(values: FloatArray) -> str:
    """Return an array of doubles, row-major, as a braced list."""
    return braced([double(value) for value in np.asarray(values, dtype=np.float64).ravel().tolist()])


def rows(values: FloatArray) -> str:
    """Return a matrix of doubles as a list of its rows, each of which may be shorter than C's."""
    return "{" + ",\n   ".join(doubles(row) for row in values) + "}"


def singles(values: NDArray[np.float32]) -> str:
    """Return an array of floats, row-major, as a braced list."""
    return braced([single(value) for value in values.ravel()])


def table(name: str, kind: str, values: str, size: int) -> str:
    """Return the definition of a constant array."""
    return f"static const {kind} {name}[{size}] = {values};\n"


def struct(header: str, kind: str, values: Mapping[str, str]) -> str:
    """Return a struct's initializer, its values in the order in which the header declares the fields.

    Raises
    ------
    ConfigurationError
        If the header's fields are not those of ``values``.
    """
    fields = struct_fields(header, kind)
    if set(fields) != set(values):
        raise ConfigurationError(
            f"the C core's {kind} has the fields {', '.join(fields)}, the export knows {', '.join(values)}; "
            "install grouser again"
        )
    return "{" + ",\n  ".join(values[field] for field in fields) + "}"
