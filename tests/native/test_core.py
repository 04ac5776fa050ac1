"""The extension module by itself: what its buffers and constructors refuse, and the network against NumPy."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from grouser.native import _core

Array = NDArray[np.float64]
M113: dict[str, Any] = {
    "mode": 0,
    "contact": 0,
    "path": 0,
    "precision": 0,
    "wheels": 5,
    "along": 4,
    "across": 2,
    "mass": 11300.0,
    "gravity": 9.81,
    "contact_length": 2.667,
    "element_length": 2.667 / 5,
    "element_spacing": 2.667 / 5,
    "tread": 2.159,
    "track_width": 0.38,
    "cg_height": 0.79,
    "contact_center": 0.0,
    "soft_speed": 0.1,
}
BLOCK = _core.Physics(**M113)
ROW = np.array([[3, 0.2, 0.3, 1, 2, 2.5, 3.8, 0.7, 0.05, 0.05]])
X = np.repeat(ROW, 4, axis=0)


def read_only(array: Array) -> Array:
    array.flags.writeable = False
    return array


def test_the_column_table_by_mode() -> None:
    motion = ("vx", "vy", "yaw_rate", "ax", "ay", "v_left", "v_right")
    assert _core.columns(0) == (*motion, "mu", "fr", "k")
    assert _core.columns(1) == (*motion, "c", "phi", "fr", "k")


@pytest.mark.parametrize("mode", [-1, 2])
def test_an_unknown_mode_has_no_columns(mode: int) -> None:
    with pytest.raises(ValueError, match="mode"):
        _core.columns(mode)


def test_the_cpu_level_is_a_word() -> None:
    assert _core.cpu_level().strip()


# Buffers, of the block and the network alike

WIDTHS = (10, 8, 3)


def parameters_of(
    widths: tuple[int, ...], rng: np.random.Generator
) -> list[tuple[NDArray[np.float32], NDArray[np.float32]]]:
    return [
        (
            (rng.normal(size=(i, o)) / np.sqrt(i)).astype(np.float32),
            (0.3 * rng.normal(size=o)).astype(np.float32),
        )
        for i, o in pairwise(widths)
    ]


def network(widths: tuple[int, ...] = WIDTHS, activation: int = 2, **changes: Any) -> _core.Mlp:
    layers = parameters_of(widths, np.random.default_rng(1))
    arguments: dict[str, Any] = {
        "activation": activation,
        "widths": widths,
        "parameters": b"".join(w.tobytes() + b.tobytes() for w, b in layers),
        "input_mean": np.linspace(-1, 1, widths[0]),
        "input_scale": np.linspace(0.5, 2, widths[0]),
        "output_mean": np.array([10.0, -20.0, 30.0]),
        "output_scale": np.array([1e3, 2e3, 3e3]),
    }
    return _core.Mlp(**{**arguments, **changes})


# The structured network, of five wheels

TRACK_NET: dict[str, Any] = {
    **{name: value for name, value in M113.items() if name not in ("path", "precision", "along", "across")},
    "activation": 1,
    "widths": (10, 8, 15),
    "parameters": b"".join(w.tobytes() + b.tobytes() for w, b in parameters_of((10, 8, 15), np.random.default_rng(2))),
    "input_mean": np.linspace(-0.1, 0.1, 10),
    "input_scale": np.linspace(0.5, 2, 10),
    "output_mean": np.linspace(-0.05, 0.05, 15),
    "output_scale": np.full(15, 0.1),
    "ends": np.concatenate([np.linspace(-0.5, 0.25, 4), np.linspace(-0.25, 0.5, 4)]) * 2.667,
    "reach": np.linspace(-0.375, 0.375, 4) * 2.667,
    "half_travel": 2.667 / 2,
    "part_length": 2.667 / 4,
    "mean": np.random.default_rng(3).normal(0.0, 0.2, (4, 5)),
    "moment": np.random.default_rng(4).normal(0.0, 0.2, (4, 5)),
}
TRACKS = _core.TrackNet(**TRACK_NET)

HANDLES = {"physics": BLOCK, "mlp": network(), "tracks": TRACKS}
every_track_handle = pytest.mark.parametrize("handle", [BLOCK, TRACKS], ids=["physics", "tracks"])
every_handle = pytest.mark.parametrize("handle", HANDLES.values(), ids=HANDLES.keys())


@every_handle
@pytest.mark.parametrize(
    "x",
    [
        X.astype(np.float32),
        X.astype(int),
        X.astype(">f8"),
        X[::2],
        np.asfortranarray(X),
        X[:, :9].copy(),
        np.ones((4, 11)),
        X[:3],
    ],
    ids=["float32", "int", "big-endian", "strided", "fortran", "too narrow", "too wide", "too few rows"],
)
def test_another_input_than_contiguous_float64_rows_is_refused(handle: Any, x: Any) -> None:
    rows = 4 if len(x) != 2 else 2
    with pytest.raises(ValueError):  # noqa: PT011
        handle.forces(x, np.empty((rows, 3)))
    with pytest.raises(ValueError):  # noqa: PT011
        handle.forces_and_jacobian(x, np.empty((rows, 3)), np.empty((rows, 3, 10)))


@every_handle
@pytest.mark.parametrize(
    "out",
    [
        np.empty((4, 3), np.float32),
        np.empty((4, 6))[:, ::2],
        np.asfortranarray(np.empty((4, 3))),
        read_only(np.empty((4, 3))),
        np.empty((5, 3)),
        np.empty((3, 3)),
        np.empty((4, 2)),
    ],
    ids=["float32", "strided", "fortran", "read-only", "too many rows", "too few rows", "too narrow"],
)
def test_another_output_than_writable_rows_of_three_is_refused(handle: Any, out: Any) -> None:
    with pytest.raises(ValueError):  # noqa: PT011
        handle.forces(X, out)
    with pytest.raises(ValueError):  # noqa: PT011
        handle.forces_and_jacobian(X, out, np.empty((4, 3, 10)))


@every_handle
@pytest.mark.parametrize(
    "jacobian",
    [np.empty((4, 3, 10), np.float32), read_only(np.empty((4, 3, 10))), np.empty((3, 3, 10)), np.empty((4, 3, 11))],
    ids=["float32", "read-only", "too few rows", "too wide"],
)
def test_another_jacobian_than_writable_three_by_ten_is_refused(handle: Any, jacobian: Any) -> None:
    with pytest.raises(ValueError):  # noqa: PT011
        handle.forces_and_jacobian(X, np.empty((4, 3)), jacobian)


@pytest.mark.parametrize(
    "arguments",
    [
        (X, X[:3].copy(), np.empty((4, 2, 3))),
        (X[:3].copy(), X, np.empty((4, 2, 3))),
        (X, X, np.empty((3, 2, 3))),
        (X, X, read_only(np.empty((4, 2, 3)))),
        (X.astype(np.float32), X, np.empty((4, 2, 3))),
        (X, X[::-1], np.empty((4, 2, 3))),
        (X, X, np.empty((4, 2, 3)), np.empty((3, 2, 3, 10))),
        (X, X, np.empty((4, 2, 3)), np.empty((4, 3, 10))),
        (X, X, np.empty((4, 2, 3)), np.empty((4, 2, 3, 11))),
        (X, X, np.empty((4, 2, 3)), np.empty((4, 2, 3, 10), np.float32)),
        (X, X, np.empty((4, 2, 3)), np.empty((4, 2, 3, 20))[..., ::2]),
        (X, X, np.empty((4, 2, 3)), read_only(np.empty((4, 2, 3, 10)))),
    ],
)
@every_track_handle
def test_track_forces_refuse_mismatched_or_unsuitable_buffers(handle: Any, arguments: Any) -> None:
    with pytest.raises(ValueError):  # noqa: PT011
        handle.track_forces(*arguments)


@every_track_handle
def test_a_jacobian_of_the_tracks_that_is_no_buffer_is_refused_without_harm(handle: Any) -> None:
    for given in (None, 3.0, "jacobian"):
        with pytest.raises((TypeError, ValueError)):
            handle.track_forces(X, X, np.empty((4, 2, 3)), given)
    with pytest.raises(TypeError):
        handle.track_forces(X, X, np.empty((4, 2, 3)), np.empty((4, 2, 3, 10)), X)


@every_track_handle
def test_a_refused_row_leaves_the_outputs_of_the_tracks_as_they_were(handle: Any) -> None:
    bad = X.copy()
    bad[3, 9] = -1.0
    tracks, jacobian = np.full((4, 2, 3), 7.0), np.full((4, 2, 3, 10), 7.0)
    for left, right in ((bad, X), (X, bad)):
        with pytest.raises(ValueError, match=r"row 3.*\bk\b"):
            handle.track_forces(left, right, tracks, jacobian)
    assert np.all(tracks == 7.0)
    assert np.all(jacobian == 7.0)


@every_handle
@pytest.mark.parametrize("given", [None, 3.0, [[1.0] * 10]])
def test_what_is_no_buffer_is_refused_without_harm(handle: Any, given: Any) -> None:
    with pytest.raises((TypeError, ValueError)):
        handle.forces(given, np.empty((1, 3)))


@every_track_handle
def test_a_refused_row_is_named_with_its_column(handle: Any) -> None:
    for column, value, name in ((9, 0.0, "k"), (9, -1.0, "k"), (9, np.nan, "k"), (3, np.inf, "ax"), (0, np.nan, "vx")):
        x = X.copy()
        x[2, column] = value
        forces, jacobian = np.full((4, 3), 7.0), np.full((4, 3, 10), 7.0)
        with pytest.raises(ValueError, match=rf"row 2.*\b{name}\b"):
            handle.forces(x, forces)
        with pytest.raises(ValueError, match=rf"row 2.*\b{name}\b"):
            handle.forces_and_jacobian(x, forces, jacobian)
        assert np.all(forces == 7.0)
        assert np.all(jacobian == 7.0)


# Physics


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("mode", 2),
        ("contact", -1),
        ("contact", 2),
        ("path", -1),
        ("path", 2),
        ("precision", -1),
        ("precision", 2),
        ("wheels", 0),
        ("wheels", 65),
        ("along", 0),
        ("across", 5000),
    ],
)
def test_a_block_of_impossible_size_is_refused(name: str, value: Any) -> None:
    with pytest.raises(ValueError):  # noqa: PT011
        _core.Physics(**{**M113, name: value})


@every_track_handle
def test_tracks_sum_to_the_forces_to_the_bit(handle: Any) -> None:
    forces, tracks = np.empty((4, 3)), np.empty((4, 2, 3))
    handle.forces(X, forces)
    handle.track_forces(X, X, tracks)
    np.testing.assert_array_equal(tracks.sum(axis=1), forces)


@pytest.mark.parametrize("block", [BLOCK, _core.Physics(**{**M113, "path": 1}), TRACKS], ids=["soft", "exact", "net"])
def test_the_jacobian_of_the_tracks_comes_with_the_same_forces_and_sums_to_that_of_the_vehicle(block: Any) -> None:
    x = np.repeat(X, 40, axis=0)  # enough rows to run without the interpreter's lock
    forces, jacobian = np.empty((160, 3)), np.empty((160, 3, 10))
    tracks, slopes = np.empty((160, 2, 3)), np.empty((160, 2, 3, 10))
    block.forces_and_jacobian(x, forces, jacobian)
    block.track_forces(x, x, tracks, slopes)
    np.testing.assert_array_equal(tracks.sum(axis=1), forces)
    np.testing.assert_array_equal(slopes.sum(axis=1), jacobian)


def test_each_path_is_another_block() -> None:
    soft, exact = np.empty((4, 3)), np.empty((4, 3))
    BLOCK.forces(X, soft)
    _core.Physics(**{**M113, "path": 1}).forces(X, exact)
    assert np.all(np.abs(soft - exact) > 1e-3 * np.abs(soft))


@pytest.mark.parametrize("name", sorted(M113))
def test_every_argument_of_the_block_is_asked_for(name: str) -> None:
    with pytest.raises(TypeError, match="missing required argument"):
        _core.Physics(**{key: value for key, value in M113.items() if key != name})


# Network

ACTIVATIONS: dict[str, tuple[int, Callable[[Array], Array]]] = {
    "relu": (0, lambda a: np.maximum(a, 0)),
    "silu": (1, lambda a: a / (1 + np.exp(-a))),
    "tanh": (2, np.tanh),
}
every_activation = pytest.mark.parametrize(("code", "function"), ACTIVATIONS.values(), ids=ACTIVATIONS.keys())
every_shape = pytest.mark.parametrize("widths", [(10, 3), (10, 8, 3), (11, 33, 17, 3), (10, 64, 64, 64, 3)], ids=str)


def forward(widths: tuple[int, ...], function: Callable[[Array], Array], x: Array) -> Array:
    """The network that `network` builds, in float64."""
    layers = parameters_of(widths, np.random.default_rng(1))
    a = (x - np.linspace(-1, 1, widths[0])) / np.linspace(0.5, 2, widths[0])
    for weights, biases in layers[:-1]:
        a = function(a @ weights.astype(float) + biases)
    weights, biases = layers[-1]
    return np.asarray(np.array([10.0, -20, 30]) + np.array([1e3, 2e3, 3e3]) * (a @ weights.astype(float) + biases))


@every_shape
@every_activation
def test_the_network_computes_its_forward_pass(
    widths: tuple[int, ...], code: int, function: Callable[[Array], Array]
) -> None:
    x = np.random.default_rng(2).normal(size=(200, widths[0]))
    actual = np.empty((200, 3))
    network(widths, code).forces(x, actual)
    expected = forward(widths, function, x)
    assert np.max(np.abs(actual - expected) / expected.std(axis=0)) < 1e-5  # the promise for float32 networks


@every_shape
@every_activation
def test_the_network_computes_its_jacobian(
    widths: tuple[int, ...], code: int, function: Callable[[Array], Array]
) -> None:
    x = np.random.default_rng(3).normal(size=(100, widths[0]))
    forces, jacobian = np.empty((100, 3)), np.empty((100, 3, widths[0]))
    net = network(widths, code)
    net.forces_and_jacobian(x, forces, jacobian)
    step = 1e-6 * np.eye(widths[0])
    expected = np.stack([(forward(widths, function, x + h) - forward(widths, function, x - h)) / 2e-6 for h in step], 2)
    scale = np.abs(expected).max(axis=(0, 2))[:, None]
    assert np.max(np.abs(jacobian - expected) / scale) < 1e-3  # the promise for Jacobians
    plain = np.empty((100, 3))
    net.forces(x, plain)
    np.testing.assert_allclose(forces, plain, rtol=0, atol=1e-5 * plain.std())


@every_activation
def test_extreme_inputs_do_not_overflow_into_nan(code: int, function: Callable[[Array], Array]) -> None:
    x = np.array([[1e4] * 10, [-1e4] * 10])
    forces, jacobian = np.empty((2, 3)), np.empty((2, 3, 10))
    network(activation=code).forces_and_jacobian(x, forces, jacobian)
    assert np.all(np.isfinite(forces))
    assert np.all(np.isfinite(jacobian))


def test_a_batch_through_the_network_equals_its_rows_to_the_bit() -> None:
    x = np.random.default_rng(4).normal(size=(37, 10))
    batch, single = np.empty((37, 3)), np.empty((1, 3))
    net = network((10, 64, 64, 3), 1)
    net.forces(x, batch)
    for i in range(37):
        net.forces(x[i : i + 1], single)
        np.testing.assert_array_equal(single[0], batch[i])


@pytest.mark.parametrize(
    "widths", [(), (10,), (10, 8, 2), (10, 8, 4), (10, 0, 3), (10, -8, 3), (12, 8, 3), (10, 513, 3), (10, *[8] * 8, 3)]
)
def test_impossible_widths_are_refused(widths: tuple[int, ...]) -> None:
    with pytest.raises(ValueError):  # noqa: PT011
        _core.Mlp(
            activation=0,
            widths=widths,
            parameters=b"\0" * 4 * sum(max(i, 0) * max(o, 0) + max(o, 0) for i, o in pairwise(widths)),
            input_mean=np.zeros(widths[0] if widths else 10),
            input_scale=np.ones(widths[0] if widths else 10),
            output_mean=np.zeros(3),
            output_scale=np.ones(3),
        )


@pytest.mark.parametrize("size", [0, 1, 4 * (10 * 8 + 8 + 8 * 3 + 3) - 1, 4 * (10 * 8 + 8 + 8 * 3 + 3) + 4])
def test_another_number_of_parameter_bytes_is_refused(size: int) -> None:
    with pytest.raises(ValueError, match="byte"):
        network(parameters=b"\0" * size)


@pytest.mark.parametrize(
    "changes",
    [
        {"activation": 3},
        {"activation": -1},
        {"input_mean": np.zeros(9)},
        {"input_scale": np.ones(11)},
        {"input_mean": np.zeros(10, np.float32)},
        {"output_mean": np.zeros(2)},
        {"output_scale": np.ones((3, 2))[:, 0]},
    ],
    ids=lambda changes: next(iter(changes)),
)
def test_an_impossible_network_is_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(ValueError):  # noqa: PT011
        network(**changes)


# Structured network


@pytest.mark.parametrize("name", sorted(TRACK_NET))
def test_every_argument_of_the_structured_network_is_asked_for(name: str) -> None:
    with pytest.raises(TypeError, match="missing required argument"):
        _core.TrackNet(**{key: value for key, value in TRACK_NET.items() if key != name})


@pytest.mark.parametrize("name", ["path", "along", "cells"])
def test_the_structured_network_takes_no_cells(name: str) -> None:
    with pytest.raises(TypeError, match="keyword argument"):
        _core.TrackNet(**{**TRACK_NET, name: 1})


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"mode": 2}, "mode"),
        ({"mode": -1}, "mode"),
        ({"contact": 2}, "contact"),
        ({"wheels": 0}, "wheels"),
        ({"wheels": 65}, "wheels"),
        ({"wheels": 4}, "4 wheels"),
        ({"wheels": 6}, "6 wheels"),
        ({"soft_speed": 0.0}, "soft_speed"),
        ({"soft_speed": -0.1}, "soft_speed"),
        ({"soft_speed": np.nan}, "soft_speed"),
        ({"activation": 3}, "activation"),
        ({"activation": -1}, "activation"),
        ({"parameters": TRACK_NET["parameters"][:-1]}, "byte"),
        ({"parameters": TRACK_NET["parameters"] + b"0000"}, "byte"),
        ({"widths": (10,)}, "layers"),
        ({"widths": (10, 8, 0)}, "widths"),
        ({"widths": (10, 513, 15)}, "widths"),
        ({"widths": (13, 8, 15), "parameters": bytes(4 * (14 * 8 + 9 * 15))}, "10 features"),
        ({"widths": (10, 8, 3), "parameters": bytes(4 * (11 * 8 + 9 * 3))}, "15 units"),
        ({"widths": (10, 15, 8, 10), "parameters": bytes(4 * (11 * 15 + 16 * 8 + 9 * 10))}, "15 units"),
        ({"input_mean": np.zeros(9)}, "input_mean"),
        ({"input_scale": np.ones(11)}, "input_scale"),
        ({"output_mean": np.zeros(3)}, "output_mean"),
        ({"output_scale": np.ones(16)}, "output_scale"),
        ({"output_scale": np.ones(15, np.float32)}, "output_scale"),
        ({"ends": np.zeros(5)}, "ends"),
        ({"reach": np.zeros(5)}, "reach"),
        ({"mean": np.zeros(4 * 5 - 1)}, "mean"),
        ({"moment": np.zeros(4 * 5 * 2)[::2]}, "moment"),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_an_impossible_structured_network_is_refused_by_name(changes: dict[str, Any], named: str) -> None:
    with pytest.raises(ValueError, match=named):
        _core.TrackNet(**{**TRACK_NET, **changes})


@pytest.mark.parametrize("name", ["input_mean", "output_scale", "ends", "mean", "widths", "parameters"])
@pytest.mark.parametrize("given", [None, 3.0])
def test_what_the_structured_network_cannot_read_is_refused_without_harm(name: str, given: Any) -> None:
    with pytest.raises((TypeError, ValueError)):
        _core.TrackNet(**{**TRACK_NET, name: given})


def test_the_structured_network_keeps_copies_of_what_it_is_given() -> None:
    given: dict[str, Any] = {
        name: value.copy() if isinstance(value, np.ndarray) else value for name, value in TRACK_NET.items()
    }
    net = _core.TrackNet(**given)
    for value in given.values():
        if isinstance(value, np.ndarray):
            value[:] = np.nan
    found, expected = np.empty((4, 3)), np.empty((4, 3))
    net.forces(X, found)
    TRACKS.forces(X, expected)
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("wheels", [1, 2, 64])
def test_the_structured_network_takes_any_number_of_wheels_up_to_the_most(wheels: int) -> None:
    units = 3 * wheels
    # Every element shears as the middle of the points does.
    changes: dict[str, Any] = {
        "mode": 1,
        "wheels": wheels,
        "element_length": 2.667 / wheels,
        "element_spacing": 2.667 / wheels,
        "widths": (10, 512, 512, units),
        "parameters": bytes(4 * (11 * 512 + 513 * 512 + 513 * units)),
        "output_mean": np.zeros(units),
        "output_scale": np.ones(units),
        "mean": np.full((4, wheels), 0.25),
        "moment": np.zeros((4, wheels)),
    }
    net = _core.TrackNet(**{**TRACK_NET, **changes})
    # Sliding sideways for good on soil: c A + W tan phi.
    x = np.array([[0, 50.0, 0, 0, 0, 0, 0, 4000.0, 0.5, 0.1, 1e-4]])
    forces, jacobian = np.empty((1, 3)), np.empty((1, 3, 11))
    net.forces_and_jacobian(x, forces, jacobian)
    expected = -(4000.0 * 2 * 2.667 * 0.38 + 11300 * 9.81 * np.tan(0.5))
    np.testing.assert_allclose(forces, [[0.0, expected, 0.0]], rtol=1e-9, atol=1e-6 * abs(expected))
    assert jacobian[0, 1, 7] == pytest.approx(-2 * 2.667 * 0.38)
    assert np.isfinite(jacobian).all()
