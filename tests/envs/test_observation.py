"""What a policy sees at states worked out by hand, and the belt commands that its actions stand for."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from grounds import stepped

from grouser.envs import Path, TrackingConfig, VehicleState
from grouser.envs.observation import belt_command, observation_size, observe, reference_speed
from grouser.envs.paths import circle, straight
from grouser.terrain import (
    FloatArray,
    Ground,
    RigidTerrain,
    SoilTerrain,
    TrackedVehicle,
    named,
    parameter_ranges,
)

# Training speed 10 m/s, so the reference speed is 5 m/s and the look-ahead points lie 2, 4, 6, 8, 10 m ahead.
M113 = TrackedVehicle.preset("m113")
ASPHALT = named("asphalt")
PATH = straight(100.0)


def see(
    state: VehicleState,
    previous: tuple[float, float] = (0.0, 0.0),
    *,
    path: Path = PATH,
    ground: Ground = ASPHALT,
    near: float | None = None,
    vehicle: TrackedVehicle = M113,
    **settings: Any,
) -> FloatArray:
    foot = path.project(state.x, state.y, near)
    config = TrackingConfig(**settings)
    seen = observe(state, foot, np.array(previous), vehicle=vehicle, path=path, config=config, ground=ground)
    assert seen.dtype == np.float32
    assert seen.shape == (observation_size(ground.mode, config),)
    return seen.astype(np.float64)


def test_on_the_path_and_along_it_only_speed_and_points_ahead_are_seen() -> None:
    seen = see(VehicleState.rolling(4.0, x=20.0))
    expected = [0.4, 0, 0, 0.4, 0.4, 0, 0, 0.2, 0, 0.4, 0, 0.6, 0, 0.8, 0, 1.0, 0, 0, 0]
    np.testing.assert_allclose(seen, expected, atol=1e-6)


def test_every_part_has_its_place_and_scale() -> None:
    state = VehicleState(
        x=20.0, y=1.5, heading=0.3, vx=3.0, vy=-0.5, yaw_rate=0.4, v_left=2.5, v_right=-1.0, ax=9.0, ay=9.0, time=7.0
    )
    seen = see(state, (0.25, -0.75), yaw_rate_scale=0.8, maximum_cross_track=3.0)
    np.testing.assert_allclose(seen[:7], [0.3, -0.05, 0.5, 0.25, -0.1, 0.5, 0.3 / math.pi], atol=1e-6)
    for i, distance in enumerate((2.0, 4.0, 6.0, 8.0, 10.0)):
        # The point (20 + distance, 0) from (20, 1.5), turned by −0.3 rad.
        ahead = distance * math.cos(0.3) - 1.5 * math.sin(0.3)
        left = -distance * math.sin(0.3) - 1.5 * math.cos(0.3)
        np.testing.assert_allclose(seen[7 + 2 * i : 9 + 2 * i], [ahead / 10.0, left / 10.0], atol=1e-6)
    np.testing.assert_allclose(seen[17:], [0.25, -0.75], atol=1e-7)


def test_left_of_the_path_is_positive_and_the_points_then_lie_to_the_right() -> None:
    seen = see(VehicleState.rolling(4.0, x=20.0, y=2.0))
    assert seen[5] == pytest.approx(2.0 / 5.0)
    assert np.all(seen[8:17:2] == pytest.approx(-0.2))


def test_look_ahead_follows_the_reference_speed() -> None:
    seen = see(VehicleState.rolling(4.0, x=20.0, y=1.0), reference_speed=2.0)
    # 0.8 to 4 m ahead, over 4 m.
    np.testing.assert_allclose(seen[7:17:2], [0.2, 0.4, 0.6, 0.8, 1.0], atol=1e-6)
    np.testing.assert_allclose(seen[8:17:2], -0.25, atol=1e-6)


def test_the_reference_speed_is_half_the_training_speed_by_default() -> None:
    assert reference_speed(M113, TrackingConfig()) == M113.training_speed / 2
    assert reference_speed(M113, TrackingConfig(reference_speed=3.0)) == 3.0


def test_points_lie_on_the_path_where_it_turns() -> None:
    path = circle(10.0)
    seen = see(VehicleState.rolling(5.0), path=path, near=0.0)
    for i, distance in enumerate((2.0, 4.0, 6.0, 8.0, 10.0)):
        angle = distance / 10.0
        expected = [math.sin(angle), 1.0 - math.cos(angle)]
        np.testing.assert_allclose(seen[7 + 2 * i : 9 + 2 * i], expected, atol=1e-4)


def test_points_beyond_an_open_end_go_on_straight() -> None:
    seen = see(VehicleState.rolling(4.0, x=97.0))
    np.testing.assert_allclose(seen[7:17:2], [0.2, 0.4, 0.6, 0.8, 1.0], atol=1e-6)
    np.testing.assert_allclose(seen[8:17:2], 0.0, atol=1e-6)


@pytest.mark.parametrize("turns", [-3, 0, 2])
@pytest.mark.parametrize("error", [-3.0, -0.2, 0.0, 1.5, 3.0])
def test_the_heading_error_knows_no_turns(error: float, turns: int) -> None:
    state = VehicleState.rolling(4.0, x=20.0, heading=error + 2 * math.pi * turns)
    seen = see(state)
    assert seen[6] == pytest.approx(error / math.pi, abs=1e-6)
    np.testing.assert_allclose(seen, see(VehicleState.rolling(4.0, x=20.0, heading=error)), atol=1e-6)


def test_a_lap_more_changes_nothing() -> None:
    path = circle(10.0)
    state = VehicleState.rolling(5.0, x=0.3, y=0.1, heading=0.05)
    first, later = (see(state, path=path, near=near) for near in (0.0, 2 * path.length))
    np.testing.assert_allclose(first, later, atol=1e-6)


def test_a_vehicle_gone_far_is_clipped_at_ten() -> None:
    seen = see(VehicleState(x=20.0, y=1e4, vx=1e3, vy=-1e3, yaw_rate=1e3))
    assert np.abs(seen).max() == 10.0
    assert seen[:3].tolist() == [10.0, -10.0, 10.0]
    assert seen[5] == 10.0


def test_a_mirrored_state_is_seen_mirrored() -> None:
    state = VehicleState(x=20.0, y=0.7, heading=0.2, vx=4.0, vy=0.1, yaw_rate=0.3, v_left=3.0, v_right=5.0)
    mirrored = VehicleState(x=20.0, y=-0.7, heading=-0.2, vx=4.0, vy=-0.1, yaw_rate=-0.3, v_left=5.0, v_right=3.0)
    seen, other = see(state, (0.1, 0.6)), see(mirrored, (0.1, 0.6))
    swap = [0, 1, 2, 4, 3, *range(5, 19)]
    sign = np.array([1, -1, -1, 1, 1, -1, -1, *[1, -1] * 5, 1, 1])
    np.testing.assert_allclose(seen, sign * other[swap], atol=1e-6)


@pytest.mark.parametrize(("mode", "size"), [("rigid", 22), ("soil", 23)])
def test_terrain_parameters_run_from_minus_one_to_one_over_the_wide_ranges(mode: Any, size: int) -> None:
    ranges = parameter_ranges("wide", mode)
    terrain = RigidTerrain if mode == "rigid" else SoilTerrain
    for bound, value in ((ranges.low, -1.0), (ranges.high, 1.0), (np.add(ranges.low, ranges.high) / 2, 0.0)):
        ground: Any = terrain(*bound)
        seen = see(VehicleState.rolling(4.0), ground=ground, observe_terrain=True)
        assert len(seen) == size
        np.testing.assert_allclose(seen[19:], value, atol=1e-6)


def test_the_terrain_is_that_under_the_vehicle() -> None:
    ground = stepped(RigidTerrain(0.8), RigidTerrain(0.2), 20.0)
    before, beyond = (see(VehicleState(x=x), ground=ground, observe_terrain=True) for x in (19.9, 20.1))
    # μ over .1 to 1.0
    assert before[19] == pytest.approx(2 * 0.7 / 0.9 - 1, abs=1e-6)
    assert beyond[19] == pytest.approx(2 * 0.1 / 0.9 - 1, abs=1e-6)


def test_without_observe_terrain_the_ground_does_not_matter() -> None:
    state = VehicleState.rolling(4.0, x=20.0, y=0.4)
    np.testing.assert_array_equal(see(state), see(state, ground=named("ice")))


@pytest.mark.parametrize("action", [(1.0, -1.0), (0.3, 0.7), (0.0, 0.0), (-1.0, -0.2)])
def test_belt_actions_are_shares_of_the_training_speed(action: tuple[float, float]) -> None:
    command = belt_command(np.array(action), M113, TrackingConfig())
    assert command == pytest.approx((10.0 * action[0], 10.0 * action[1]))


@pytest.mark.parametrize(("speed", "turn"), [(0.5, 0.0), (0.0, 1.0), (0.4, -0.5), (-0.3, 0.25)])
def test_twist_actions_are_speed_and_yaw_rate_of_rolling_belts(speed: float, turn: float) -> None:
    config = TrackingConfig(action_mode="twist", yaw_rate_scale=1.2)
    command = belt_command(np.array([speed, turn]), M113, config)
    assert (command.left + command.right) / 2 == pytest.approx(10.0 * speed)
    assert (command.right - command.left) / M113.tread == pytest.approx(1.2 * turn)


@pytest.mark.parametrize(("speed", "turn"), [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (0.95, 1.0)])
def test_twists_saturate_at_the_training_speed_belt_by_belt(speed: float, turn: float) -> None:
    config = TrackingConfig(action_mode="twist", yaw_rate_scale=2.0)
    command = belt_command(np.array([speed, turn]), M113, config)
    half = 2.0 * turn * M113.tread / 2
    assert command.left == pytest.approx(max(-10.0, min(10.0, 10.0 * speed - half)))
    assert command.right == pytest.approx(max(-10.0, min(10.0, 10.0 * speed + half)))
    assert max(map(abs, command)) == 10.0


def test_a_twist_beyond_both_belts_turns_on_the_spot_at_full_speed() -> None:
    config = TrackingConfig(action_mode="twist", yaw_rate_scale=50.0)
    assert belt_command(np.array([0.0, 1.0]), M113, config) == (-10.0, 10.0)


@pytest.mark.parametrize("mode", ["belts", "twist"])
def test_another_top_speed_takes_the_training_speeds_place(mode: Any) -> None:
    config = TrackingConfig(action_mode=mode)
    full = np.array([1.0, 1.0]) if mode == "belts" else np.array([1.0, 0.0])
    assert belt_command(full, M113, config, top_speed=4.0) == (4.0, 4.0)
