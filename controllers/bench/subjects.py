"""What is timed: rows of a drive, surrogates of any width, and the backends by the names that tables give them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...envs import BeltCommand, Simulator, VehicleState
from ...surrogate import (
    NUMPY_NETWORK,
    Activation,
    BoxMahalanobisDetector,
    DenseNetwork,
    GuardedSurrogate,
    NativeSurrogate,
    Normalizer,
    Surrogate,
    random_network,
)
from ...terrain import (
    CompiledBackend,
    ConfigurationError,
    FloatArray,
    PhysicsBackend,
    TrackedVehicle,
    named,
    parameter_ranges,
)
from ...terrain.physics import Precision

#: Hidden widths by name.
NETWORKS: Final = {
    "64x64": (64, 64),
    "96x96": (96, 96),
    "128x128": (128, 128),
    "128x4": (128,) * 4,
    "256-128-64": (256, 128, 64),
    "256x4": (256,) * 4,
}
#: Cells an element, along and across.
GRIDS: Final = ((2, 1), (4, 2), (8, 4), (16, 4), (32, 8))
DEFAULT_GRID: Final = (16, 4)
BATCH: Final = 256
_MODE: Final = "rigid"
_SPEED: Final = 4.0
_RUNS, _SAMPLES = 200, 50
_VX, _YAW_RATE, _LEFT, _RIGHT = 0, 2, 5, 6


@dataclass(frozen=True)
class Subjects:
    """Everything of one vehicle that is timed.

    Parameters
    ----------
    vehicle : TrackedVehicle
        The vehicle; a structured surrogate of it is shipped.
    """

    vehicle: TrackedVehicle

    @cached_property
    def rows(self) -> FloatArray:
        """Rows of a drive on asphalt, shape (256, 10), all of them inside the shipped surrogate's distribution."""
        simulator = Simulator(self.vehicle, "physics", named("asphalt"), state=VehicleState.rolling(_SPEED))
        driven = []
        for index in range(8 * BATCH):
            swing = 0.5 * np.sin(index / 30)
            driven.append(simulator.step(BeltCommand(_SPEED + swing, _SPEED - swing)).row)
        rows = np.array(driven)
        return np.ascontiguousarray(rows[~self.guarded.out_of_distribution(rows)][:BATCH])

    @cached_property
    def structured(self) -> NativeSurrogate:
        """The shipped surrogate in C."""
        return NativeSurrogate(self.vehicle, _MODE)

    @cached_property
    def guarded(self) -> GuardedSurrogate:
        """That, its detector and the physics to fall back on."""
        return GuardedSurrogate(self.vehicle, _MODE)

    @cached_property
    def gate(self) -> CompiledBackend:
        """All of that in one compiled call."""
        compiled = self.guarded.compiled
        if compiled is None:
            raise ConfigurationError("the guarded surrogate is not compiled: its primary or fallback is Python's")
        return compiled

    def physics(self, grid: tuple[int, int], precision: Precision = "float64") -> PhysicsBackend:
        """Return the compiled physics on a grid."""
        return PhysicsBackend(self.vehicle, _MODE, cells=grid, precision=precision)

    def plain(self, hidden: tuple[int, ...], activation: Activation = "relu") -> Surrogate:
        """Return a plain network that has seen the physics, and costs what any other of its size costs.

        Its hidden layers are drawn, the first one over the slip of the belts, and the last one is fitted to the physics
        by least squares.
        """
        generator = np.random.default_rng(7)
        x, runs = self.training_rows(generator)
        forces = self.physics((4, 2)).forces(x)
        inputs, outputs = Normalizer.fit(x), Normalizer.fit(forces)
        drawn = random_network((x.shape[1], *hidden, forces.shape[1]), activation, generator)
        weights = [layer.astype(np.float64) for layer in drawn.weights]
        biases = [generator.uniform(-1.0, 1.0, len(bias)) for bias in drawn.biases]
        # A slip is a small difference of two columns: without it, what is drawn tells hardly any two slips apart.
        to_slip = self._slip_columns()
        slips = Normalizer.fit(x @ to_slip)
        first = weights[0] / slips.scale[:, None]
        biases[0] += (inputs.mean @ to_slip - slips.mean) @ first
        weights[0] = inputs.scale[:, None] * (to_slip @ first)
        features = np.column_stack([_hidden_values(activation, weights, biases, inputs.normalize(x)), np.ones(len(x))])
        ridge = 1e-6 * len(x) * np.eye(features.shape[1])
        last = np.linalg.solve(features.T @ features + ridge, features.T @ outputs.normalize(forces))
        network = _single(activation, [*weights[:-1], last[:-1]], [*biases[:-1], last[-1]])
        ranges = parameter_ranges("wide", _MODE)
        return Surrogate(
            vehicle=self.vehicle,
            mode=_MODE,
            network=network,
            input_normalizer=inputs,
            output_normalizer=outputs,
            detector=BoxMahalanobisDetector.fit(x, runs, inputs, ranges, self.vehicle),
            ranges=ranges,
            recipe={"hidden": list(hidden), "drawn": True},
            dataset_hash="0" * 64,
            metrics={},
        )

    def native(self, hidden: tuple[int, ...], activation: Activation = "relu") -> NativeSurrogate:
        """Return :meth:`plain` in C."""
        return NativeSurrogate(self.vehicle, _MODE, self.plain(hidden, activation))

    def _slip_columns(self) -> FloatArray:
        """Return the matrix that turns the belts' speeds into their slip, and leaves the other columns."""
        half = self.vehicle.tread / 2
        matrix = np.eye(self.structured.interface.size)
        matrix[_VX, [_LEFT, _RIGHT]] = -1.0
        matrix[_YAW_RATE, [_LEFT, _RIGHT]] = half, -half
        return matrix

    def training_rows(self, generator: np.random.Generator) -> tuple[FloatArray, NDArray[np.int64]]:
        """Return motions over ground like asphalt, shape (n, 10), and the run of each."""
        top, count = self.vehicle.training_speed, _RUNS * _SAMPLES
        theta = np.array(named("asphalt").parameters) * np.repeat(generator.uniform(0.8, 1.2, (_RUNS, 3)), _SAMPLES, 0)
        vx, yaw_rate = generator.uniform(-0.1, 0.8, count) * top, generator.uniform(-0.06, 0.06, count) * top
        half = yaw_rate * self.vehicle.tread / 2
        slip = generator.normal(0.0, 0.02 * top, (count, 2)) * generator.choice([0.2, 1.0, 3.0], (count, 1))
        motion = [
            vx,
            generator.normal(0.0, 0.01 * top, count),
            yaw_rate,
            generator.normal(0.0, 1.0, count),
            vx * yaw_rate + generator.normal(0.0, 0.3, count),
            vx - half + slip[:, 0],
            vx + half + slip[:, 1],
        ]
        return np.column_stack([*motion, theta]), np.repeat(np.arange(_RUNS), _SAMPLES)


