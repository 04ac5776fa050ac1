"""The interface table: columns, order, mirror, and what `check` lets in."""

import numpy as np
import pytest

from grouser.native import _core
from grouser.terrain import (
    MODES,
    MOTION_NAMES,
    OUTPUT_NAMES,
    RIGID,
    SOIL,
    ConfigurationError,
    InvalidInputError,
    Mode,
    interface,
    mirror_forces,
    reverse_forces,
)

MOTION = ("vx", "vy", "yaw_rate", "ax", "ay", "v_left", "v_right")


def test_the_columns_stand_in_the_order_of_the_paper() -> None:
    assert RIGID.names == (*MOTION, "mu", "fr", "k")
    assert SOIL.names == (*MOTION, "c", "phi", "fr", "k")
    assert MOTION_NAMES == MOTION
    assert OUTPUT_NAMES == ("qx", "qy", "mz")


def test_a_mode_knows_its_size_and_parameters() -> None:
    assert (RIGID.size, SOIL.size) == (10, 11)
    assert RIGID.parameter_names == ("mu", "fr", "k")
    assert SOIL.parameter_names == ("c", "phi", "fr", "k")


@pytest.mark.parametrize("mode", MODES)
def test_the_compiled_column_table_is_the_same(mode: Mode) -> None:
    assert _core.columns(MODES.index(mode)) == interface(mode).names


def test_an_index_is_the_position_of_a_name() -> None:
    assert SOIL.index("phi") == 8


def test_an_unknown_column_is_answered_with_the_nearest() -> None:
    with pytest.raises(ConfigurationError, match="did you mean 'v_left'"):
        RIGID.index("v_lft")


def test_an_unknown_mode_is_answered_with_the_nearest() -> None:
    with pytest.raises(ConfigurationError, match="did you mean 'soil'"):
        interface("sooil")


def test_the_mirror_exchanges_the_belts_and_turns_the_lateral_signs() -> None:
    x = np.arange(1.0, 11.0)
    np.testing.assert_array_equal(RIGID.mirror(x), [1, -2, -3, 4, -5, 7, 6, 8, 9, 10])
    np.testing.assert_array_equal(mirror_forces(np.array([1.0, 2.0, 3.0])), [1, -2, -3])


def test_reversing_turns_the_longitudinal_signs_and_keeps_the_lateral_ones() -> None:
    x = np.arange(1.0, 12.0)
    np.testing.assert_array_equal(SOIL.reverse(x), [-1, 2, -3, -4, 5, -6, -7, 8, 9, 10, 11])
    np.testing.assert_array_equal(reverse_forces(np.array([1.0, 2.0, 3.0])), [-1, 2, -3])


@pytest.mark.parametrize("mode", MODES)
def test_mirroring_twice_changes_nothing(mode: Mode) -> None:
    table = interface(mode)
    x = np.random.default_rng(0).normal(size=(4, table.size))
    np.testing.assert_array_equal(table.mirror(table.mirror(x)), x)
    np.testing.assert_array_equal(x[:, table.mirror_permutation] * table.mirror_signs, table.mirror(x))


@pytest.mark.parametrize("given", [[1] * 10, [[1] * 10] * 3, np.ones((2, 10), np.float32), np.ones((6, 20))[::2, ::2]])
def test_check_makes_contiguous_float64_of_whatever_converts(given: object) -> None:
    checked = RIGID.check(given)
    assert checked.dtype == np.float64
    assert checked.flags.c_contiguous
    np.testing.assert_array_equal(checked, np.ones_like(checked))


@pytest.mark.parametrize("shape", [(), (9,), (11,), (10, 3), (1, 1, 10), (2, 3, 10)])
def test_check_refuses_another_shape_and_says_which_columns_it_wants(shape: tuple[int, ...]) -> None:
    with pytest.raises(InvalidInputError, match=r"vx, vy, yaw_rate, ax, ay, v_left, v_right, mu, fr, k"):
        RIGID.check(np.ones(shape))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_check_names_the_column_that_is_not_finite(bad: float) -> None:
    x = np.ones((3, 11))
    x[1, 8] = bad
    with pytest.raises(InvalidInputError, match=r"\bphi\b"):
        SOIL.check(x)


@pytest.mark.parametrize("given", [None, "text", ["a"] * 10, [[1.0] * 10, [1.0] * 9], [{}] * 10])
def test_check_refuses_what_is_not_numbers(given: object) -> None:
    with pytest.raises(InvalidInputError):
        RIGID.check(given)


@pytest.mark.filterwarnings("ignore::numpy.exceptions.ComplexWarning")
def test_check_does_not_drop_an_imaginary_part() -> None:
    with pytest.raises(InvalidInputError):
        RIGID.check(np.full(10, 1 + 1j))
