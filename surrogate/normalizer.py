"""Affine scaling of columns to zero mean and unit spread, in float64."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..terrain import NUMPY, ArrayNamespace, FloatArray, InvalidInputError


@dataclass(frozen=True, eq=False)
class Normalizer:
    """z = (x − mean)/scale, column by column.

    Parameters
    ----------
    mean, scale : ndarray, shape (d,)
        In the units of the columns; every scale is positive.

    Raises
    ------
    InvalidInputError
        If the shapes differ, a value is not finite or a scale is not positive.
    """

    mean: FloatArray
    scale: FloatArray

    def __post_init__(self) -> None:
        for name in ("mean", "scale"):
            object.__setattr__(self, name, frozen_array(getattr(self, name), np.float64))
        if self.mean.ndim != 1 or self.mean.shape != self.scale.shape:
            raise InvalidInputError(
                f"a normalizer takes mean and scale of one shape (d,), got {self.mean.shape} and {self.scale.shape}"
            )
        if not (np.isfinite(self.mean).all() and np.isfinite(self.scale).all() and (self.scale > 0).all()):
            raise InvalidInputError("a normalizer's mean must be finite and its scale finite and positive")

    @classmethod
    def fit(cls, array: FloatArray) -> Normalizer:
        """Return mean and population standard deviation of the columns; a constant column keeps its unit.

        Parameters
        ----------
        array : ndarray, shape (n, d)
            At least one row.

        Raises
        ------
        InvalidInputError
            If the array has another shape, is empty, or holds NaN or infinity.
        """
        rows = np.asarray(array, dtype=np.float64)
        if rows.ndim != 2 or rows.size == 0:
            raise InvalidInputError(f"a normalizer is fitted to an array of shape (n, d), got {rows.shape}")
        if not np.isfinite(rows).all():
            bad = sorted({int(column) for column in np.argwhere(~np.isfinite(rows))[:, 1]})
            raise InvalidInputError(f"a normalizer is fitted to finite values; not so in columns {bad}")
        # The spread of a constant column is rounding, not zero: ask its extremes instead.
        constant = rows.min(axis=0) == rows.max(axis=0)
        return cls(rows.mean(axis=0), np.where(constant, 1.0, rows.std(axis=0)))

    @property
    def size(self) -> int:
        """Number of columns d."""
        return len(self.mean)

    def normalize(self, x: Any, xp: ArrayNamespace = NUMPY) -> Any:
        """Return (x − mean)/scale for an array (..., d), or a CasADi column (d, 1)."""
        return (x - _constant(xp, self.mean)) / _constant(xp, self.scale)

    def denormalize(self, z: Any, xp: ArrayNamespace = NUMPY) -> Any:
        """Return mean + scale·z for an array (..., d), or a CasADi column (d, 1)."""
        return _constant(xp, self.mean) + _constant(xp, self.scale) * z


def frozen_array(values: Any, dtype: type[np.floating[Any]]) -> Any:
    """Return a contiguous copy that cannot be written to.

    Raises
    ------
    InvalidInputError
        If the values are not numbers.
    """
    try:
        array = np.array(values, dtype=dtype, order="C")
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"expected an array of numbers: {error}") from error
    array.setflags(write=False)
    return array


def _constant(xp: ArrayNamespace, values: FloatArray) -> Any:
    # torch warns where it would share memory that is not writable.
    return values if xp is NUMPY else xp.constant(values.copy())
