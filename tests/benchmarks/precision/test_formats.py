"""Networks in other formats: what is rounded is, what is not stays, and a backend evaluates just that."""

import numpy as np
import pytest

from benchmarks.precision.backend import RESOLUTIONS, backend
from benchmarks.precision.formats import FLOAT32, FORMATS, Format
from benchmarks.precision.rounding import activation_codes, to_bfloat16, weight_codes
from grouser.surrogate import NUMPY_NETWORK, DenseNetwork, NativeSurrogate, Surrogate, random_network
from grouser.terrain import FloatArray, PhysicsBackend


def layers(activation: str) -> DenseNetwork:
    generator = np.random.default_rng(3)
    drawn = random_network((5, 16, 12, 3), activation, generator)  # type: ignore[arg-type]
    biases = tuple(generator.normal(size=len(bias)).astype(np.float32) for bias in drawn.biases)
    return DenseNetwork(drawn.activation, drawn.weights, biases)


def some_rows(surrogate: Surrogate) -> FloatArray:
    generator = np.random.default_rng(5)
    mean, scale = np.zeros(surrogate.interface.size), np.ones(surrogate.interface.size)
    rows = generator.normal(mean, scale, (64, len(mean)))
    rows[:, 5:7] = rows[:, [0]] + 0.1 * rows[:, 5:7]
    rows[:, 7:] = np.array([0.8, 0.05, 0.02])
    return rows


def test_float32_is_the_network_itself() -> None:
    network = layers("silu")
    for held, own in zip(FLOAT32.network(network).weights, network.weights, strict=True):
        np.testing.assert_array_equal(held, own)
    z = np.random.default_rng(0).normal(size=(20, 5))
    np.testing.assert_allclose(FLOAT32.forward(network)(z), network.forward(NUMPY_NETWORK, z), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("kind", FORMATS.values(), ids=FORMATS.keys())
def test_biases_and_a_first_layer_that_is_left_out_stay(kind: Format) -> None:
    network = layers("relu")
    held = kind.network(network)
    for bias, own in zip(held.biases, network.biases, strict=True):
        np.testing.assert_array_equal(bias, own)
    assert np.array_equal(held.weights[0], network.weights[0]) == (not kind.first or kind == FLOAT32)


def test_bytes_of_activations_are_unsigned_behind_relu_and_signed_elsewhere() -> None:
    network = layers("relu")
    z = np.random.default_rng(1).normal(size=(20, 5))
    row: FloatArray = z
    for index, (weights, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        codes, units = activation_codes(row, signed=index == 0)
        own, scales = weight_codes(weights)
        # Whole numbers are added without rounding, as the instruction adds them.
        row = (codes.astype(np.int64) @ own.astype(np.int64)) * (units.astype(float) * scales.astype(float)) + bias
        row = np.maximum(row, 0.0) if index < 2 else row
    np.testing.assert_allclose(Format("int8", "int8").forward(network)(z), row, rtol=1e-5, atol=1e-5)


def test_activations_in_bfloat16_are_rounded_before_every_layer() -> None:
    network = layers("tanh")
    z = np.random.default_rng(2).normal(size=(20, 5))
    row = to_bfloat16(z).astype(float) @ to_bfloat16(network.weights[0]).astype(float) + network.biases[0]
    for weights, bias in zip(network.weights[1:], network.biases[1:], strict=True):
        row = to_bfloat16(np.tanh(row)).astype(float) @ to_bfloat16(weights).astype(float) + bias
    np.testing.assert_allclose(Format("bfloat16", "bfloat16").forward(network)(z), row, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", ["m113-rigid", "m113-rigid-paper-recipe"])
@pytest.mark.parametrize("kind", FORMATS.values(), ids=FORMATS.keys())
def test_a_backend_evaluates_the_rounded_network(name: str, kind: Format) -> None:
    surrogate = Surrogate.load(name)
    rows = some_rows(surrogate)
    expected = surrogate.evaluate(NUMPY_NETWORK, rows, kind.forward(surrogate.network))
    forces = backend(surrogate, kind).forces(rows)
    np.testing.assert_allclose(forces, expected, rtol=0, atol=1e-5 * np.abs(expected).max())


def test_more_bits_are_nearer_to_float32() -> None:
    surrogate = Surrogate.load("m113-rigid")
    rows = some_rows(surrogate)
    exact = backend(surrogate, FLOAT32).forces(rows)
    errors = [
        float(np.sqrt(np.mean((backend(surrogate, FORMATS[name]).forces(rows) - exact) ** 2)))
        for name in ("float16 weights", "bfloat16 weights", "int8 weights and activations")
    ]
    assert 0 < errors[0] < errors[1] < errors[2]
    physics = PhysicsBackend(surrogate.vehicle, "rigid").forces(rows)
    assert errors[2] < 0.1 * float(physics.std())


def test_the_slopes_of_a_staircase_are_those_of_the_network_under_it() -> None:
    surrogate = Surrogate.load("m113-rigid")
    kind = FORMATS["int8 weights and activations"]
    rows = some_rows(surrogate)
    stairs = backend(surrogate, kind, resolution=RESOLUTIONS["int8"])
    under = backend(surrogate, FORMATS["int8 weights"])
    np.testing.assert_array_equal(stairs.forces_and_jacobian(rows)[1], under.forces_and_jacobian(rows)[1])
    assert isinstance(under, NativeSurrogate)
    assert stairs.resolution == 2.0**-8
    assert backend(surrogate, kind).resolution == under.resolution
