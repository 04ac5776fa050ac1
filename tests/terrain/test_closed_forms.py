"""The block against results that can be written down: golden state, thrust, turning moments, saturation, power."""

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

from grouser.terrain import (
    CONTACTS,
    MODES,
    Contact,
    FloatArray,
    InvalidInputError,
    Mode,
    PhysicsBackend,
    ShearGrid,
    TrackedVehicle,
    interface,
    reference_forces,
)

M113 = TrackedVehicle.preset("m113")
L, B, WIDTH, W = 2.667, 2.159, 0.38, 11300 * 9.81


def rigid(
    vx: float = 0.0,
    vy: float = 0.0,
    yaw_rate: float = 0.0,
    belts: tuple[float, float] = (0.0, 0.0),
    *,
    mu: float = 0.7,
    fr: float = 0.0,
    k: float = 0.05,
) -> FloatArray:
    return np.array([vx, vy, yaw_rate, 0.0, 0.0, *belts, mu, fr, k])


# Check 1


def test_the_golden_state_to_every_printed_digit() -> None:
    row = rigid(3.0, 0.2, 0.3, (2.5, 3.8))
    golden = [8138.6, -22584.2, 37624.7]
    half_a_digit = 0.05
    oracle = reference_forces(M113, "rigid", row, grid=ShearGrid(104, 64), soft_speed=0.0)
    compiled = PhysicsBackend(M113, "rigid", cells=(104, 64), soft_speed=0.0).forces(row)
    np.testing.assert_allclose(oracle, golden, rtol=0, atol=half_a_digit)
    np.testing.assert_allclose(compiled, golden, rtol=0, atol=half_a_digit)


# Check 2


def shear_bracket(length: float, slip: float, k: float, s: float = 1.0) -> float:
    """Mean of 1 - exp(-slip d/k) over d from length (1 - s)/2 to length (1 + s)/2."""
    decay = math.exp(-slip * length * (1 - s) / (2 * k)) - math.exp(-slip * length * (1 + s) / (2 * k))
    return 1 - k / (slip * s * length) * decay


def midpoint_error(strength: float, step: float, length: float, slip: float, k: float) -> float:
    """Error of the midpoint sum: step^2/24 times the change of slope over the length, at most slip/k; doubled."""
    return strength * step**2 / 12 * slip / (k * length)


GROUNDS: list[tuple[Mode, list[float], float]] = [
    ("rigid", [0.7, 0.0, 0.05], 0.7 * W),
    ("soil", [5e3, 0.5, 0.0, 0.02], 5e3 * 2 * WIDTH * L + W * math.tan(0.5)),
]


@pytest.mark.parametrize(("mode", "theta", "strength"), GROUNDS, ids=MODES)
@pytest.mark.parametrize("slip", [-0.5, -0.05, 0.02, 0.2, 0.9])
@pytest.mark.parametrize("direction", [1, -1])
def test_thrust_follows_slip_by_the_closed_form(
    mode: Mode, theta: list[float], strength: float, slip: float, direction: int
) -> None:
    vt = direction * 4.0
    vx = vt * (1 - slip)
    row = np.array([vx, 0, 0, 0, 0, vt, vt, *theta])
    thrust = PhysicsBackend(M113, mode, cells=(128, 1), soft_speed=0.0).forces(row)[0]
    k = theta[-1]
    expected = direction * math.copysign(strength * shear_bracket(L, abs(slip), k), slip)
    assert thrust == pytest.approx(expected, abs=midpoint_error(strength, L / 5 / 128, L, abs(slip), k))


@pytest.mark.parametrize(("mode", "theta", "strength"), GROUNDS, ids=MODES)
@pytest.mark.parametrize(("vx", "vt"), [(3.0, 3.2), (0.1, 0.15), (0.0, 0.05), (0.3, -0.1), (-2.0, -2.5)])
def test_thrust_with_soft_speed_follows_its_closed_form(
    mode: Mode, theta: list[float], strength: float, vx: float, vt: float
) -> None:
    row = np.array([vx, 0, 0, 0, 0, vt, vt, *theta])
    thrust = PhysicsBackend(M113, mode, cells=(128, 1)).forces(row)[0]
    speed, k = math.hypot(vt, 0.1), theta[-1]
    slip = abs(vx - vt) / speed
    expected = math.copysign(strength * shear_bracket(L, slip, k, vt / speed), vt - vx)
    assert thrust == pytest.approx(expected, abs=midpoint_error(strength, L / 5 / 128, L, slip, k))


