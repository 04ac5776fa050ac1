"""A checksum over the tables of an export, so that its self-test sees every altered number."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

_OFFSET: Final = 14695981039346656037
_PRIME: Final = 1099511628211
_MASK: Final = (1 << 64) - 1


class Checksum:
    """FNV-1a over the bit patterns of numbers, whole words at a time: the same on every byte order."""

    def __init__(self) -> None:
        self.value = _OFFSET

    def add(self, values: NDArray[Any]) -> None:
        """Take in an array of float32 or float64."""
        words = np.ascontiguousarray(values).view(np.uint32 if values.dtype == np.float32 else np.uint64)
        for word in words.ravel().tolist():
            self.value = ((self.value ^ word) * _PRIME) & _MASK
