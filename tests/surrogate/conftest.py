"""Plausible driving rows, and untrained surrogates over them."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from grouser.surrogate import (
    NUMPY_NETWORK,
    Activation,
    BoxMahalanobisDetector,
    DenseNetwork,
    Normalizer,
    Surrogate,
    random_network,
)
from grouser.surrogate.track_model import FEATURES, SIDES, track_state
from grouser.terrain import FloatArray, Mode, PhysicsBackend, TrackedVehicle, parameter_ranges

Rows = tuple[FloatArray, NDArray[np.int64]]


def _driving_rows(vehicle: TrackedVehicle, mode: Mode, runs: int = 24, samples: int = 100, seed: int = 0) -> Rows:
    """Runs of one terrain each, in which belts, speed and yaw rate belong together."""
    generator = np.random.default_rng(seed)
    ranges, top = parameter_ranges("wide", mode), vehicle.training_speed
    blocks = []
    for _ in range(runs):
        vx = generator.uniform(-0.7, 0.7, samples) * top
        yaw_rate = generator.uniform(-0.1, 0.1, samples) * top
        slip = generator.normal(0.0, 0.03 * top, (samples, 2))
        half = yaw_rate * vehicle.tread / 2
        motion = [
            vx,
            generator.normal(0.0, 0.02 * top, samples),
            yaw_rate,
            generator.normal(0.0, 1.5, samples),
            vx * yaw_rate + generator.normal(0.0, 0.5, samples),
            np.clip(vx - half + slip[:, 0], -top, top),
            np.clip(vx + half + slip[:, 1], -top, top),
        ]
        theta = ranges.sample(generator).parameters
        blocks.append(np.column_stack([*motion, np.tile(theta, (samples, 1))]))
    return np.concatenate(blocks), np.repeat(np.arange(runs), samples)


@pytest.fixture
def driving_rows() -> Callable[..., Rows]:
    return _driving_rows


@pytest.fixture
def m113() -> TrackedVehicle:
    return TrackedVehicle.preset("m113")


@pytest.fixture
def make_surrogate(m113: TrackedVehicle) -> Callable[..., Surrogate]:
    def make(
        mode: Mode = "rigid",
        activation: Activation = "silu",
        hidden: tuple[int, ...] = (32, 24),
        vehicle: TrackedVehicle = m113,
    ) -> Surrogate:
        x, runs = _driving_rows(vehicle, mode)
        ranges, inputs = parameter_ranges("wide", mode), Normalizer.fit(x)
        return Surrogate(
            vehicle=vehicle,
            mode=mode,
            network=random_network((x.shape[1], *hidden, 3), activation, np.random.default_rng(1)),
            input_normalizer=inputs,
            output_normalizer=Normalizer.fit(PhysicsBackend(vehicle, mode, cells=(2, 1)).forces(x)),
            detector=BoxMahalanobisDetector.fit(x, runs, inputs, ranges, vehicle),
            ranges=ranges,
            recipe={"hidden": list(hidden), "seed": 1},
            dataset_hash="0" * 64,
            metrics={"r2": [0.1, 0.2, 0.3]},
        )

    return make


@pytest.fixture
def make_structured(m113: TrackedVehicle) -> Callable[..., Surrogate]:
    """Structured surrogates whose untrained networks add tenths of the strength, also where the slip is nothing."""

    def make(
        mode: Mode = "rigid",
        activation: Activation = "silu",
        hidden: tuple[int, ...] = (32, 24),
        vehicle: TrackedVehicle = m113,
        seed: int = 1,
    ) -> Surrogate:
        x, runs = _driving_rows(vehicle, mode)
        generator, units = np.random.default_rng(seed), 3 * vehicle.road_wheels
        features = [track_state(NUMPY_NETWORK, vehicle, mode, x, side).features for side in SIDES]
        network = random_network((FEATURES, *hidden, units), activation, generator)
        biases = tuple(generator.normal(0.0, 0.3, len(bias)).astype(np.float32) for bias in network.biases)
        ranges = parameter_ranges("wide", mode)
        return Surrogate(
            vehicle=vehicle,
            mode=mode,
            network=DenseNetwork(activation, network.weights, biases),
            input_normalizer=Normalizer.fit(np.concatenate(features)),
            output_normalizer=Normalizer(generator.normal(0.0, 0.05, units), generator.uniform(0.05, 0.15, units)),
            detector=BoxMahalanobisDetector.fit(x, runs, Normalizer.fit(x), ranges, vehicle),
            ranges=ranges,
            recipe={"hidden": list(hidden), "seed": seed},
            dataset_hash="0" * 64,
            metrics={"r2": [0.1, 0.2, 0.3]},
            feature_map="track",
        )

    return make