@pytest.mark.parametrize(("length", "width", "printed_kilonewton"), [(3.6, 1.0, 51.68), (4.5, 0.8, 52.45)])
def test_wongs_worked_example(length: float, width: float, printed_kilonewton: float) -> None:
    weight, c, phi, k, slip = 135e3, 1e3, math.radians(19.7), 0.05, 0.2
    strength = 2 * length * width * c + weight * math.tan(phi)
    closed = strength * shear_bracket(length, slip, k)
    v = replace(M113, mass=weight / 9.81, contact_length=length, track_width=width, tread=2.5)
    row = np.array([0.8, 0, 0, 0, 0, 1.0, 1.0, c, phi, 0.0, k])
    by_block = PhysicsBackend(v, "soil", cells=(128, 1), soft_speed=0.0).forces(row)[0]
    assert closed / 1e3 == pytest.approx(printed_kilonewton, abs=0.005)  # half of the last printed digit
    assert by_block == pytest.approx(closed, abs=midpoint_error(strength, length / 640, length, slip, k))


# Checks 3 and 4. K -> 0: every cell slides at full strength.

SLIDING = 1e-9


def quadrant_radius(a: float, h: float) -> float:
    """Integral of the radius over [0, a] x [0, h]."""
    return a * h * math.hypot(a, h) / 3 + (a**3 * math.asinh(h / a) + h**3 * math.asinh(a / h)) / 6


@pytest.mark.parametrize("contact", CONTACTS)
@pytest.mark.parametrize("turn", [1, -1])
def test_a_matched_pivot_meets_the_moment_of_full_slip(contact: Contact, turn: int) -> None:
    omega = 0.5 * turn
    row = rigid(yaw_rate=omega, belts=(-omega * B / 2, omega * B / 2), k=SLIDING)
    forces = PhysicsBackend(M113, "rigid", cells=(120, 60), contact=contact).forces(row)
    expected = 0.7 * W * quadrant_radius(L / 2, WIDTH / 2) / (L * WIDTH / 4)
    assert expected == pytest.approx(52_955, abs=0.5)  # as printed
    # Midpoint error of the cone |r| near its tip: of order (cell/length)^2, here 3e-6.
    np.testing.assert_allclose(forces, [0, 0, -turn * expected], rtol=1e-5, atol=1e-9 * W)


def test_a_thin_track_pivots_against_a_quarter_of_mu_w_l() -> None:
    thin = replace(M113, track_width=1e-3)
    row = rigid(yaw_rate=0.5, belts=(-0.5 * B / 2, 0.5 * B / 2), k=SLIDING)
    expected = 0.7 * W * L / 4
    assert expected == pytest.approx(51_738, abs=0.5)  # as printed
    moment = PhysicsBackend(thin, "rigid", cells=(100, 2)).forces(row)[2]
    assert moment == pytest.approx(-expected, rel=1e-5)  # (b/L)^2 and cells, both below 1e-5


@pytest.mark.parametrize("contact", CONTACTS)
def test_locked_tracks_meet_the_moment_of_full_slip(contact: Contact) -> None:
    forces = PhysicsBackend(M113, "rigid", cells=(60, 40), contact=contact).forces(rigid(yaw_rate=0.5, k=SLIDING))
    outer, inner = (quadrant_radius(L / 2, (B + sign * WIDTH) / 2) for sign in (1, -1))
    expected = 0.7 * W * (outer - inner) / (L * WIDTH / 2)
    assert expected == pytest.approx(101_864, abs=0.5)  # as printed
    np.testing.assert_allclose(forces, [0, 0, -expected], rtol=1e-5, atol=1e-9 * W)  # midpoint error, as above


@pytest.mark.parametrize(("ratio", "printed"), [(1.0, 0.20073), (1.25, 0.27705), (1.5, 0.35917), (2.0, 0.53300)])
def test_a_steady_skid_turn_balances_at_the_published_slip(ratio: float, printed: float) -> None:
    line = replace(M113, track_width=1e-6, tread=L / ratio)
    block = PhysicsBackend(line, "rigid", cells=(800, 1), soft_speed=0.0)
    omega, vx = 0.3, 4.0

    def moment(slip: float) -> float:
        u = slip * omega * L / 2
        belts = (vx - omega * line.tread / 2 - u, vx + omega * line.tread / 2 + u)
        return float(block.forces(rigid(vx, 0.0, omega, belts, k=SLIDING))[2])

    balance = brentq(moment, 0.05, 1.0, xtol=1e-9)
    assert balance == pytest.approx(printed, abs=1e-5)  # the last printed digit


# Check 6


@pytest.mark.parametrize("direction", [1, -1])
def test_locked_tracks_sliding_sideways_saturate_at_friction(direction: int) -> None:
    k = 0.05
    vy = direction * 20 * 2 * 0.1 * k / L  # |Vy| L/(2 V_eps K) = 20
    qx, qy, mz = PhysicsBackend(M113, "rigid").forces(rigid(vy=vy, k=k))
    assert qy == pytest.approx(-direction * 0.7 * W, rel=1e-8)  # exp(-20) = 2e-9
    assert (qx, mz) == pytest.approx((0.0, 0.0), abs=1e-10 * W)