def _hidden_values(
    activation: Activation, weights: Sequence[FloatArray], biases: Sequence[FloatArray], z: FloatArray
) -> FloatArray:
    """Return what the last layer gets: the output of a network that has the identity in its place."""
    width = len(weights[-1])
    network = _single(activation, [*weights[:-1], np.eye(width)], [*biases[:-1], np.zeros(width)])
    values: FloatArray = network.forward(NUMPY_NETWORK, z)
    return values


def _single(activation: Activation, weights: Sequence[FloatArray], biases: Sequence[FloatArray]) -> DenseNetwork:
    return DenseNetwork(
        activation,
        tuple(layer.astype(np.float32) for layer in weights),
        tuple(layer.astype(np.float32) for layer in biases),
    )


def folded(surrogate: Surrogate) -> DenseNetwork:
    """Return a plain surrogate's network with both normalizers in its weights: columns in, forces out.

    Rivals get this one, so that they have nothing to do but the layers.
    """
    network, inputs, outputs = surrogate.network, surrogate.input_normalizer, surrogate.output_normalizer
    weights = [layer.astype(np.float64) for layer in network.weights]
    biases = [layer.astype(np.float64) for layer in network.biases]
    biases[0] = biases[0] - (inputs.mean / inputs.scale) @ weights[0]
    weights[0] = weights[0] / inputs.scale[:, None]
    weights[-1], biases[-1] = weights[-1] * outputs.scale, biases[-1] * outputs.scale + outputs.mean
    return _single(network.activation, weights, biases)
