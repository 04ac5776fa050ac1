"""The closed forms as functions: printed figures, quadrature, limits, and what they refuse."""

import math
from collections.abc import Callable
from dataclasses import replace

import pytest
from scipy.integrate import dblquad, quad

from grouser.terrain import (
    InvalidInputError,
    RigidTerrain,
    SoilTerrain,
    TrackedVehicle,
    locked_tracks_moment,
    matched_pivot_moment,
    mobilized_share,
    radius_integral,
    shear_capacity,
    skid_turn_slip,
    straight_thrust,
    turning_resistance,
)

M113 = TrackedVehicle.preset("m113")


def test_friction_bears_mu_w_and_soil_adds_cohesion_over_the_contact_area() -> None:
    assert shear_capacity(M113, RigidTerrain(0.7)) == pytest.approx(0.7 * 11300 * 9.81)
    soil = shear_capacity(M113, SoilTerrain(2e3, 0.5))
    assert soil == pytest.approx(2e3 * 2 * 2.667 * 0.38 + 11300 * 9.81 * math.tan(0.5))


@pytest.mark.parametrize("slip", [1e-9, 0.01, 0.3, 5.0])
@pytest.mark.parametrize("rolling", [1.0, 0.6, 1e-9, 0.0, -0.6])
def test_the_mobilized_share_is_the_mean_over_the_way_on_the_ground(slip: float, rolling: float) -> None:
    length, k = 2.667, 0.02

    def stress(x: float) -> float:
        return -math.expm1(-slip * (length / 2 - rolling * x) / k)

    mean = quad(stress, -length / 2, length / 2, epsabs=0, epsrel=1e-12)[0] / length
    assert mobilized_share(length, slip, k, rolling=rolling) == pytest.approx(mean, rel=1e-7)


def test_the_mobilized_share_does_not_overflow() -> None:
    assert mobilized_share(3.0, 1e9, 1e-6) == pytest.approx(1.0)


@pytest.mark.parametrize(("length", "width", "printed"), [(3.6, 1.0, 51.68), (4.5, 0.8, 52.45)])
def test_wongs_worked_example(length: float, width: float, printed: float) -> None:
    tracked = replace(M113, mass=135e3 / 9.81, contact_length=length, track_width=width, tread=2.5)
    thrust = straight_thrust(tracked, SoilTerrain(1e3, math.radians(19.7), 0.1, 0.05), 0.8, 1.0)
    assert thrust / 1e3 == pytest.approx(printed, abs=0.005)  # half of the last printed digit


def test_thrust_has_the_sign_of_the_belt_over_the_ground() -> None:
    ground = RigidTerrain(0.7)
    assert straight_thrust(M113, ground, 3.0, 3.3) > 0 > straight_thrust(M113, ground, 3.0, 2.7)
    assert straight_thrust(M113, ground, -3.0, -3.3) == -straight_thrust(M113, ground, 3.0, 3.3)
    assert straight_thrust(M113, ground, 3.0, 3.0) == 0.0


def test_stopped_belts_need_a_soft_speed() -> None:
    with pytest.raises(InvalidInputError, match="soft_speed"):
        straight_thrust(M113, RigidTerrain(0.7), 1.0, 0.0)
    assert straight_thrust(M113, RigidTerrain(0.7), 1.0, 0.0, 0.1) < 0


@pytest.mark.parametrize(("a", "h"), [(1.0, 1.0), (1.3, 0.2), (0.01, 3.0)])
def test_the_radius_integral_is_the_integral_of_the_radius(a: float, h: float) -> None:
    integral = dblquad(lambda y, x: math.hypot(x, y), 0, a, 0, h, epsabs=0, epsrel=1e-9)[0]
    assert radius_integral(a, h) == pytest.approx(integral, rel=1e-8)


def test_full_slip_moments_are_the_printed_ones() -> None:
    assert matched_pivot_moment(M113, 0.7) == pytest.approx(52_955, abs=0.5)
    assert locked_tracks_moment(M113, 0.7) == pytest.approx(101_864, abs=0.5)
    thin = replace(M113, track_width=1e-4)
    assert matched_pivot_moment(thin, 0.7) == pytest.approx(51_738, abs=0.5)


@pytest.mark.parametrize(("ratio", "printed"), [(1.0, 0.20073), (1.25, 0.27705), (1.5, 0.35917), (2.0, 0.53300)])
def test_the_skid_turn_slips_as_published(ratio: float, printed: float) -> None:
    assert skid_turn_slip(ratio) == pytest.approx(printed, abs=5e-6)


def test_turning_resistance_is_largest_where_the_inner_track_stands() -> None:
    assert turning_resistance(0.8, M113.tread / 2, M113.tread) == pytest.approx(0.8)
    assert turning_resistance(0.8, 20.0, 2.0) == pytest.approx(0.8 / 2.425)


@pytest.mark.parametrize(
    "call",
    [
        lambda: mobilized_share(0.0, 0.1, 0.02),
        lambda: mobilized_share(2.0, -0.1, 0.02),
        lambda: mobilized_share(2.0, 0.1, 0.0),
        lambda: mobilized_share(2.0, 0.1, 0.02, rolling=1.5),
        lambda: radius_integral(0.0, 1.0),
        lambda: skid_turn_slip(0.0),
        lambda: skid_turn_slip(math.nan),
        lambda: turning_resistance(0.8, -1.0, 2.0),
        lambda: turning_resistance(0.8, math.inf, 2.0),
    ],
)
def test_impossible_arguments_are_refused(call: Callable[[], float]) -> None:
    with pytest.raises(InvalidInputError, match="must lie in"):
        call()
