"""Belts: dV/dt = clip((u − V)/T_d, ±a), integrated exactly."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from grouser.envs import BeltCommand, Simulator, advance_belts
from grouser.envs.driveline import twist_belts
from grouser.terrain import InvalidInputError, RigidTerrain, TrackedVehicle

M113 = TrackedVehicle.preset("m113")
speeds = st.floats(-18.0, 18.0)
lags = st.floats(0.01, 2.0)
limits = st.floats(0.2, 50.0)
times = st.floats(0.0, 5.0)


def with_drive(lag: float, limit: float) -> TrackedVehicle:
    return replace(M113, belt_time_constant=lag, belt_acceleration=limit)


def test_the_drive_of_every_preset_is_a_lag_of_a_fifth_of_a_second_limited_to_four_meters_per_second_squared() -> None:
    for name in ("m113", "marder", "ugv", "maxxii"):
        vehicle = TrackedVehicle.preset(name)
        assert (vehicle.belt_time_constant, vehicle.belt_acceleration) == (0.2, 4.0)


@pytest.mark.parametrize(("lag", "limit"), [(0.2, 4.0), (0.05, 4.0), (1.0, 0.5), (0.2, 40.0)])
@pytest.mark.parametrize(("start", "command"), [(0.0, 10.0), (5.0, 0.0), (3.0, -3.0), (-2.0, -1.9), (1.0, 1.0)])
def test_solves_the_rate_limited_lag(lag: float, limit: float, start: float, command: float) -> None:
    instants = [0.005, 0.01, 0.1, 0.37, 1.0, 4.0]
    solution = solve_ivp(
        lambda _, v: np.clip((command - v) / lag, -limit, limit),
        (0.0, instants[-1]),
        [start],
        t_eval=instants,
        method="DOP853",
        rtol=1e-11,
        atol=1e-12,
        max_step=0.02,
    )
    for elapsed, expected in zip(instants, solution.y[0], strict=True):
        belts = advance_belts(with_drive(lag, limit), (start, -start), BeltCommand(command, -command), elapsed)
        assert belts == pytest.approx((expected, -expected), abs=1e-7)


def test_ramp_then_exponential_by_hand() -> None:
    # From rest to 2 m/s: 4 m/s² until the gap is a·T_d = 0.8 m/s, that is for 0.3 s; then it decays with T_d.
    assert advance_belts(M113, (0.0, 0.0), BeltCommand(2.0, -2.0), 0.3) == pytest.approx((1.2, -1.2), abs=1e-14)
    late = 2.0 - 0.8 * math.exp(-0.5 / 0.2)
    assert advance_belts(M113, (0.0, 0.0), BeltCommand(2.0, -2.0), 0.8) == pytest.approx((late, -late), abs=1e-14)


@given(start=speeds, command=speeds, lag=lags, limit=limits, elapsed=times, share=st.floats(0.0, 1.0))
def test_parts_of_a_step_compose(
    start: float, command: float, lag: float, limit: float, elapsed: float, share: float
) -> None:
    vehicle, target = with_drive(lag, limit), BeltCommand(command, command)
    whole = advance_belts(vehicle, (start, start), target, elapsed)
    for first in (elapsed / 2, share * elapsed):
        half = advance_belts(vehicle, (start, start), target, first)
        assert advance_belts(vehicle, half, target, elapsed - first) == pytest.approx(whole, abs=1e-11)


@given(start=speeds, command=speeds, lag=lags, limit=limits, elapsed=times)
def test_never_overshoots_nor_outruns_the_rate_limit(
    start: float, command: float, lag: float, limit: float, elapsed: float
) -> None:
    vehicle = with_drive(lag, limit)
    low, high = min(start, command), max(start, command)
    for speed in advance_belts(vehicle, (start, start), BeltCommand(command, command), elapsed):
        assert low - 1e-13 <= speed <= high + 1e-13
        assert abs(speed - start) <= limit * elapsed + 1e-12
        assert abs(speed - start) <= abs(command - start) * elapsed / lag + 1e-12


@given(left=speeds, right=speeds, u_left=speeds, u_right=speeds, elapsed=times)
def test_the_belts_are_independent(left: float, right: float, u_left: float, u_right: float, elapsed: float) -> None:
    both = advance_belts(M113, (left, right), BeltCommand(u_left, u_right), elapsed)
    alone = advance_belts(M113, (left, 0.0), BeltCommand(u_left, 0.0), elapsed)
    swapped = advance_belts(M113, (right, left), BeltCommand(u_right, u_left), elapsed)
    assert both[0] == alone[0]
    assert both == swapped[::-1]


@pytest.mark.parametrize(
    "command",
    [
        BeltCommand(18.001, 0.0),
        BeltCommand(0.0, -18.001),
        BeltCommand(math.nan, 0.0),
        BeltCommand(0.0, math.nan),
        BeltCommand(math.inf, 0.0),
        BeltCommand(0.0, -math.inf),
        (1.0,),
        (1.0, 1.0, 1.0),
    ],
)
def test_a_command_out_of_reach_is_refused_and_changes_nothing(command: BeltCommand) -> None:
    simulator = Simulator("m113", "physics", RigidTerrain(0.7))
    before = simulator.get_state()
    with pytest.raises(InvalidInputError, match=r"\[-18, 18\] m/s \(m113\)"):
        simulator.step(command)
    assert simulator.get_state() == before


def test_commands_at_the_limit_of_the_drive_are_taken() -> None:
    simulator = Simulator("m113", "physics", RigidTerrain(0.7))
    record = simulator.step(BeltCommand(18.0, -18.0))
    assert (record.state.v_left, record.state.v_right) == pytest.approx((0.04, -0.04), abs=1e-15)


@given(speed=st.floats(-5.0, 5.0), yaw_rate=st.floats(-1.0, 1.0), tread=st.floats(0.1, 4.0))
def test_twist_belts_roll_without_slip(speed: float, yaw_rate: float, tread: float) -> None:
    """Where the limit does not cut, the ground under each track's centreline moves as its belt does."""
    belts = twist_belts(speed, yaw_rate, tread=tread, limit=10.0)
    for belt, y in zip(belts, (tread / 2, -tread / 2), strict=True):
        assert belt == pytest.approx(speed - yaw_rate * y, abs=1e-12)
