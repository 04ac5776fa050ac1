"""Parking-v0: its contract, its rewards, and everything that highway-env's environments get wrong."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from typing import Any

import gymnasium
import highway_env
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env as gymnasium_check

from grouser.envs import VehicleState
from grouser.envs.highway import ParkingConfig, ParkingEnv
from grouser.terrain import (
    ConfigurationError,
    Disc,
    InvalidInputError,
    Patch,
    SimulationDivergedError,
    TerrainField,
    named,
    paint_field,
)

MakeParking = Callable[..., ParkingEnv]

#: Beside a spot, a little before its middle, and rolling: the next steps lead into the goal.
ARRIVING = VehicleState.rolling(0.3, x=-2.0, y=13.8, heading=math.pi / 2)


def drive(env: gymnasium.Env[Any, Any], seed: int | None, steps: int = 12) -> list[Any]:
    """Observations, rewards and infos of an episode under actions of its own."""
    trace: list[Any] = [*env.reset(seed=seed)]
    generator = np.random.default_rng(7)
    for _ in range(steps):
        observation, reward, terminated, truncated, info = env.step(generator.uniform(-1, 1, 2).astype(np.float32))
        trace += [observation, reward, info]
        if terminated or truncated:
            break
    return trace


def same(one: Any, other: Any) -> bool:
    np.testing.assert_equal(one, other)
    return True


class TestContract:
    @pytest.mark.parametrize("backend", ["physics", "native", "guarded", "torch"])
    def test_gymnasium_and_stable_baselines(self, make_parking: MakeParking, backend: str) -> None:
        checker = pytest.importorskip("stable_baselines3.common.env_checker")
        gymnasium_check(make_parking(backend), skip_render_check=True)
        checker.check_env(make_parking(backend, action_mode="twist", observe_terrain=True, parked_vehicles=3))

    def test_spaces_are_bounded_float32(self, make_parking: MakeParking) -> None:
        env = make_parking(observe_terrain=True, parked_vehicles=4)
        for space in (*env.observation_space.spaces.values(), env.action_space):  # type: ignore[attr-defined]
            assert space.dtype == np.float32
            assert space.is_bounded()
        assert env.observation_space["observation"].shape == (11 + 12 + 3,)  # type: ignore[index]

    def test_the_step_path_is_free_of_pandas(self, make_parking: MakeParking, monkeypatch: pytest.MonkeyPatch) -> None:
        import pandas

        env = make_parking()
        env.reset(seed=0)
        monkeypatch.delattr(pandas, "DataFrame")
        env.step(np.array([0.5, 0.5], np.float32))

    @pytest.mark.parametrize("action", [[1.1, 0.0], [math.nan, 0.0], [0.0], [[0.0, 0.0]]])
    def test_an_action_outside_the_box_is_refused(self, make_parking: MakeParking, action: Any) -> None:
        env = make_parking()
        env.reset(seed=0)
        with pytest.raises(InvalidInputError, match="action"):
            env.step(np.array(action, dtype=np.float32))

    def test_a_step_needs_a_reset(self, make_parking: MakeParking) -> None:
        with pytest.raises(gymnasium.error.ResetNeeded):
            make_parking().step(np.zeros(2, np.float32))

    def test_metadata_is_its_own(self, make_parking: MakeParking) -> None:
        slow, fast = make_parking(control_period=0.5), make_parking(control_period=0.1)
        assert (slow.metadata["render_fps"], fast.metadata["render_fps"]) == (2, 10)
        assert ParkingEnv.metadata["render_fps"] == 10


class TestEpisodes:
    @pytest.mark.parametrize("randomize", [None, {"terrain": "wide", "yaw_inertia": (0.5, 2.0)}])
    def test_starts_and_goals_are_parking_v0s_seed_by_seed(self, make_parking: MakeParking, randomize: Any) -> None:
        gymnasium.register_envs(highway_env)
        ours = make_parking(randomize=randomize)
        theirs = gymnasium.make("parking-v0", config={"vehicles_count": 0})
        for seed in range(12):
            mine, _ = ours.reset(seed=seed)
            yours, _ = theirs.reset(seed=seed)
            assert mine["achieved_goal"][4:] == pytest.approx(yours["achieved_goal"][4:], abs=1e-6)
            for goal in ("achieved_goal", "desired_goal"):
                assert 5 * mine[goal][:2] == pytest.approx(100 * yours[goal][:2], abs=1e-4)
            assert mine["desired_goal"][4:] == pytest.approx(yours["desired_goal"][4:], abs=1e-6)

    def test_taken_spots_are_parking_v0s(self, make_parking: MakeParking) -> None:
        gymnasium.register_envs(highway_env)
        ours = make_parking(parked_vehicles=6)
        theirs: Any = gymnasium.make("parking-v0", config={"vehicles_count": 6}).unwrapped
        ours.reset(seed=3)
        theirs.reset(seed=3)
        mine = [each.position.tolist() for each in ours.road.objects[1:7]]
        assert np.array(mine) == pytest.approx(np.array([each.position for each in theirs.road.vehicles[1:]]))

    def test_equal_seeds_give_equal_episodes_after_many_resets(self, make_parking: MakeParking) -> None:
        settings = {"parked_vehicles": 3, "randomize": {"terrain": "wide"}, "start_spread": 2.0}
        one, other = make_parking(**settings), make_parking(**settings)
        assert same(drive(one, 5), drive(other, 5))
        for _ in range(4):
            drive(other, None, 2)
        assert same(drive(one, 5), drive(other, 5))
        assert same(drive(one, None), drive(other, None))

    def test_the_seed_of_the_action_space_survives_resets(self, make_parking: MakeParking) -> None:
        env = make_parking()
        env.action_space.seed(3)
        expected = [env.action_space.sample() for _ in range(4)]
        env.action_space.seed(3)
        drawn = []
        for seed in range(4):
            env.reset(seed=seed)
            drawn.append(env.action_space.sample())
        assert same(drawn, expected)

    def test_an_option_changes_what_it_names_alone(self, make_parking: MakeParking) -> None:
        env = make_parking(parked_vehicles=2, randomize={"terrain": "wide"})
        plain, _ = env.reset(seed=4)
        ground = env.ground.parameters_at(0.0, 0.0)
        turned, _ = env.reset(seed=4, options={"heading": 1.0})
        assert same(turned["desired_goal"], plain["desired_goal"])
        assert env.highway_vehicle.heading == 1.0
        assert same(env.ground.parameters_at(0.0, 0.0), ground)

    @pytest.mark.parametrize(("spot", "place"), [(0, (-26.0, 14.0)), (13, (26.0, 14.0)), (20, (-2.0, -14.0))])
    def test_a_spot_can_be_named(self, make_parking: MakeParking, spot: int, place: tuple[float, float]) -> None:
        observation, _ = make_parking().reset(seed=0, options={"spot": spot})
        assert 5 * observation["desired_goal"][:2] == pytest.approx(place, abs=1e-5)
        assert observation["desired_goal"][5] == math.copysign(1.0, place[1])

    @pytest.mark.parametrize("options", [{"spot": 28}, {"spot": 1.5}, {"heading": math.nan}, {"state": 1}])
    def test_impossible_options_are_refused(self, make_parking: MakeParking, options: dict[str, Any]) -> None:
        with pytest.raises(InvalidInputError, match=next(iter(options))):
            make_parking().reset(options=options)

    def test_an_unknown_option_is_named(self, make_parking: MakeParking) -> None:
        with pytest.raises(ConfigurationError, match="'spot'"):
            make_parking().reset(options={"spots": 3})

    def test_a_parked_vehicle_ends_the_episode_with_success(self, make_parking: MakeParking) -> None:
        env = make_parking("physics")
        _, info = env.reset(seed=0, options={"state": ARRIVING, "spot": 6})
        assert not info["is_success"]
        for _ in range(5):
            _, reward, terminated, truncated, info = env.step(np.zeros(2, np.float32))
            if terminated:
                break
        assert terminated
        assert info["is_success"]
        assert not truncated
        assert info["position_error"] <= 0.5
        assert info["speed_error"] <= 0.1
        assert reward > -0.3

    def test_who_stands_in_a_wall_has_not_parked(self, make_parking: MakeParking) -> None:
        env = make_parking("physics", size=(13.2, 2.0))
        env.reset(seed=0, options={"state": VehicleState(x=-2.0, y=14.0, heading=math.pi / 2), "spot": 6})
        _, _, terminated, _, info = env.step(np.zeros(2, np.float32))
        assert (terminated, info["crashed"], info["is_success"]) == (True, True, False)

    def test_tail_in_is_no_success(self, make_parking: MakeParking) -> None:
        env = make_parking("physics")
        env.reset(seed=0, options={"state": VehicleState(x=-2.0, y=14.0, heading=-math.pi / 2), "spot": 6})
        _, _, terminated, _, info = env.step(np.zeros(2, np.float32))
        assert not terminated
        assert info["heading_error"] == pytest.approx(math.pi, abs=1e-5)

    def test_a_wall_ends_the_episode_at_its_price(self, make_parking: MakeParking) -> None:
        env = make_parking("physics", collision_weight=7.0)
        env.reset(seed=0, options={"state": VehicleState.rolling(4.0, x=31.0)})
        for _ in range(10):
            _, reward, terminated, _, info = env.step(np.array([1.0, 1.0], np.float32))
            if terminated:
                break
        assert terminated
        assert info["crashed"]
        assert info["reward_terms"]["collision"] == -7.0
        assert reward == sum(info["reward_terms"].values())

    def test_without_walls_it_drives_on(self, make_parking: MakeParking) -> None:
        env = make_parking("physics", walls=False)
        env.reset(seed=0, options={"state": VehicleState.rolling(4.0, x=31.0)})
        ends = [env.step(np.array([1.0, 1.0], np.float32))[2] for _ in range(10)]
        assert not any(ends)
        assert env.highway_vehicle.position[0] > 36.0

    def test_time_runs_out(self, make_parking: MakeParking) -> None:
        env = make_parking(time_limit=0.6)
        env.reset(seed=0)
        ends = [env.step(np.zeros(2, np.float32))[2:4] for _ in range(3)]
        assert ends == [(False, False), (False, False), (False, True)]

    def test_off_the_map_is_the_end_and_no_error(self, make_parking: MakeParking) -> None:
        field = TerrainField.uniform(named("asphalt"), (-3.0, 3.0, -3.0, 3.0))
        env = make_parking("physics", terrain=field)
        env.reset(seed=0)
        for _ in range(10):
            _, reward, terminated, _, info = env.step(np.array([1.0, 1.0], np.float32))
            if terminated:
                break
        assert info["off_map"]
        assert reward < -env.config.collision_weight

    def test_divergence_is_the_end_and_no_error(
        self, make_parking: MakeParking, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        env = make_parking()
        env.reset(seed=0)

        def diverge(*_: object) -> None:
            raise SimulationDivergedError("no tick was solved")

        monkeypatch.setattr(env.highway_vehicle.motion, "advance", diverge)
        observation, _, terminated, truncated, info = env.step(np.array([1.0, 1.0], np.float32))
        assert (terminated, truncated, info["diverged"]) == (True, False, True)
        assert env.observation_space.contains(observation)


class TestRewards:
    @pytest.fixture
    def steps(self, make_parking: MakeParking) -> tuple[ParkingEnv, list[Any]]:
        env = make_parking("physics", action_change_weight=0.05, slip_power_weight=0.1, time_limit=2.0)
        generator, rows = np.random.default_rng(0), []
        for episode in range(8):
            state = VehicleState.rolling(4.0, x=28.0) if episode % 2 else ARRIVING
            env.reset(seed=episode, options={"state": state, "spot": 6})
            while True:
                action = np.ones(2) if episode % 2 else 0.03 * generator.uniform(-1, 1, 2)
                row = env.step(action.astype(np.float32))
                rows.append(row)
                if row[2] or row[3]:
                    break
        return env, rows

    def test_every_step_is_recomputed_to_the_bit(self, steps: tuple[ParkingEnv, list[Any]]) -> None:
        env, rows = steps
        assert {row[4]["crashed"] for row in rows} == {False, True}
        assert {row[4]["is_success"] for row in rows} == {False, True}
        for observation, reward, terminated, truncated, info in rows:
            goals = observation["achieved_goal"], observation["desired_goal"]
            assert env.compute_reward(*goals, info) == reward == sum(info["reward_terms"].values())
            assert env.compute_terminated(*goals, info) == terminated
            assert env.compute_truncated(*goals, info) == truncated

    @pytest.mark.parametrize("container", [list, np.array], ids=["list", "array"])
    def test_many_are_each_alone_to_the_bit(self, steps: tuple[ParkingEnv, list[Any]], container: Any) -> None:
        env, rows = steps
        achieved = np.array([row[0]["achieved_goal"] for row in rows])
        desired = np.roll(achieved, 3, axis=0)
        infos = [row[4] for row in rows]
        for compute in (env.compute_reward, env.compute_terminated, env.compute_truncated):
            many = compute(achieved, desired, container(infos))
            assert many.shape == (len(rows),)
            assert many.tolist() == [compute(*row) for row in zip(achieved, desired, infos, strict=True)]

    def test_another_goal_changes_the_goals_term_alone(self, steps: tuple[ParkingEnv, list[Any]]) -> None:
        env, rows = steps
        for observation, _, _, _, info in rows:
            achieved = observation["achieved_goal"]
            rest = sum(value for name, value in info["reward_terms"].items() if name != "goal")
            assert env.compute_reward(achieved, achieved, info) == rest

    @pytest.mark.parametrize("info", [{}, {"crashed": True}])
    def test_an_info_that_tells_nothing_is_refused(self, make_parking: MakeParking, info: dict[str, Any]) -> None:
        goal = np.zeros(6, np.float32)
        with pytest.raises(InvalidInputError, match="copy_info_dict"):
            make_parking().compute_reward(goal, goal, info)

    def test_goals_and_infos_must_be_as_many(self, make_parking: MakeParking) -> None:
        with pytest.raises(InvalidInputError, match="one info for each"):
            make_parking().compute_reward(np.zeros((3, 6)), np.zeros((3, 6)), [{}] * 2)

    def test_hindsight_replay_takes_it(self, make_parking: MakeParking) -> None:
        sb3 = pytest.importorskip("stable_baselines3")
        model = sb3.SAC(
            "MultiInputPolicy",
            make_parking(time_limit=2.0),
            replay_buffer_class=sb3.HerReplayBuffer,
            replay_buffer_kwargs={"copy_info_dict": True},
            learning_starts=30,
            batch_size=32,
            policy_kwargs={"net_arch": [16]},
            device="cpu",
            seed=0,
        )
        model.learn(40)
        sampled = model.replay_buffer.sample(32)
        assert sampled.rewards.isfinite().all()


class TestSettings:
    @pytest.mark.parametrize(
        ("settings", "words"),
        [
            ({"control_period": 0.25, "scene_period": 0.1}, "control_period and scene_period"),
            ({"scene_period": 0.015, "control_period": 0.15}, "scene_period and tick"),
            ({"time_limit": 1.1}, "time_limit and control_period"),
            ({"reward_weights": (1.0, 2.0)}, "reward_weights"),
            ({"reward_weights": (1.0, 1.0, 1.0, 1.0, 1.0, -1.0)}, "sin_h"),
            ({"reward_exponent": 0.0}, "reward_exponent"),
            ({"position_tolerance": math.nan}, "position_tolerance"),
            ({"parked_vehicles": 27}, "parked_vehicles"),
            ({"top_speed": 30.0}, "top_speed"),
            ({"size": (0.0, 1.0)}, "footprint length"),
            ({"walls": 1}, "walls"),
        ],
    )
    def test_impossible_ones_are_refused(self, make_parking: MakeParking, settings: dict[str, Any], words: str) -> None:
        with pytest.raises(InvalidInputError, match=words):
            make_parking(**settings).reset(seed=0)

    @pytest.mark.parametrize(
        ("settings", "words"),
        [
            ({"reward_weight": (1.0,) * 6}, "'reward_weights'"),
            ({"lowest_start_speed": 0.5}, "starts at rest"),
            ({"action_mode": "twists"}, "'twist'"),
            ({"render_mode": "rgb"}, "'rgb_array'"),
        ],
    )
    def test_unknown_ones_are_named(self, make_parking: MakeParking, settings: dict[str, Any], words: str) -> None:
        with pytest.raises(ConfigurationError, match=words):
            make_parking(**settings)

    def test_setting_one_loses_no_other(self, make_parking: MakeParking) -> None:
        config = make_parking(reward_exponent=1.0, position_tolerance=0.3).config
        assert config == ParkingConfig(reward_exponent=1.0, position_tolerance=0.3)
        assert config.reward_weights == ParkingConfig().reward_weights

    def test_starts_spread(self, make_parking: MakeParking) -> None:
        env = make_parking(start_spread=3.0)
        places = np.array([env.reset(seed=seed)[0]["achieved_goal"][:2] * 5 for seed in range(20)])
        assert np.abs(places).max() <= 3.0
        assert places.std(axis=0).min() > 0.8

    def test_a_full_action_is_the_top_speed(self, make_parking: MakeParking) -> None:
        for mode, action in (("belts", [1.0, 1.0]), ("twist", [1.0, 0.0])):
            env = make_parking("physics", action_mode=mode, top_speed=2.0)
            env.reset(seed=0)
            for _ in range(12):
                env.step(np.array(action, np.float32))
            assert env.highway_vehicle.state.v_left == pytest.approx(2.0, abs=1e-3)

    def test_a_small_vehicle_has_a_lower_top_speed(self) -> None:
        assert ParkingEnv("physics", "maxxii").top_speed == 1.0

    def test_a_slope_lies_under_the_lot(self, make_parking: MakeParking) -> None:
        env = make_parking("physics", terrain="ice", grade=0.2)
        env.reset(seed=0, options={"heading": 0.0})
        assert env.ground.gradient_at(0.0, 0.0) == pytest.approx((math.tan(0.2), 0.0))
        for _ in range(5):
            env.step(np.zeros(2, np.float32))
        # Steeper than ice can hold.
        assert env.highway_vehicle.speed < -0.5

    def test_patches_lie_under_the_lot(self, make_parking: MakeParking) -> None:
        field = paint_field(
            named("asphalt"),
            (-40.0, 40.0, -25.0, 25.0),
            patches=[Patch(named("ice"), Disc(0.0, 0.0, 5.0))],
        )
        env = make_parking("physics", terrain=field, observe_terrain=True)
        inside, _ = env.reset(seed=0)
        outside, _ = env.reset(seed=0, options={"state": VehicleState(x=10.0)})
        assert inside["observation"][-3] < outside["observation"][-3]


def test_a_copy_goes_its_own_way_to_the_same_place(make_parking: MakeParking) -> None:
    env = make_parking("guarded", parked_vehicles=2)
    env.reset(seed=1)
    env.step(np.array([0.4, 0.6], np.float32))
    twin = copy.deepcopy(env)
    steps = [[each.step(np.array([0.5, 0.2], np.float32))[:2] for _ in range(4)] for each in (env, twin)]
    assert same(*steps)
    assert same(env.reset()[0], twin.reset()[0])


def test_the_engines_agree(make_parking: MakeParking) -> None:
    compiled, python = (make_parking("physics", engine=engine, time_limit=2.0) for engine in ("compiled", "python"))
    for one, other in zip(drive(compiled, 2, 6), drive(python, 2, 6), strict=True):
        np.testing.assert_allclose(numbers(one), numbers(other), rtol=0.0, atol=1e-5)


def numbers(of: Any) -> Any:
    """Every number in an observation, a reward or an info, in one row."""
    if isinstance(of, dict):
        return np.concatenate([numbers(each) for each in of.values()])
    return np.zeros(0) if isinstance(of, str) else np.ravel(np.asarray(of, np.float64))