@pytest.mark.parametrize("belts", [(0.0, 3.0), (3.0, 0.0)])
def test_a_stopped_belt_is_refused_without_soft_speed(belts: tuple[float, float]) -> None:
    block = PhysicsBackend(M113, "rigid", soft_speed=0.0)
    row = rigid(3.0, belts=belts)
    with pytest.raises(InvalidInputError, match="v_left" if belts[0] == 0 else "v_right"):
        block.forces(row)
    with pytest.raises(InvalidInputError):
        block.forces_and_jacobian(row)
    with pytest.raises(InvalidInputError):
        block.track_forces(row[None], row[None])


# Check 7


def slip_power(vehicle: TrackedVehicle, mode: Mode, x: FloatArray, grid: ShearGrid) -> FloatArray:
    """Power lost in every cell, shape (n, cells): stress times sliding speed times area."""
    vx, vy, omega, ax, ay, *belts = (x[:, i, None] for i in range(7))
    n, length, b = vehicle.road_wheels, vehicle.contact_length, vehicle.track_width
    ell, weight = length / n, vehicle.mass * 9.81
    centre = -vehicle.cg_offset
    x_i = centre + ell * (np.arange(n) - (n - 1) / 2)
    shares = 1 / n + (x_i - centre) * (-vehicle.cg_height * ax / 9.81 - centre) / np.sum((x_i - centre) ** 2)
    shares = np.maximum(shares, 0)
    shares /= shares.sum(axis=1, keepdims=True)
    transfer = vehicle.mass * ay * vehicle.cg_height / vehicle.tread
    along = ell * ((np.arange(grid.along) + 0.5) / grid.along - 0.5)
    across = b * ((np.arange(grid.across) + 0.5) / grid.across - 0.5)
    area = ell * b / (grid.along * grid.across)
    k = x[:, -1, None]
    lost = []
    for side, vt in zip((1, -1), belts, strict=True):
        side_load = np.clip(weight / 2 - side * transfer, 0, weight)
        speed = np.sqrt(vt**2 + vehicle.soft_speed**2)
        for i in range(n):
            load = side_load * shares[:, i, None]
            pressure = load / (ell * b)
            if mode == "rigid":
                strength = x[:, 7, None] * pressure
            else:
                fade = np.minimum(1, load / (0.05 * weight / (2 * n)))
                strength = x[:, 7, None] * fade + pressure * np.tan(x[:, 8, None])
            px, py = (a.ravel() for a in np.meshgrid(x_i[i] + along, side * vehicle.tread / 2 + across))
            origin, reach = (centre, length) if grid.contact == "continuous" else (x_i[i], ell)
            sliding = np.hypot(vx - omega * py - vt, vy + omega * px)
            shear = sliding * (reach / 2 - vt / speed * (px - origin)) / speed
            lost.append(-strength * np.expm1(-shear / k) * sliding * area)
    return np.concatenate(lost, axis=1)


@pytest.mark.parametrize("contact", CONTACTS)
@pytest.mark.parametrize("mode", MODES)
def test_belt_power_is_vehicle_power_plus_slip_losses(
    mode: Mode, contact: Contact, states: Callable[..., FloatArray]
) -> None:
    x = states(M113, mode, 300)
    x[:, interface(mode).index("fr")] = 0.0
    block = PhysicsBackend(M113, mode, cells=(6, 3), contact=contact)
    tracks, total = block.track_forces(x, x), block.forces(x)
    lost = slip_power(M113, mode, x, ShearGrid(6, 3, contact))
    driven = x[:, 5] * tracks[:, 0, 0] + x[:, 6] * tracks[:, 1, 0]
    received = np.sum(total * x[:, :3], axis=1)
    assert np.all(lost >= 0)
    flow = np.abs(total) @ np.ones(3) * 10 + lost.sum(axis=1)  # what the terms amount to, at up to 10 m/s
    np.testing.assert_array_less(np.abs(driven - received - lost.sum(axis=1)), 1e-12 * (flow + W))


# Check 9


def test_the_grid_converges_at_the_published_pace(states: Callable[..., FloatArray]) -> None:
    x = states(M113, "rigid", 200)
    x[:, 3:5] = np.clip(x[:, 3:5], -5, 5)  # driven states: no lift-off, every belt running
    x = x[np.abs(x[:, 5:7]).min(axis=1) > 0.5]
    x[:, 5:7] = np.abs(x[:, 5:7])
    x[:, 0] = np.abs(x[:, 0])
    fine = PhysicsBackend(M113, "rigid", cells=(80, 40)).forces(x)
    worst = [
        float(np.max(np.sqrt(np.mean((PhysicsBackend(M113, "rigid", cells=cells).forces(x) - fine) ** 2, axis=0))
                     / fine.std(axis=0)))
        for cells in ((2, 1), (8, 4), (16, 4), (32, 8))
    ]  # fmt: skip
    # Twice the upper end of the published bands: other states, other terrain.
    assert np.all(np.array(worst) < 2 * np.array([0.048, 0.0024, 0.0030, 0.0007]))
    assert all(finer < coarser for coarser, finer in pairwise(worst))
