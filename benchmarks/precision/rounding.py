"""Float32 arrays rounded to fewer bits, to the nearest and to even in a tie."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grouser.terrain import InvalidInputError

Floats = NDArray[np.float32]

#: Largest code of a signed byte: −128 is left out, so that the codes are symmetric.
SIGNED: Final = 127
#: Largest code of an unsigned byte.
UNSIGNED: Final = 255
_DROPPED: Final = 16


def to_bfloat16(values: NDArray[np.floating]) -> Floats:
    """Return the nearest numbers of 8 exponent and 7 stored fraction bits, as float32; NaN stays NaN."""
    single = np.ascontiguousarray(values, dtype=np.float32)
    return widened(bfloat16_bits(single))


def bfloat16_bits(values: Floats) -> NDArray[np.uint16]:
    """Return the upper halves of the rounded float32 numbers, shape as given."""
    bits = np.ascontiguousarray(values).view(np.uint32)
    # Half a unit of what stays, less one where that is even already: a tie then goes to even.
    rounded = (bits + (0x7FFF + ((bits >> _DROPPED) & 1))) >> _DROPPED
    return np.where(np.isnan(values), 0x7FC0, rounded).astype(np.uint16)


def widened(bits: NDArray[np.uint16]) -> Floats:
    """Return the float32 numbers of which these are the upper halves."""
    return (bits.astype(np.uint32) << _DROPPED).view(np.float32)


def to_float16(values: NDArray[np.floating]) -> Floats:
    """Return the nearest numbers of IEEE's half precision, as float32.

    Raises
    ------
    InvalidInputError
        If a finite number is beyond its range, 65504.
    """
    single = np.asarray(values, dtype=np.float32)
    with np.errstate(over="ignore"):
        rounded = single.astype(np.float16).astype(np.float32)
    if not np.array_equal(np.isfinite(rounded), np.isfinite(single)):
        raise InvalidInputError(f"float16 holds numbers up to 65504, got {np.nanmax(np.abs(single)):g}")
    return rounded


class Codes(NamedTuple):
    """Whole numbers and what one of them is worth.

    Parameters
    ----------
    codes : ndarray, shape (inputs, outputs) or (..., inputs)
        Bytes: signed ones of weights, and of activations that may be negative; else unsigned ones.
    scales : ndarray, shape (outputs,) or (..., 1)
        float32, positive.
    """

    codes: NDArray[np.integer]
    scales: Floats

    @property
    def values(self) -> Floats:
        """What the codes stand for, in float32."""
        return self.codes.astype(np.float32) * self.scales


def weight_codes(weights: Floats) -> Codes:
    """Return symmetric signed bytes with one scale for each output: its largest weight is ±127.

    Parameters
    ----------
    weights : ndarray, shape (inputs, outputs)
        Finite.
    """
    scales = _scales(np.abs(weights).max(axis=0), SIGNED)
    return Codes(np.rint(weights / scales).astype(np.int8), scales)


def activation_codes(values: NDArray[np.floating], *, signed: bool) -> Codes:
    """Return bytes with one scale for each row, taken from its largest value: what is rounded while it is computed.

    Parameters
    ----------
    values : ndarray, shape (..., inputs)
        Finite, and not negative where unsigned bytes are asked for.
    signed : bool
        Whether codes go from −127 to 127, or from 0 to 255.
    """
    single = np.asarray(values, dtype=np.float32)
    scales = _scales(np.abs(single).max(axis=-1, keepdims=True), SIGNED if signed else UNSIGNED)
    return Codes(np.rint(single / scales).astype(np.int8 if signed else np.uint8), scales)


def _scales(largest: Floats, most: int) -> Floats:
    # A unit without weights, or a layer that is silent, has the codes 0 at any scale; so has one of denormals alone.
    scales = (largest / np.float32(most)).astype(np.float32)
    return np.where(scales < np.finfo(np.float32).tiny, np.float32(1.0), scales)
