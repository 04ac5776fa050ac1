"""Six maneuvers: what each one does to the belts, how far it goes, and that its generator decides everything."""

import json
import math

import numpy as np
import pytest

from grouser.envs import VehicleState
from grouser.surrogate.offline.maneuvers import MANEUVERS, Maneuver, draw_maneuver
from grouser.terrain import ConfigurationError, FloatArray, TrackedVehicle

DURATION = 40.0
TIMES = np.arange(0.0, DURATION, 0.05)
SEEDS = range(25)
UGV = TrackedVehicle.preset("ugv")


def draw(name: str, seed: int, vehicle: TrackedVehicle = UGV) -> Maneuver:
    return draw_maneuver(name, vehicle, np.random.default_rng(seed), DURATION)


def belts(maneuver: Maneuver, times: FloatArray = TIMES) -> FloatArray:
    """Commands over time as fractions of the training speed, shape (n, 2)."""
    maneuver.reset()
    commands = [maneuver.command(VehicleState(time=float(time))) for time in times]
    return np.array(commands) / maneuver.speed


def mean_and_half_difference(commands: FloatArray) -> tuple[FloatArray, FloatArray]:
    return commands.mean(axis=1), (commands[:, 1] - commands[:, 0]) / 2


def test_there_are_the_six_of_the_paper() -> None:
    assert MANEUVERS == ("straight", "turn", "skid_reversal", "pivot", "reversal", "prbs")


@pytest.mark.parametrize("preset", ["m113", "ugv", "maxxii"])
@pytest.mark.parametrize("name", MANEUVERS)
def test_belts_stay_within_the_training_speed(name: str, preset: str) -> None:
    vehicle = TrackedVehicle.preset(preset)
    for seed in range(6):
        maneuver = draw(name, seed, vehicle)
        commands = np.array([maneuver.command(VehicleState(time=float(time))) for time in TIMES])
        assert np.all(np.abs(commands) <= vehicle.training_speed)


@pytest.mark.parametrize("name", MANEUVERS)
def test_the_generator_decides_and_nothing_else(name: str) -> None:
    first, again, other = draw(name, 5), draw(name, 5), draw(name, 6)
    np.testing.assert_array_equal(belts(first), belts(again))
    assert first.excitation == again.excitation
    assert first.excitation != other.excitation
    assert not np.array_equal(belts(first), belts(other))


@pytest.mark.parametrize("name", MANEUVERS)
def test_a_maneuver_plays_back_the_same_whatever_the_vehicle_does(name: str) -> None:
    maneuver = draw(name, 2)
    once = belts(maneuver)
    np.testing.assert_array_equal(belts(maneuver), once)
    moved = VehicleState(time=3.0, vx=2.0, yaw_rate=-1.0, v_left=4.0, x=9.0)
    assert maneuver.command(moved) == maneuver.command(VehicleState(time=3.0))


@pytest.mark.parametrize("name", MANEUVERS)
def test_its_scalars_are_kept_as_json_can_hold_them(name: str) -> None:
    maneuver = draw(name, 1)
    assert maneuver.name == name
    assert maneuver.speed == UGV.training_speed
    assert maneuver.excitation
    assert all(isinstance(value, float) and math.isfinite(value) for value in maneuver.excitation.values())
    assert json.loads(json.dumps(maneuver.excitation)) == maneuver.excitation


@pytest.mark.parametrize("seed", SEEDS)
def test_straight_has_equal_belts_that_swing(seed: int) -> None:
    commands = belts(draw("straight", seed))
    np.testing.assert_array_equal(commands[:, 0], commands[:, 1])
    assert len(set(np.sign(commands[:, 0]))) == 1
    assert np.ptp(commands) > 0


def test_straight_goes_both_ways() -> None:
    assert {float(np.sign(belts(draw("straight", seed))[0, 0])) for seed in SEEDS} == {-1.0, 1.0}


