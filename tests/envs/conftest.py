"""Force backends with closed-form motion, drivers by script, and a crude surrogate."""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from grouser.envs import BeltCommand, Simulator, VehicleState, tick
from grouser.surrogate import BoxMahalanobisDetector, DenseNetwork, Normalizer, Surrogate
from grouser.terrain import FloatArray, ForceBackend, Mode, PhysicsBackend, TrackedVehicle, parameter_ranges

M113 = TrackedVehicle.preset("m113")


class Viscous(ForceBackend):
    """Q = −(m, m, I_z)·rate·(V − V_belts): linear, so that every integrator has a closed form.

    ``jacobian_scale`` falsifies the Jacobian, to spoil Newton's convergence on purpose.
    """

    name = "viscous"

    def __init__(
        self,
        vehicle: TrackedVehicle = M113,
        mode: Mode = "rigid",
        *,
        rate: float = 1.0,
        yaw_decay: float | None = None,
        follow_belts: bool = False,
        jacobian_scale: float = 1.0,
    ) -> None:
        super().__init__(vehicle, mode)
        self.rate = rate
        self.jacobian_scale = jacobian_scale
        matrix = np.zeros((3, self.interface.size))
        matrix[0, 0] = matrix[1, 1] = -vehicle.mass * rate
        matrix[2, 2] = -vehicle.yaw_inertia * (rate if yaw_decay is None else yaw_decay)
        if follow_belts:
            matrix[0, 5:7] = vehicle.mass * rate / 2
            matrix[2, 5:7] = vehicle.yaw_inertia * rate / vehicle.tread * np.array([-1.0, 1.0])
        self.matrix = matrix

    def forces(self, x: FloatArray) -> FloatArray:
        return self.interface.check(x) @ self.matrix.T

    def forces_and_jacobian(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        return self.forces(x), self.matrix * np.where(self.matrix == 0.0, 1.0, self.jacobian_scale)


class Poisoned(Viscous):
    """Viscous, but one output is not finite once vx falls below a threshold."""

    name = "poisoned"

    def __init__(
        self, *args: Any, output: int = 0, value: float = np.nan, below: float = np.inf, **kwargs: Any
    ) -> None:
        super().__init__(*args, **kwargs)
        self.output, self.value, self.below = output, value, below

    def forces(self, x: FloatArray) -> FloatArray:
        forces = super().forces(x)
        forces[..., self.output] = np.where(np.asarray(x)[..., 0] < self.below, self.value, forces[..., self.output])
        return forces


class ConstantTurn(ForceBackend):
    """The forces under which Vx, Vy and ω never change."""

    name = "turn"

    def forces(self, x: FloatArray) -> FloatArray:
        x = self.interface.check(x)
        vx, vy, yaw_rate = x[..., 0], x[..., 1], x[..., 2]
        mass = self.vehicle.mass
        return np.stack([-mass * yaw_rate * vy, mass * yaw_rate * vx, np.zeros_like(vx)], axis=-1)


class Scripted:
    """Drives by a function of time and remembers what it was asked."""

    def __init__(self, function: Callable[[float], tuple[float, float]]) -> None:
        self.function = function
        self.resets = 0
        self.asked: list[VehicleState] = []

    def reset(self) -> None:
        self.resets += 1
        self.asked.clear()

    def command(self, state: VehicleState) -> BeltCommand:
        self.asked.append(state)
        return BeltCommand(*self.function(state.time))


@pytest.fixture
def m113() -> TrackedVehicle:
    return M113


@pytest.fixture
def viscous() -> type[Viscous]:
    return Viscous


@pytest.fixture
def newton_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the simulator's ticks solved as if Broyden's method had failed."""
    monkeypatch.setattr(tick, "_broyden_step", lambda *_: None)


@pytest.fixture
def poisoned() -> type[Poisoned]:
    return Poisoned


@pytest.fixture
def constant_turn() -> type[ConstantTurn]:
    return ConstantTurn


@pytest.fixture
def scripted() -> type[Scripted]:
    return Scripted


@pytest.fixture
def weave() -> Callable[[Simulator, int], tuple[list[BeltCommand], list[Any]]]:
    """Drive a simulator for some ticks through starts, turns both ways, braking and reverse."""

    def drive(simulator: Simulator, ticks: int) -> tuple[list[BeltCommand], list[Any]]:
        top = simulator.vehicle.training_speed
        pattern = [(0.5, 0.5), (0.2, 0.6), (0.6, 0.1), (-0.3, 0.3), (-0.4, -0.3), (0.0, 0.0), (0.9, 0.7)]
        commands, records = [], []
        for index in range(ticks):
            left, right = pattern[index // 40 % len(pattern)]
            commands.append(BeltCommand(top * left, top * right))
            records.append(simulator.step(commands[-1]))
        return commands, records

    return drive


@functools.cache
def _surrogate(mode: Mode, vehicle_name: str) -> Surrogate:
    vehicle = TrackedVehicle.preset(vehicle_name)
    generator = np.random.default_rng(0)
    ranges, top, samples = parameter_ranges("wide", mode), vehicle.training_speed, 100
    blocks = []
    for _ in range(24):
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
        blocks.append(np.column_stack([*motion, np.tile(ranges.sample(generator).parameters, (samples, 1))]))
    x, runs = np.concatenate(blocks), np.repeat(np.arange(24), samples)
    inputs = Normalizer.fit(x)
    forces = PhysicsBackend(vehicle, mode, cells=(2, 1)).forces(x)
    outputs = Normalizer.fit(forces)
    # A wholly random network need not even dissipate, and throws the vehicle about.
    first = generator.normal(0.0, 0.3, (x.shape[1], 32))
    hidden = np.column_stack([np.tanh((x - inputs.mean) / inputs.scale @ first), np.ones(len(x))])
    last = np.linalg.lstsq(hidden, (forces - outputs.mean) / outputs.scale, rcond=1e-3)[0]
    weights = (first.astype(np.float32), last[:-1].astype(np.float32))
    return Surrogate(
        vehicle=vehicle,
        mode=mode,
        network=DenseNetwork("tanh", weights, (np.zeros(32, np.float32), last[-1].astype(np.float32))),
        input_normalizer=inputs,
        output_normalizer=outputs,
        detector=BoxMahalanobisDetector.fit(x, runs, inputs, ranges, vehicle),
        ranges=ranges,
        recipe={"hidden": [32], "seed": 0},
        dataset_hash="0" * 64,
        metrics={"r2": [0.1, 0.2, 0.3]},
    )


@pytest.fixture
def make_surrogate() -> Callable[[Mode], Surrogate]:
    """A surrogate of the M113 in a mode, random but for its linear last layer; always the same one."""

    def make(mode: Mode = "rigid") -> Surrogate:
        return _surrogate(mode, "m113")

    return make
