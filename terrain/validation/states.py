"""States on which implementations are compared: all over the place, and like those of a driven vehicle."""

from __future__ import annotations

import numpy as np

from ..backend import ForceBackend
from ..closed_forms import shear_capacity
from ..errors import InvalidInputError
from ..interface import FloatArray, Mode, interface
from ..parameters import parameter_ranges
from ..physics import PhysicsBackend
from ..steady import steady_turn
from ..vehicle import GRAVITY, TrackedVehicle


def random_states(vehicle: TrackedVehicle, mode: Mode, count: int, seed: int = 0) -> FloatArray:
    """Draw states without regard for how they could come about: slips of any size, lifted wheels and sides, reverse.

    Velocities reach the training speed, accelerations 20 m/s², and belts run at no less than a twentieth of the
    training speed, so that the states suit V_ε = 0; ground is drawn from the wide ranges.

    Returns
    -------
    ndarray, shape (count, d)
    """
    generator = np.random.default_rng(seed)
    top = vehicle.training_speed
    x = np.zeros((count, interface(mode).size))
    x[:, 0] = generator.uniform(-1, 1, count) * top
    x[:, 1] = generator.uniform(-0.3, 0.3, count) * top
    x[:, 2] = generator.uniform(-0.3, 0.3, count) * top / vehicle.tread
    x[:, 3:5] = generator.uniform(-20, 20, (count, 2))
    belts = generator.uniform(-1, 1, (count, 2)) * top
    x[:, 5:7] = np.copysign(np.maximum(np.abs(belts), 0.05 * top), belts)
    x[:, 7:] = _grounds(mode, count, generator)
    return x


def driven_states(vehicle: TrackedVehicle, mode: Mode, count: int, seed: int = 0) -> FloatArray:
    """Draw states like those of a driven vehicle: steady turns, disturbed.

    Turns of 5 m radius (of the M113's size) to straight, at a tenth of the training speed to all of it, up to six
    tenths of what the ground holds sideways, on ground from the wide ranges; then belts are changed by 10 %, Vy and ω by 5 % of their scale, and accelerations by
    1 m/s², as between two steady turns. Nothing is simulated: the tick lies in a room above this one.

    Returns
    -------
    ndarray, shape (count, d)
    """
    generator = np.random.default_rng(seed)
    backend: ForceBackend = PhysicsBackend(vehicle, mode, cells=(4, 2))
    ranges = parameter_ranges("wide", mode)
    top = vehicle.training_speed
    rows: list[FloatArray] = []
    size = vehicle.contact_length / 2.667
    while len(rows) < count:
        terrain = ranges.sample(generator)
        speed = generator.uniform(0.1, 1.0) * top
        grip = GRAVITY * shear_capacity(vehicle, terrain) / vehicle.weight
        tightest = max(5.0 * size, speed**2 / (0.6 * grip))
        radius = float(generator.choice([-1.0, 1.0]) * tightest / generator.uniform(0.01, 1.0))
        try:
            rows.append(steady_turn(backend, terrain, speed, radius).row)
        except InvalidInputError:
            continue
    x = np.array(rows)
    disturbance = generator.normal(size=(count, 7))
    moving = np.hypot(x[:, 0], x[:, 1])
    x[:, 1] += 0.05 * moving * disturbance[:, 1]
    x[:, 2] += 0.05 * moving / vehicle.tread * disturbance[:, 2]
    x[:, 3:5] += disturbance[:, 3:5]
    x[:, 5:7] += 0.1 * moving[:, None] * disturbance[:, 5:7]
    slow = np.abs(x[:, 5:7]) < 0.05 * top
    x[:, 5:7] = np.where(slow, np.copysign(0.05 * top, x[:, 5:7]), x[:, 5:7])
    return x


def without_corners(vehicle: TrackedVehicle, x: FloatArray) -> FloatArray:
    """Return the rows clear of lift-off and of cells that do not slide: there the force itself has a corner."""
    turn = x[:, 2:3] * vehicle.tread / 2
    sliding = np.abs(np.concatenate([x[:, :1] - turn, x[:, :1] + turn], axis=1) - x[:, 5:7])
    clear = np.all(sliding > 0.05 + np.abs(x[:, 2:3]) * vehicle.track_width / 2, axis=1)
    lifted = 0.8 * GRAVITY * np.array([vehicle.contact_length / 6, vehicle.tread / 2]) / max(vehicle.cg_height, 1e-3)
    return np.asarray(x[clear & np.all(np.abs(x[:, 3:5]) < lifted, axis=1)])


def _grounds(mode: Mode, count: int, generator: np.random.Generator) -> FloatArray:
    ranges = parameter_ranges("wide", mode)
    return np.array([ranges.sample(generator).parameters for _ in range(count)])
