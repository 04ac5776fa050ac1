from __future__ import annotations

import numpy as np
import pytest

from grouser.controllers import PurePursuit, PurePursuitConfig, SlipParameters, SpeedProfile, identify_slip
from grouser.envs.paths import circle, make_path, straight
from grouser.envs.rollout import rollout
from grouser.envs.simulator import Simulator
from grouser.envs.state import VehicleState
from grouser.terrain import InvalidInputError, TrackedVehicle, named

M113 = TrackedVehicle.preset("m113")
ASPHALT = named("asphalt")


def drive(driver, start, duration, ground=ASPHALT):
    return rollout(Simulator(M113, "physics", ground, state=start), driver, duration)


def cross_track(path, log, skip=0.0):
    near, errors = None, []
    for time, x, y in zip(log.state("time"), log.state("x"), log.state("y"), strict=True):
        foot = path.project(x, y, near)
        near = foot.arc_length
        if time >= skip:
            errors.append(foot.cross_track)
    return np.array(errors)


def test_returns_to_a_straight_line():
    path = straight()
    log = drive(PurePursuit(path, M113, 5.0), VehicleState.rolling(5.0, y=1.0), 12.0)
    assert np.abs(cross_track(path, log, skip=10.0)).max() < 0.02


def test_reaches_the_speed_from_rest_without_overshoot():
    log = drive(PurePursuit(straight(), M113, 4.0), VehicleState(), 12.0)
    assert log.state("vx")[-1] == pytest.approx(4.0, abs=0.05)
    assert log.state("vx").max() < 4.0 * 1.05


@pytest.mark.parametrize("ground", ["asphalt", "lete-sand"])
def test_follows_a_circle(ground):
    path = circle(20.0)
    slip = identify_slip(M113, named(ground))
    log = drive(PurePursuit(path, M113, 5.0, slip=slip), VehicleState.rolling(5.0), 20.0, named(ground))
    assert np.abs(cross_track(path, log, skip=5.0)).max() < 0.15
    assert log.state("vx")[-1] == pytest.approx(5.0, abs=0.05)


def test_slip_model_makes_up_for_the_turn_that_skidding_eats():
    path = circle(20.0)
    errors = [
        np.abs(cross_track(path, drive(PurePursuit(path, M113, 5.0, slip=slip), VehicleState.rolling(5.0), 12.0), 6.0))
        for slip in (SlipParameters(), identify_slip(M113, ASPHALT))
    ]
    assert errors[1].mean() < 0.5 * errors[0].mean()


def test_commands_keep_the_training_speed():
    path = circle(1.0)
    fast = PurePursuit(path, M113, M113.training_speed)
    command = fast.command(VehicleState.rolling(9.0, y=3.0, heading=2.0))
    assert max(map(abs, command)) <= M113.training_speed


def test_integral_does_not_wind_up_at_the_limit():
    driver = PurePursuit(straight(), M113, M113.training_speed, config=PurePursuitConfig(integral=5.0))
    for _ in range(100):
        driver.command(VehicleState())
    # Now too fast: the very next command lies below the limit.
    command = driver.command(VehicleState.rolling(M113.training_speed + 2.0))
    assert max(command) < M113.training_speed


def test_reset_forgets_the_last_drive():
    driver = PurePursuit(make_path("figure-eight", M113), M113, 5.0)
    first = drive(driver, VehicleState.rolling(5.0), 3.0)
    second = drive(driver, VehicleState.rolling(5.0), 3.0)
    assert np.array_equal(first.states, second.states)


def test_speed_above_training_speed_is_refused():
    with pytest.raises(InvalidInputError, match="speed must lie in"):
        PurePursuit(straight(), M113, 11.0)


def test_profile_keeps_lateral_acceleration_and_its_own_slope():
    path = make_path("sine", M113)
    profile = SpeedProfile.along(path, 8.0, lateral_acceleration=1.0, acceleration=0.5)
    s = np.linspace(0.0, path.length, len(profile.speed))
    assert np.all(profile.speed**2 * np.abs(path.sample(s)[3]) <= 1.0 + 1e-9)
    assert np.abs(np.diff(profile.speed**2)).max() <= 2 * 0.5 * (s[1] - s[0]) + 1e-9
    assert profile.speed.max() <= 8.0


def test_profile_slows_at_the_end_only_if_asked():
    assert SpeedProfile.along(straight(), 5.0).at(120.0) == 5.0
    stopping = SpeedProfile.along(straight(), 5.0, stop_at_end=True)
    assert stopping.at(stopping.length) == 0.0
    assert stopping.at(60.0) == 5.0


def test_profile_of_a_closed_path_joins_itself():
    path = make_path("figure-eight", M113)
    profile = SpeedProfile.along(path, 8.0, lateral_acceleration=1.0, acceleration=0.2, stop_at_end=True)
    assert profile.at(path.length + 3.0) == profile.at(3.0)
    assert profile.speed[0] == profile.speed[-1] > 0
