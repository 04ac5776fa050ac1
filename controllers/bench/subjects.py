"""What is timed: rows of a drive, surrogates of any width, and the backends by the names that tables give them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

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
        """Return a plain network that is right about the drive's rows, and costs what any other of its size costs.

        Its hidden layers are drawn, and the last one is fitted to the physics by least squares.
        """
        generator = np.random.default_rng(7)
        x, runs = self._training_rows(generator)
        forces = self.physics((4, 2)).forces(x)
        inputs, outputs = Normalizer.fit(x), Normalizer.fit(forces)
        drawn = random_network((x.shape[1], *hidden, forces.shape[1]), activation, generator)
        biases = [generator.uniform(-0.5, 0.5, len(bias)).astype(np.float32) for bias in drawn.biases]
        body = DenseNetwork(
            activation,
            (*drawn.weights[:-1], np.eye(hidden[-1], dtype=np.float32)),
            (*biases[:-1], np.zeros(hidden[-1], np.float32)),
        )
        z = body.forward(NUMPY_NETWORK, inputs.normalize(x))
        z = {"relu": lambda: np.maximum(z, 0), "silu": lambda: z / (1 + np.exp(-z)), "tanh": lambda: np.tanh(z)}[
            activation
        ]()
        features = np.column_stack([z, np.ones(len(z))])
        ridge = 1e-3 * len(z) * np.eye(features.shape[1])
        last = np.linalg.solve(features.T @ features + ridge, features.T @ outputs.normalize(forces))
        network = DenseNetwork(activation, (*drawn.weights[:-1], last[:-1]), (*biases[:-1], last[-1]))
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

    def _training_rows(self, generator: np.random.Generator) -> tuple[FloatArray, np.ndarray]:
        """Return driving rows of many grounds, and the run of each."""
        ranges, top, count, samples = parameter_ranges("wide", _MODE), self.vehicle.training_speed, 40, 60
        total = count * samples
        vx, yaw_rate = generator.uniform(-0.7, 0.7, total) * top, generator.uniform(-0.1, 0.1, total) * top
        half = yaw_rate * self.vehicle.tread / 2
        motion = [
            vx,
            generator.normal(0.0, 0.02 * top, total),
            yaw_rate,
            generator.normal(0.0, 1.5, total),
            vx * yaw_rate + generator.normal(0.0, 0.5, total),
            np.clip(vx - half + generator.normal(0.0, 0.05 * top, total), -top, top),
            np.clip(vx + half + generator.normal(0.0, 0.05 * top, total), -top, top),
        ]
        theta = [ranges.sample(generator).parameters for _ in range(count)]
        return np.column_stack([*motion, np.repeat(theta, samples, axis=0)]), np.repeat(np.arange(count), samples)


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
    return DenseNetwork(
        network.activation,
        tuple(layer.astype(np.float32) for layer in weights),
        tuple(layer.astype(np.float32) for layer in biases),
    )
