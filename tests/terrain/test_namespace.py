"""The array namespaces: the same operations for NumPy, torch and CasADi."""

import sys

import numpy as np
import pytest

from grouser.terrain import NUMPY, ConfigurationError, casadi_namespace, torch_namespace


@pytest.mark.parametrize("shape", [(10,), (7, 10)])
def test_columns_split_an_array_and_join_puts_it_together(shape: tuple[int, ...]) -> None:
    x = np.random.default_rng(0).normal(size=shape)
    columns = NUMPY.columns(x)
    assert len(columns) == 10
    assert columns[0].shape == (*shape[:-1], 1)
    np.testing.assert_array_equal(NUMPY.join(columns), x)


def test_a_total_keeps_the_shape_of_a_column() -> None:
    assert NUMPY.total(np.ones((7, 20))).shape == (7, 1)


@pytest.mark.parametrize(
    ("package", "extra", "build"), [("torch", "torch", torch_namespace), ("casadi", "mpc", casadi_namespace)]
)
def test_a_missing_package_is_answered_with_its_extra(
    package: str, extra: str, build: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    uncached = build.__wrapped__  # type: ignore[attr-defined]
    with pytest.raises(ConfigurationError, match=rf"grouser\[{extra}\]"):
        uncached()
