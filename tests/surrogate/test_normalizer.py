import numpy as np
import pytest

from grouser.surrogate import Normalizer
from grouser.terrain import InvalidInputError


def test_fit_gives_zero_mean_and_unit_population_spread() -> None:
    rows = np.random.default_rng(0).normal(3.0, 7.0, (500, 4)) * [1.0, 1e-3, 1e4, 1.0]
    z = Normalizer.fit(rows).normalize(rows)
    np.testing.assert_allclose(z.mean(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(z.std(axis=0), 1.0, rtol=1e-12)


def test_a_constant_column_keeps_its_unit_even_where_its_spread_is_rounding() -> None:
    rows = np.full((1000, 2), [0.1, 7.0])
    assert rows.std(axis=0)[0] > 0
    normalizer = Normalizer.fit(rows)
    np.testing.assert_array_equal(normalizer.scale, 1.0)
    np.testing.assert_allclose(normalizer.normalize(rows), 0.0, atol=1e-12)


def test_denormalize_undoes_normalize() -> None:
    rows = np.random.default_rng(1).normal(size=(50, 3)) * 1e4
    normalizer = Normalizer.fit(rows)
    np.testing.assert_allclose(normalizer.denormalize(normalizer.normalize(rows)), rows, rtol=1e-12)


def test_the_arrays_are_copies_that_cannot_be_written_to() -> None:
    mean = np.zeros(2)
    normalizer = Normalizer(mean, np.ones(2))
    mean[0] = 5.0
    assert normalizer.mean[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        normalizer.scale[0] = 2.0


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_fit_refuses_values_that_are_not_finite(bad: float) -> None:
    rows = np.ones((4, 3))
    rows[2, 1] = bad
    with pytest.raises(InvalidInputError, match=r"not so in columns \[1\]"):
        Normalizer.fit(rows)


@pytest.mark.parametrize("shape", [(3,), (0, 3), (2, 3, 4)])
def test_fit_refuses_other_shapes(shape: tuple[int, ...]) -> None:
    with pytest.raises(InvalidInputError, match=r"shape \(n, d\)"):
        Normalizer.fit(np.zeros(shape))


@pytest.mark.parametrize("scale", [[1.0, 0.0], [1.0, -1.0], [1.0, np.nan]])
def test_a_scale_must_be_positive(scale: list[float]) -> None:
    with pytest.raises(InvalidInputError, match="positive"):
        Normalizer(np.zeros(2), np.array(scale))


def test_mean_and_scale_must_have_one_shape() -> None:
    with pytest.raises(InvalidInputError, match="one shape"):
        Normalizer(np.zeros(2), np.ones(3))
