"""One small array namespace, so that an equation is written once for NumPy, torch and CasADi.

The equations work on scalars or columns of shape (n, 1) against cells of shape (cells,); a CasADi symbol stands for
one sample, against a column of cells.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, Protocol

import numpy as np

from .errors import missing_extra
from .interface import FloatArray


class ArrayNamespace(Protocol):
    """The operations that the equations need."""

    def constant(self, values: FloatArray) -> Any:
        """Return a one-dimensional constant."""

    def columns(self, x: Any) -> list[Any]:
        """Split an interface array (..., d) into d columns of shape (..., 1)."""

    def join(self, parts: Sequence[Any]) -> Any:
        """Join columns to an array (..., len(parts)): the inverse of :meth:`columns`."""

    def total(self, cells: Any) -> Any:
        """Sum over the cells, keeping the column's shape."""

    def sqrt(self, a: Any) -> Any:
        """Square root."""

    def expm1(self, a: Any) -> Any:
        """exp(a) − 1."""

    def tan(self, a: Any) -> Any:
        """Tangent."""

    def sin(self, a: Any) -> Any:
        """Sine."""

    def cos(self, a: Any) -> Any:
        """Cosine."""

    def clip(self, a: Any, low: Any, high: Any) -> Any:
        """Limit to [low, high]."""

    def where(self, condition: Any, a: Any, b: Any) -> Any:
        """Choose elementwise."""


class _Numpy:
    constant = staticmethod(np.asarray)
    sqrt = staticmethod(np.sqrt)
    expm1 = staticmethod(np.expm1)
    tan = staticmethod(np.tan)
    sin = staticmethod(np.sin)
    cos = staticmethod(np.cos)
    clip = staticmethod(np.clip)
    where = staticmethod(np.where)

    @staticmethod
    def columns(x: Any) -> list[Any]:
        return [x[..., i : i + 1] for i in range(x.shape[-1])]

    @staticmethod
    def join(parts: Sequence[Any]) -> Any:
        return np.concatenate(parts, axis=-1)

    @staticmethod
    def total(cells: Any) -> Any:
        return np.sum(cells, axis=-1, keepdims=True)


NUMPY: ArrayNamespace = _Numpy()


@cache
def torch_namespace() -> ArrayNamespace:
    """Return the namespace of float64 torch tensors.

    Raises
    ------
    ConfigurationError
        If torch is not installed.
    """
    try:
        import torch
    except ImportError as error:
        raise missing_extra("torch", "torch") from error

    class _Torch:
        sqrt = staticmethod(torch.sqrt)
        expm1 = staticmethod(torch.expm1)
        tan = staticmethod(torch.tan)
        sin = staticmethod(torch.sin)
        cos = staticmethod(torch.cos)

        @staticmethod
        def where(condition: Any, a: Any, b: Any) -> Any:
            return torch.where(condition, a, b)

        @staticmethod
        def constant(values: FloatArray) -> Any:
            return torch.as_tensor(values, dtype=torch.float64)

        @staticmethod
        def columns(x: Any) -> list[Any]:
            return [x[..., i : i + 1] for i in range(x.shape[-1])]

        @staticmethod
        def join(parts: Sequence[Any]) -> Any:
            return torch.cat(tuple(parts), dim=-1)

        @staticmethod
        def total(cells: Any) -> Any:
            return torch.sum(cells, dim=-1, keepdim=True)

        @staticmethod
        def clip(a: Any, low: Any, high: Any) -> Any:
            return torch.clamp(a, low, high)

    return _Torch()


@cache
def casadi_namespace() -> ArrayNamespace:
    """Return the namespace of CasADi symbols, one sample at a time.

    Raises
    ------
    ConfigurationError
        If CasADi is not installed.
    """
    try:
        import casadi
    except ImportError as error:
        raise missing_extra("casadi", "mpc") from error

    class _Casadi:
        sqrt = staticmethod(casadi.sqrt)
        expm1 = staticmethod(casadi.expm1)
        tan = staticmethod(casadi.tan)
        sin = staticmethod(casadi.sin)
        cos = staticmethod(casadi.cos)
        where = staticmethod(casadi.if_else)

        @staticmethod
        def constant(values: FloatArray) -> Any:
            return casadi.DM(values)

        @staticmethod
        def columns(x: Any) -> list[Any]:
            return [x[i] for i in range(x.numel())]

        @staticmethod
        def join(parts: Sequence[Any]) -> Any:
            return casadi.vertcat(*parts)

        @staticmethod
        def total(cells: Any) -> Any:
            return casadi.sum1(cells)

        @staticmethod
        def clip(a: Any, low: Any, high: Any) -> Any:
            return casadi.fmin(casadi.fmax(a, low), high)

    return _Casadi()
