import math

import casadi
import numpy as np
import pytest
import torch

from grouser.surrogate import (
    ACTIVATIONS,
    NUMPY_NETWORK,
    Activation,
    DenseNetwork,
    casadi_network,
    random_network,
    torch_module,
    torch_network,
)
from grouser.terrain import ConfigurationError, FloatArray, InvalidInputError


def _network(activation: Activation = "silu") -> DenseNetwork:
    network = random_network((5, 8, 6, 3), activation, np.random.default_rng(0))
    biases = tuple(
        np.random.default_rng(i).normal(size=b.shape).astype(np.float32) for i, b in enumerate(network.biases)
    )
    return DenseNetwork(activation, network.weights, biases)


def _naive(network: DenseNetwork, row: FloatArray) -> list[float]:
    """The network with scalars, from the textbook."""
    activate = {
        "relu": lambda z: max(z, 0.0),
        "silu": lambda z: z / (1.0 + math.exp(-z)),
        "tanh": math.tanh,
    }[network.activation]
    value = [float(v) for v in row]
    for layer, (weights, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        value = [sum(v * float(weights[i, o]) for i, v in enumerate(value)) + float(b) for o, b in enumerate(bias)]
        if layer < len(network.weights) - 1:
            value = [activate(v) for v in value]
    return value


@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_the_oracle_is_the_textbook_network(activation: Activation) -> None:
    network = _network(activation)
    rows = np.random.default_rng(1).normal(size=(20, 5))
    expected = [_naive(network, row) for row in rows]
    np.testing.assert_allclose(network.forward(NUMPY_NETWORK, rows), expected, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(network.forward(NUMPY_NETWORK, rows[0]), expected[0], rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_numpy_torch_and_casadi_agree_in_float64(activation: Activation) -> None:
    network = _network(activation)
    rows = np.random.default_rng(2).normal(size=(20, 5))
    expected = network.forward(NUMPY_NETWORK, rows)
    np.testing.assert_allclose(network.forward(torch_network(), torch.tensor(rows)).numpy(), expected, atol=1e-12)
    z = casadi.MX.sym("z", 5)
    function = casadi.Function("network", [z], [network.forward(casadi_network(), z)])
    np.testing.assert_allclose(np.array(function(rows.T)).T, expected, atol=1e-12)


@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_large_inputs_do_not_overflow(activation: Activation) -> None:
    assert np.isfinite(_network(activation).forward(NUMPY_NETWORK, np.full(5, -1e6))).all()


@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_a_torch_module_comes_back_bit_for_bit(activation: Activation) -> None:
    network = _network(activation)
    module = torch_module(network)
    again = DenseNetwork.from_torch(module)
    assert again.activation == activation
    assert again.packed() == network.packed()
    row = torch.randn(7, 5, generator=torch.Generator().manual_seed(0))
    output = module(row)
    assert output.dtype == torch.float32
    assert output.requires_grad
    np.testing.assert_allclose(
        output.detach().numpy(), network.forward(NUMPY_NETWORK, row.double().numpy()), rtol=1e-4, atol=1e-5
    )


def test_building_a_module_draws_nothing_from_the_global_generator() -> None:
    before = torch.get_rng_state()
    torch_module(_network())
    assert torch.equal(torch.get_rng_state(), before)


def test_from_torch_passes_over_dropout_and_takes_a_missing_bias_for_zero() -> None:
    module = torch.nn.Sequential(
        torch.nn.Linear(2, 4, bias=False), torch.nn.ReLU(), torch.nn.Dropout(0.1), torch.nn.Linear(4, 3)
    )
    network = DenseNetwork.from_torch(module)
    assert network.widths == (2, 4, 3)
    np.testing.assert_array_equal(network.biases[0], 0.0)


@pytest.mark.parametrize(
    "parts",
    [
        [torch.nn.Linear(2, 4), torch.nn.Sigmoid(), torch.nn.Linear(4, 3)],
        [torch.nn.Linear(2, 4), torch.nn.ReLU(), torch.nn.Linear(4, 4), torch.nn.SiLU(), torch.nn.Linear(4, 3)],
        [torch.nn.Linear(2, 4), torch.nn.Linear(4, 3)],
    ],
)
def test_from_torch_refuses_what_the_network_cannot_hold(parts: list[torch.nn.Module]) -> None:
    with pytest.raises(InvalidInputError, match="expected"):
        DenseNetwork.from_torch(torch.nn.Sequential(*parts))


def test_widths_and_parameter_count() -> None:
    network = _network()
    assert network.widths == (5, 8, 6, 3)
    assert network.parameter_count == 5 * 8 + 8 + 8 * 6 + 6 + 6 * 3 + 3
    assert len(network.packed()) == 4 * network.parameter_count


def test_equal_seeds_draw_equal_networks() -> None:
    draws = [random_network((4, 16, 3), "relu", np.random.default_rng(seed)).packed() for seed in (3, 3, 4)]
    assert draws[0] == draws[1] != draws[2]


def test_an_unknown_activation_names_the_nearest() -> None:
    network = _network()
    with pytest.raises(ConfigurationError, match="did you mean 'relu'"):
        DenseNetwork("relu6", network.weights, network.biases)  # type: ignore[arg-type]


def test_layers_must_follow_on_one_another() -> None:
    network = _network()
    with pytest.raises(InvalidInputError, match="layer 1 takes weights"):
        DenseNetwork("silu", network.weights[::2], network.biases[::2])


def test_every_layer_needs_a_bias() -> None:
    network = _network()
    with pytest.raises(InvalidInputError, match="a bias for each"):
        DenseNetwork("silu", network.weights, network.biases[:-1])


def test_there_must_be_a_layer() -> None:
    with pytest.raises(InvalidInputError, match="at least one layer"):
        DenseNetwork("silu", (), ())


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_weights_must_be_finite(bad: float) -> None:
    network = _network()
    weights = [array.copy() for array in network.weights]
    weights[1][0, 0] = bad
    with pytest.raises(InvalidInputError, match="layer 1 holds weights or biases that are not finite"):
        DenseNetwork("silu", tuple(weights), network.biases)
