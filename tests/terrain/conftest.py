"""An independent, deliberately naive block, and the states on which every implementation is compared with it."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from belt_path import walked_distance

from grouser.terrain import FloatArray, Mode, TrackedVehicle, interface, parameter_ranges

_M113 = TrackedVehicle.preset("m113")
VEHICLES = {
    "m113": _M113,
    "maxxii": TrackedVehicle.preset("maxxii"),
    "marder, CG 0.4 m forward": replace(TrackedVehicle.preset("marder"), cg_offset=0.4),
    "m113, CG 0.3 m back, one element": replace(_M113, cg_offset=-0.3, road_wheels=1),
}


def naive_forces(
    vehicle: TrackedVehicle,
    mode: Mode,
    row: Sequence[float],
    *,
    along: int,
    across: int,
    contact: str,
    soft_speed: float,
    path: str = "soft",
) -> list[float]:
    """[Qx, Qy, Mz] of one row, cell by cell with scalars, read off the specification line by line."""
    vx, vy, omega, ax, ay, belt_left, belt_right = (float(value) for value in row[:7])
    if mode == "rigid":
        mu, f_r, k = (float(value) for value in row[7:])
    else:
        c, phi, f_r, k = (float(value) for value in row[7:])
    g = 9.81
    m, h, length, n = vehicle.mass, vehicle.cg_height, vehicle.contact_length, vehicle.road_wheels
    weight = m * g
    ell = vehicle.patch_length or length / n
    centre = -vehicle.cg_offset
    # The first patch begins where the contact length does, the last ends with it, equal gaps between.
    gap = (length - n * ell) / (n - 1) if n > 1 else 0.0
    x_of = [centre - length / 2 + ell / 2 + i * (ell + gap) for i in range(n)]

    e = -h * ax / g
    spread = sum((x - centre) ** 2 for x in x_of)
    shares = [1 / n + (x - centre) * (e - centre) / spread for x in x_of] if n > 1 else [1.0]
    shares = [max(share, 0.0) for share in shares]
    shares = [share / sum(shares) for share in shares]

    transfer = m * ay * h / vehicle.tread
    tracks = [
        (vehicle.tread / 2, belt_left, weight / 2 - transfer),
        (-vehicle.tread / 2, belt_right, weight / 2 + transfer),
    ]
    qx = qy = mz = 0.0
    for y_track, belt, raw_load in tracks:
        side_load = min(max(raw_load, 0.0), weight)
        speed = math.sqrt(belt * belt + soft_speed * soft_speed)
        s = belt / speed
        for x_i, share in zip(x_of, shares, strict=True):
            load = side_load * share
            pressure = load / (ell * vehicle.track_width)
            if mode == "rigid":
                strength = mu * pressure
            else:
                strength = c * min(1.0, load / (0.05 * weight / (2 * n))) + pressure * math.tan(phi)
            area = ell * vehicle.track_width / (along * across)
            for p in range(along):
                x = x_i - ell / 2 + (p + 0.5) * ell / along
                d = length / 2 - s * (x - centre) if contact == "continuous" else ell / 2 - s * (x - x_i)
                for q in range(across):
                    y = y_track - vehicle.track_width / 2 + (q + 0.5) * vehicle.track_width / across
                    slip_x, slip_y = vx - omega * y - belt, vy + omega * x
                    slip = math.hypot(slip_x, slip_y)
                    if slip == 0.0:
                        continue
                    if path == "soft":
                        sheared = slip * d / speed
                    else:
                        sheared = walked_distance(x, y, (vx, vy, omega), belt, d / speed)
                    stress = strength * -math.expm1(-sheared / k)
                    fx, fy = -stress * area * slip_x / slip, -stress * area * slip_y / slip
                    qx += fx
                    qy += fy
                    mz += x * fy - y * fx
        rolling = -f_r * side_load * s
        qx += rolling
        mz += -y_track * rolling
    return [qx, qy, mz]


def make_states(vehicle: TrackedVehicle, mode: Mode, count: int, seed: int) -> FloatArray:
    """Driven states with a share of locked, reversed and racing belts, and accelerations that lift wheels and sides."""
    rng = np.random.default_rng(seed)
    top = vehicle.training_speed
    x = np.zeros((count, interface(mode).size))
    vx = x[:, 0] = rng.uniform(-0.3, 1.0, count) * top
    x[:, 1] = rng.normal(0, 0.05 * top, count)
    omega = x[:, 2] = rng.normal(0, 0.1 * top / vehicle.tread, count)
    x[:, 3:5] = rng.normal(0, 2.0, (count, 2))
    for column, y in ((5, vehicle.tread / 2), (6, -vehicle.tread / 2)):
        x[:, column] = (vx - omega * y) * (1 + rng.normal(0, 0.15, count)) + rng.normal(0, 0.01 * top, count)
    x[::7, 3] *= 10  # shares clipped at 0
    x[::5, 4] *= 10  # a side clipped at 0, the other at W
    x[::6, 5] *= -1  # reversed belt
    x[::9, 6] = 0.0  # locked belt
    x[::27, 5] = 0.0  # both locked
    x[3::29, [0, 1, 2]] = 0.0  # standing, belts running
    x[1::31, 5] = x[1::31, 6] = x[1::31, 0]  # rolling without slip, but for the turn
    ranges = parameter_ranges("wide", mode)
    x[:, 7:] = np.array([ranges.sample(rng).parameters for _ in range(count)])
    return x


NaiveBlock = Callable[..., FloatArray]


@pytest.fixture
def naive() -> NaiveBlock:
    """The naive block over rows of an interface array."""

    def evaluate(vehicle: TrackedVehicle, mode: Mode, x: FloatArray, **options: object) -> FloatArray:
        return np.array([naive_forces(vehicle, mode, row, **options) for row in x.tolist()])  # type: ignore[arg-type]

    return evaluate


@pytest.fixture
def states() -> Callable[..., FloatArray]:
    """Random interface arrays: ``states(vehicle, mode, count, seed=0)``."""

    def draw(vehicle: TrackedVehicle, mode: Mode, count: int, seed: int = 0) -> FloatArray:
        return make_states(vehicle, mode, count, seed)

    return draw


@pytest.fixture(params=list(VEHICLES.values()), ids=list(VEHICLES))
def vehicle(request: pytest.FixtureRequest) -> TrackedVehicle:
    """Each of several vehicles: presets, a CG off the contact centre, a single element."""
    chosen: TrackedVehicle = request.param
    return chosen
