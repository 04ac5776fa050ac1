"""OffRoad-v0: a course of its own for every seed, a road that can be driven, and an end for every reason."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env as gymnasium_check

from grouser.envs import VehicleState
from grouser.envs.highway import OffRoadConfig, OffRoadEnv, SplineLane
from grouser.envs.highway.course import draw_course
from grouser.terrain import ConfigurationError, InvalidInputError, TerrainField, named

MakeOffRoad = Callable[..., OffRoadEnv]


def pursue(env: OffRoadEnv, seed: int, speed: float = 0.3) -> tuple[float, dict[str, Any]]:
    """Drive after a point 1.2 s ahead; ``twist`` actions."""
    observation, _ = env.reset(seed=seed)
    earned = 0.0
    while True:
        ahead, aside = observation[13:15].tolist()
        turn = np.clip(2.0 * math.atan2(aside, ahead), -1.0, 1.0)
        observation, reward, terminated, truncated, info = env.step(np.array([speed, turn], np.float32))
        earned += reward
        if terminated or truncated:
            return earned, info


def same(one: Any, other: Any) -> bool:
    np.testing.assert_equal(one, other)
    return True


class TestContract:
    @pytest.mark.parametrize("backend", ["physics", "native", "guarded", "torch"])
    def test_gymnasium_and_stable_baselines(self, make_offroad: MakeOffRoad, backend: str) -> None:
        checker = pytest.importorskip("stable_baselines3.common.env_checker")
        terrain = "asphalt" if backend == "torch" else "grenville-loam"
        env = make_offroad(backend, terrain, observe_terrain=True, road_points=4, obstacles=2)
        gymnasium_check(env, skip_render_check=True)
        checker.check_env(env)

    @pytest.mark.parametrize(("observed", "terrain", "size"), [(3, False, 28), (0, False, 19), (5, True, 38)])
    def test_the_observation_has_the_documented_size(
        self, make_offroad: MakeOffRoad, observed: int, terrain: bool, size: int
    ) -> None:
        env = make_offroad(observed_obstacles=observed, observe_terrain=terrain)
        observation, _ = env.reset(seed=0)
        assert observation.shape == env.observation_space.shape == (size,)

    @pytest.mark.parametrize("action", [[1.1, 0.0], [math.nan, 0.0], [0.0]])
    def test_an_action_outside_the_box_is_refused(self, make_offroad: MakeOffRoad, action: Any) -> None:
        env = make_offroad()
        env.reset(seed=0)
        with pytest.raises(InvalidInputError, match="action"):
            env.step(np.array(action, dtype=np.float32))

    def test_a_course_needs_a_reset(self, make_offroad: MakeOffRoad) -> None:
        with pytest.raises(gymnasium.error.ResetNeeded):
            make_offroad().step(np.zeros(2, np.float32))
        with pytest.raises(gymnasium.error.ResetNeeded):
            _ = make_offroad().path


class TestCourse:
    def test_is_drawn_anew_by_every_seed_and_the_same_by_one(self, make_offroad: MakeOffRoad) -> None:
        env, other = make_offroad(), make_offroad()
        courses = []
        for each, seed in ((env, 1), (env, 2), (other, 7), (other, 1)):
            observation, _ = each.reset(seed=seed)
            courses.append((each.path.y, each.course.obstacles, each.ground.parameters, observation))  # type: ignore[attr-defined]
        assert same(courses[0], courses[3])
        assert np.abs(courses[0][0][-1] - courses[1][0][-1]) > 0.1

    def test_leaves_room_for_the_vehicle(self) -> None:
        config = OffRoadConfig()
        width = 2.69
        for seed in range(40):
            course = draw_course(np.random.default_rng(seed), config, (named("ice"),))
            for x, y, _, edge in course.obstacles:
                reach = edge / math.sqrt(2.0)
                lateral = abs(course.path.project(x, y).cross_track)
                assert config.road_width / 2 + lateral - reach > 1.5 * width
                assert lateral + edge / 2 <= config.road_width / 2 + 1e-6

    def test_starts_and_ends_clear(self) -> None:
        for seed in range(40):
            course = draw_course(np.random.default_rng(seed), OffRoadConfig(), ())
            stations = [course.path.project(x, y).arc_length for x, y, _, _ in course.obstacles]
            assert min(stations) > 19.0
            assert max(stations) < course.path.length - 19.0
            # Half a stretch from one to the next.
            assert np.diff(stations).min() > (course.path.length - 40.0) / 5 / 2 - 2.0
            assert not course.patches

    def test_the_road_is_a_lane_of_the_path(self, make_offroad: MakeOffRoad) -> None:
        env = make_offroad(road_width=9.0)
        env.reset(seed=0)
        lane = env.road.network.get_lane(env.highway_vehicle.lane_index)
        assert isinstance(lane, SplineLane)
        assert lane.path is env.path
        assert lane.width_at(3.0) == 9.0

    def test_patches_are_in_the_ground_that_the_vehicle_drives_on(self, make_offroad: MakeOffRoad) -> None:
        env = make_offroad(terrain="asphalt", patch_terrains=("ice",), patches=3, patch_radius=(8.0, 8.0))
        env.reset(seed=0)
        ground = env.ground
        assert isinstance(ground, TerrainField)
        disc: Any = env.course.patches[-1].shape
        assert ground.parameters_at(disc.x, disc.y) == pytest.approx(named("ice").parameters)
        assert ground.parameters.reshape(-1, 3).max(axis=0)[0] == named("asphalt").parameters[0]

    def test_the_nearest_obstacle_is_seen_where_it_stands(self, make_offroad: MakeOffRoad) -> None:
        env = make_offroad()
        env.reset(seed=0)
        x, y, _, edge = env.course.obstacles[0].tolist()
        state = VehicleState(x=x - 10.0, y=y - 2.0)
        observation, _ = env.reset(seed=0, options={"state": state})
        assert 30 * observation[19:22] == pytest.approx([10.0, 2.0, edge / math.sqrt(2.0)], abs=1e-4)

    def test_who_sees_no_obstacle_sees_none_far_away(self, make_offroad: MakeOffRoad) -> None:
        observation, _ = make_offroad(obstacles=0).reset(seed=0)
        assert observation[19:28].tolist() == [1.0, 0.0, 0.0] * 3


class TestEpisodes:
    def test_a_road_without_obstacles_is_driven_to_its_end(self, make_offroad: MakeOffRoad) -> None:
        env = make_offroad("physics", obstacles=0, road_points=4, action_mode="twist")
        earned, info = pursue(env, 3)
        assert info["is_success"]
        assert info["progress"] >= env.path.length
        assert earned > 0.0

    def test_an_obstacle_on_the_way_ends_it(self, make_offroad: MakeOffRoad) -> None:
        env = make_offroad("physics", action_mode="twist", collision_weight=9.0)
        env.reset(seed=0)
        x, y, _, _ = env.course.obstacles[0].tolist()
        env.reset(seed=0, options={"state": VehicleState.rolling(5.0, x=x - 6.0, y=y)})
        for _ in range(20):
            _, reward, terminated, _, info = env.step(np.array([0.5, 0.0], np.float32))
            if terminated:
                break
        assert info["crashed"]
        assert not info["is_success"]
        assert info["reward_terms"]["collision"] == -9.0
        assert reward == sum(info["reward_terms"].values())

    def test_off_the_road_is_the_end(self, make_offroad: MakeOffRoad) -> None:
        env = make_offroad("physics", obstacles=0, action_mode="twist")
        env.reset(seed=0, options={"heading_offset": 1.2})
        for _ in range(60):
            _, _, terminated, _, info = env.step(np.array([0.5, 0.0], np.float32))
            if terminated:
                break
        assert terminated
        assert info["off_road"]
        assert info["reward_terms"]["off_road"] == -env.config.off_road_weight
        assert abs(info["cross_track_error"]) > env.config.road_width / 2

    def test_time_runs_out(self, make_offroad: MakeOffRoad) -> None:
        env = make_offroad(time_limit=0.2)
        env.reset(seed=0)
        assert [env.step(np.zeros(2, np.float32))[2:4] for _ in range(2)] == [(False, False), (False, True)]

    def test_progress_at_reference_speed_earns_its_weight(self, make_offroad: MakeOffRoad) -> None:
        env = make_offroad("physics", terrain="asphalt", obstacles=0, patches=0, progress_weight=2.0)
        env.reset(seed=0, options={"speed": 5.0, "lateral_offset": 0.0, "heading_offset": 0.0})
        for _ in range(8):
            *_, info = env.step(np.array([0.5, 0.5], np.float32))
        assert info["reward_terms"]["progress"] == pytest.approx(2.0, abs=0.05)

    def test_an_option_changes_what_it_names_alone(self, make_offroad: MakeOffRoad) -> None:
        env = make_offroad()
        env.reset(seed=4)
        course, speed = env.course, env.highway_vehicle.speed
        env.reset(seed=4, options={"lateral_offset": 2.0})
        assert same(env.course.obstacles, course.obstacles)
        assert env.highway_vehicle.speed == speed
        assert env.path.project(*env.highway_vehicle.position).cross_track == pytest.approx(2.0, abs=1e-6)

    def test_the_guard_is_in_the_info(self, make_offroad: MakeOffRoad) -> None:
        env = make_offroad("guarded")
        env.reset(seed=0)
        *_, info = env.step(np.array([0.5, 0.5], np.float32))
        assert {"ood_score", "fallback_weight", "backend"} <= info.keys()

    def test_a_copy_goes_its_own_way_to_the_same_place(self, make_offroad: MakeOffRoad) -> None:
        env = make_offroad()
        env.reset(seed=1)
        twin = copy.deepcopy(env)
        assert same(*([each.step(np.array([0.5, 0.4], np.float32))[:2] for _ in range(3)] for each in (env, twin)))


class TestSettings:
    @pytest.mark.parametrize(
        ("settings", "words"),
        [
            ({"road_points": 3}, "road_points"),
            ({"obstacles": -1}, "obstacles"),
            ({"obstacle_size": (2.0, 1.0)}, "least of obstacle_size"),
            ({"obstacle_size": (1.0, 8.0)}, "largest of obstacle_size"),
            ({"obstacle_size": 3.0}, "obstacle_size"),
            ({"bend": 2.0}, "bend"),
            ({"patches": 2.5}, "patches"),
            ({"control_period": 0.15}, "control_period and scene_period"),
        ],
    )
    def test_impossible_ones_are_refused(self, make_offroad: MakeOffRoad, settings: dict[str, Any], words: str) -> None:
        with pytest.raises(InvalidInputError, match=words):
            make_offroad(**settings)

    @pytest.mark.parametrize(
        ("settings", "words"),
        [
            ({"road_with": 9.0}, "'road_width'"),
            ({"patch_terrains": ("asphalt",)}, "soil"),
            ({"terrain": TerrainField.uniform(named("lete-sand"), (-9.0, 9.0, -9.0, 9.0))}, "alike everywhere"),
        ],
    )
    def test_what_does_not_fit_is_named(self, make_offroad: MakeOffRoad, settings: dict[str, Any], words: str) -> None:
        with pytest.raises(ConfigurationError, match=words):
            make_offroad(**settings)