@pytest.mark.parametrize("seed", SEEDS)
def test_turn_grows_in_and_stays_on_one_side(seed: int) -> None:
    maneuver = draw("turn", seed)
    mean, half = mean_and_half_difference(belts(maneuver))
    assert half[0] == 0
    assert len(set(np.sign(half[1:]))) == 1
    assert mean[0] == pytest.approx(maneuver.excitation["speed"])


@pytest.mark.parametrize("seed", SEEDS)
def test_skid_reversal_changes_sides_but_not_direction(seed: int) -> None:
    maneuver = draw("skid_reversal", seed)
    mean, half = mean_and_half_difference(belts(maneuver))
    assert half.min() < 0 < half.max()
    assert len(set(np.sign(mean))) == 1


@pytest.mark.parametrize("seed", SEEDS)
def test_reversal_changes_direction_but_not_sides(seed: int) -> None:
    mean, half = mean_and_half_difference(belts(draw("reversal", seed)))
    assert mean.min() < 0 < mean.max()
    # 1e-12: the difference of two belts is rounded.
    assert half.min() >= -1e-12 or half.max() <= 1e-12


@pytest.mark.parametrize("seed", range(10))
def test_reversal_has_a_steady_differential_where_no_belt_saturates(seed: int) -> None:
    maneuver = draw("reversal", seed)
    commands = belts(maneuver)
    inside = np.all(np.abs(commands) < 1, axis=1)
    half = mean_and_half_difference(commands)[1][inside]
    np.testing.assert_allclose(half, maneuver.excitation["differential"], rtol=0, atol=1e-12)


def test_pivot_counter_rotates_and_changes_sides() -> None:
    weak = []
    for seed in range(300):
        maneuver = draw("pivot", seed)
        commands = belts(maneuver, TIMES[::4])
        assert commands[:, 1].min() < commands[:, 0].max()
        half = mean_and_half_difference(commands)[1]
        assert half.min() < 0 < half.max()
        # The belts pass zero at the edges, which take a fifth of the time.
        share = float(np.mean(commands[:, 0] * commands[:, 1] < 0))
        if share < 0.5:
            weak.append((seed, round(share, 2), maneuver.excitation["differential"], maneuver.excitation["creep"]))
    assert not weak, f"pivots whose belts turn the same way most of the time: {weak}"


@pytest.mark.parametrize("seed", range(8))
def test_prbs_holds_each_level_between_two_tenths_and_two_seconds(seed: int) -> None:
    step = 0.01
    times = np.arange(0.0, DURATION, step)
    commands = belts(draw("prbs", seed), times)
    edges = np.flatnonzero(np.any(np.diff(commands, axis=0) != 0, axis=1)) + 1
    holds = np.diff(edges) * step
    assert holds.min() >= 0.2 - step - 1e-9
    # A level may be drawn twice running, which holds longer; each draw holds for 1.1 s on average.
    assert np.mean(holds <= 2.0 + step) > 0.7
    assert 0.7 < holds.mean() < 2.0


@pytest.mark.parametrize("seed", range(8))
def test_prbs_takes_at_most_three_levels_of_mean_and_of_differential(seed: int) -> None:
    maneuver = draw("prbs", seed)
    commands = belts(maneuver)
    commands = commands[np.all(np.abs(commands) < 1, axis=1)]
    mean, half = (np.unique(np.round(values, 9)) for values in mean_and_half_difference(commands))
    excitation = maneuver.excitation
    levels = np.array([-1.0, 0.0, 1.0])
    assert np.isin(mean, np.round(excitation["bias"] + excitation["speed"] * levels, 9)).all()
    assert np.isin(half, np.round(excitation["differential"] * levels, 9)).all()


@pytest.mark.parametrize(("typed", "meant"), [("prb", "prbs"), ("skid-reversal", "skid_reversal"), ("pivott", "pivot")])
def test_an_unknown_name_comes_with_the_nearest(typed: str, meant: str) -> None:
    with pytest.raises(ConfigurationError, match=rf"unknown maneuver '{typed}'; did you mean '{meant}'\?"):
        draw(typed, 0)
