"""Rounding against torch's own casts, against bounds, and against what rounding has to be."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.typing import NDArray

from benchmarks.precision.rounding import (
    SIGNED,
    UNSIGNED,
    activation_codes,
    bfloat16_bits,
    to_bfloat16,
    to_float16,
    weight_codes,
    widened,
)
from grouser.terrain import InvalidInputError

WEIGHTS = st.floats(-100.0, 100.0, width=32)
ANY_BITS = arrays.arrays(np.uint32, 64)
MATRICES = arrays.arrays(np.float32, st.tuples(st.integers(1, 12), st.integers(1, 9)), elements=WEIGHTS)
ROWS = arrays.arrays(np.float32, st.tuples(st.integers(1, 5), st.integers(1, 20)), elements=WEIGHTS)


@given(ANY_BITS)
def test_bfloat16_is_torchs(bits: NDArray[np.uint32]) -> None:
    torch = pytest.importorskip("torch")
    values = bits.view(np.float32)
    np.testing.assert_array_equal(to_bfloat16(values), torch.from_numpy(values.copy()).bfloat16().float().numpy())


@given(arrays.arrays(np.float32, 64, elements=st.floats(-65504.0, 65504.0, width=32)))
def test_float16_is_torchs(values: NDArray[np.float32]) -> None:
    torch = pytest.importorskip("torch")
    np.testing.assert_array_equal(to_float16(values), torch.from_numpy(values.copy()).half().float().numpy())


def test_a_tie_goes_to_the_even_neighbour() -> None:
    step = np.float32(2.0**-7)
    values = np.array([1 + step / 2, 1 + 3 * step / 2], dtype=np.float32)
    np.testing.assert_array_equal(to_bfloat16(values), [1.0, 1 + 2 * step])


@given(st.floats(2.0**-126, 2.0**127, width=32))
def test_bfloat16_is_off_by_half_a_step_at_most(value: float) -> None:
    rounded = float(to_bfloat16(np.array([value], dtype=np.float32))[0])
    assert abs(rounded - value) <= 2.0**-8 * value / (1 + 2.0**-8)


@given(ANY_BITS)
def test_what_is_rounded_stays_and_its_bits_are_its_upper_half(bits: NDArray[np.uint32]) -> None:
    rounded = to_bfloat16(bits.view(np.float32))
    np.testing.assert_array_equal(to_bfloat16(rounded), rounded)
    np.testing.assert_array_equal(widened(bfloat16_bits(rounded)), rounded)


def test_float16_refuses_what_it_cannot_hold() -> None:
    with pytest.raises(InvalidInputError, match="up to 65504, got 70000"):
        to_float16(np.array([1.0, 7e4]))


@given(MATRICES)
def test_bytes_of_weights_are_off_by_half_a_step_at_most(weights: NDArray[np.float32]) -> None:
    held = weight_codes(weights)
    assert held.codes.dtype == np.int8
    # A hundredth of a step for what float32 rounds on the way.
    assert np.all(np.abs(held.values - weights) <= 0.51 * held.scales)


@given(MATRICES)
def test_the_largest_weight_of_an_output_is_its_largest_code(weights: NDArray[np.float32]) -> None:
    codes = np.abs(weight_codes(weights).codes.astype(int)).max(axis=0)
    assert codes.max() <= SIGNED
    heavy = np.abs(weights).max(axis=0) > 1e-30
    np.testing.assert_array_equal(codes[heavy], SIGNED)


@given(MATRICES)
def test_the_scale_of_an_output_is_its_own(weights: NDArray[np.float32]) -> None:
    apart = [weight_codes(weights[:, [n]]).codes[:, 0] for n in range(weights.shape[1])]
    np.testing.assert_array_equal(weight_codes(weights).codes, np.column_stack(apart))


@given(MATRICES)
def test_bytes_of_mirrored_weights_are_mirrored(weights: NDArray[np.float32]) -> None:
    np.testing.assert_array_equal(weight_codes(-weights).codes, -weight_codes(weights).codes)


@given(ROWS)
def test_bytes_of_activations_are_off_by_half_a_step_at_most(values: NDArray[np.float32]) -> None:
    for signed, given_values, most in ((True, values, SIGNED), (False, np.abs(values), UNSIGNED)):
        held = activation_codes(given_values, signed=signed)
        assert held.codes.dtype == (np.int8 if signed else np.uint8)
        assert np.abs(held.codes.astype(int)).max() <= most
        assert np.all(np.abs(held.values - given_values) <= 0.51 * held.scales)


def test_silence_stays_silent() -> None:
    zeros = np.zeros((3, 4), dtype=np.float32)
    assert not weight_codes(zeros).values.any()
    assert not activation_codes(zeros, signed=False).values.any()
