"""``grouser/SpeedTracking-v0``: checkers, profiles, observation, reward, ends of an episode."""

import math
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env as gymnasium_check
from numpy.typing import NDArray

import grouser  # noqa: F401 - registers the environment
from grouser.envs import MotionProfile, SpeedTrackingEnv, VehicleState
from grouser.surrogate import Surrogate
from grouser.terrain import (
    GRAVITY,
    ConfigurationError,
    ForceBackend,
    InvalidInputError,
    Mode,
    TerrainField,
    TrackedVehicle,
    named,
)

M113 = TrackedVehicle.preset("m113")
GROUND = {"rigid": "asphalt", "soil": "lete-sand"}
BACKENDS = ("physics", "torch", "native", "guarded")
MakeEnv = Callable[..., SpeedTrackingEnv]


def act(left: float, right: float) -> NDArray[np.float32]:
    return np.array([left, right], dtype=np.float32)


@pytest.fixture
def make_env(make_surrogate: Callable[[Mode], Surrogate]) -> MakeEnv:
    def make(backend: str | ForceBackend = "physics", mode: Mode = "rigid", **options: Any) -> SpeedTrackingEnv:
        if backend in ("torch", "native", "guarded"):
            options["backend_options"] = {"artifact": make_surrogate(mode)}
        elif backend == "physics":
            options["backend_options"] = {"cells": (2, 1)}
        return SpeedTrackingEnv(backend, terrain=options.pop("terrain", GROUND[mode]), **options)

    return make


def profile_of(env: SpeedTrackingEnv) -> MotionProfile:
    return env._episode.profile


class TestCheckers:
    @pytest.mark.parametrize("backend", BACKENDS)
    @pytest.mark.parametrize("mode", ["rigid", "soil"])
    def test_gymnasium(self, make_env: MakeEnv, backend: str, mode: Mode) -> None:
        gymnasium_check(make_env(backend, mode, observe_terrain=mode == "soil"), skip_render_check=True)

    @pytest.mark.parametrize("backend", BACKENDS)
    def test_stable_baselines(self, make_env: MakeEnv, backend: str) -> None:
        checker = pytest.importorskip("stable_baselines3.common.env_checker")
        checker.check_env(make_env(backend, action_mode="twist"))

    def test_by_id_with_frames(self, monkeypatch: pytest.MonkeyPatch) -> None:
        pytest.importorskip("pygame")
        monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
        env = gymnasium.make("grouser/SpeedTracking-v0", backend="physics", render_mode="rgb_array")
        env.reset(seed=0)
        frame: Any = env.render()
        assert frame.ndim == 3
        env.close()


class TestMaking:
    @pytest.mark.parametrize(
        ("settings", "nearest"),
        [
            ({"backend": "pysics"}, "physics"),
            ({"terrain": "asphal"}, "asphalt"),
            ({"segment_tme": 1.0}, "segment_time"),
            ({"engine": "compild"}, "compiled"),
        ],
    )
    def test_unknown_names_come_with_the_nearest(self, settings: dict[str, Any], nearest: str) -> None:
        with pytest.raises(ConfigurationError, match=f"did you mean '{nearest}'"):
            SpeedTrackingEnv(**({"backend": "physics"} | settings))

    @pytest.mark.parametrize(
        ("settings", "named_in_error"),
        [
            ({"segment_time": 0.0}, "segment_time"),
            ({"ramp_time": 6.0}, "ramp_time"),
            ({"effort": 1.5}, "effort"),
            ({"speed_tolerance": -1.0}, "speed_tolerance"),
            ({"lowest_speed": 3.0, "highest_speed": 2.0}, "highest_speed"),
            ({"highest_speed": 11.0}, "highest_speed"),
            ({"lowest_speed": 8.0}, "lowest_speed"),
            ({"control_period": 0.015}, "control_period"),
            ({"speed_weight": math.nan}, "speed_weight"),
        ],
    )
    def test_impossible_settings(self, settings: dict[str, Any], named_in_error: str) -> None:
        with pytest.raises(InvalidInputError, match=named_in_error):
            SpeedTrackingEnv("physics", **settings)

    def test_a_step_before_the_first_reset(self, make_env: MakeEnv) -> None:
        with pytest.raises(gymnasium.error.ResetNeeded):
            make_env().step(act(0.0, 0.0))

    def test_the_compiled_engine_can_be_insisted_on(self, viscous: Callable[..., ForceBackend]) -> None:
        assert SpeedTrackingEnv(viscous()).reset(seed=0)
        with pytest.raises(ConfigurationError, match="compiled"):
            SpeedTrackingEnv(viscous(), engine="compiled")


class TestProfile:
    def test_rises_smoothly_from_knot_to_knot(self) -> None:
        profile = MotionProfile(np.array([0.0, 4.0, 2.0]), np.array([0.0, 0.5, -0.5]), 5.0, 2.0)
        assert profile.at(0.0) == (0.0, 0.0)
        assert profile.at(1.0) == (2.0, 0.25)
        assert profile.at(2.0) == profile.at(5.0) == (4.0, 0.5)
        assert profile.at(6.0) == (3.0, 0.0)
        assert profile.at(1e6) == (2.0, -0.5)
        times = np.linspace(0.0, 12.0, 12001)
        slopes = np.diff([profile.at(time)[0] for time in times.tolist()]) / 1e-3
        assert abs(slopes).max() == pytest.approx(1.5 * 4.0 / 2.0, rel=1e-3)
        assert abs(np.diff(slopes)).max() < 0.02

    @pytest.mark.parametrize(
        "arguments",
        [
            (np.zeros(2), np.zeros(3), 1.0, 1.0),
            (np.zeros((2, 2)), np.zeros((2, 2)), 1.0, 1.0),
            (np.zeros(0), np.zeros(0), 1.0, 1.0),
            (np.array([math.nan]), np.zeros(1), 1.0, 1.0),
            (np.zeros(2), np.zeros(2), 1.0, 2.0),
            (np.zeros(2), np.zeros(2), 0.0, 0.0),
        ],
    )
    def test_refusals(self, arguments: Any) -> None:
        with pytest.raises(InvalidInputError):
            MotionProfile(*arguments)

    @pytest.mark.parametrize("ground", ["asphalt", "ice", "lete-sand"])
    def test_draws_stay_within_what_vehicle_and_ground_allow(self, ground: str) -> None:
        env = SpeedTrackingEnv("physics", terrain=ground)
        theta = named(ground).parameters
        area = 2 * M113.track_width * M113.contact_length
        strength = theta[0] if len(theta) == 3 else theta[0] * area / M113.weight + math.tan(theta[1])
        seen = []
        for seed in range(40):
            env.reset(seed=seed)
            knots = profile_of(env).knots()
            seen.append(knots)
            speed, yaw_rate = knots.T
            assert (knots[0, 1], len(knots)) == (0.0, 9)
            assert ((speed >= 0.0) & (speed <= 7.0)).all()
            assert (abs(yaw_rate) <= 0.5 + 1e-12).all()
            assert (abs(yaw_rate * speed) <= 0.5 * strength * GRAVITY + 1e-9).all()
            rise = 0.5 * min(M113.belt_acceleration, strength * GRAVITY)
            assert (abs(np.diff(speed)) * 1.5 / 2.0 <= rise + 1e-9).all()
        speeds, yaw_rates = np.concatenate(seen).T
        assert speeds.min() < 0.5
        assert speeds.max() > 6.0
        assert yaw_rates.min() < -0.2
        assert yaw_rates.max() > 0.2

    @pytest.mark.parametrize("ground", ["asphalt", "lete-sand"])
    def test_can_be_followed_by_the_observation_alone(self, make_env: MakeEnv, ground: str) -> None:
        env = make_env(mode="soil" if ground == "lete-sand" else "rigid", action_mode="twist")
        observation, _ = env.reset(seed=1)
        errors, rewards = [], []
        for _ in range(150):
            speed = observation[7] - 0.3 * observation[5]
            turn = 1.6 * observation[8] - 0.5 * observation[6]
            observation, reward, _, _, info = env.step(np.clip(act(speed, turn), -1, 1))
            errors.append((info["speed_error"], info["yaw_rate_error"]))
            rewards.append(reward)
        assert (np.sqrt(np.mean(np.square(errors), axis=0)) < (0.3, 0.05)).all()
        assert np.mean(rewards) > 1.8

    def test_one_of_ones_own(self, make_env: MakeEnv) -> None:
        env = make_env()
        env.reset(seed=0)
        drawn = env.simulator.get_state()
        mine = MotionProfile(np.array([1.0, 3.0]), np.array([0.0, 0.2]), 5.0, 2.0)
        observation, info = env.reset(seed=0, options={"profile": mine})
        assert env.simulator.get_state() == drawn
        assert info["speed_error"] == pytest.approx(drawn.vx - 1.0)
        expected = [
            value / scale for t in (0.4, 0.8, 1.2, 1.6, 2.0) for value, scale in zip(mine.at(t), (10, 1), strict=True)
        ]
        assert observation[7:17] == pytest.approx(expected, abs=1e-6)
        for wrong in (
            MotionProfile(np.array([1.0, 3.0]), np.zeros(2), 4.0, 2.0),
            MotionProfile(np.ones(10), np.zeros(10), 5.0, 2.0),
        ):
            with pytest.raises(InvalidInputError, match="knots"):
                env.reset(options={"profile": wrong})
        with pytest.raises(InvalidInputError, match="MotionProfile"):
            env.reset(options={"profile": [1.0, 2.0]})


class TestReset:
    def test_rolls_straight_at_a_share_of_the_first_speed(self, make_env: MakeEnv) -> None:
        env = make_env()
        headings = []
        for seed in range(60):
            env.reset(seed=seed)
            state, first = env.simulator.get_state(), profile_of(env).at(0.0)[0]
            assert state == VehicleState.rolling(state.vx, heading=state.heading)
            assert 0.5 * first <= state.vx <= first
            headings.append(state.heading)
        assert min(headings) < -2.5
        assert max(headings) > 2.5

    def test_options_change_only_what_they_name(self, make_env: MakeEnv) -> None:
        env = make_env()
        env.reset(seed=3)
        drawn, profile = env.simulator.get_state(), profile_of(env).knots().tolist()
        env.reset(seed=3, options={"speed": 1.5})
        assert env.simulator.get_state() == VehicleState.rolling(1.5, heading=drawn.heading)
        assert profile_of(env).knots().tolist() == profile
        state = VehicleState(x=3.0, vx=2.0, yaw_rate=0.1)
        env.reset(seed=3, options={"state": state})
        assert env.simulator.get_state() == state
        assert profile_of(env).knots().tolist() == profile

    @pytest.mark.parametrize(
        ("options", "error"),
        [
            ({"sped": 1.0}, ConfigurationError),
            ({"arc_length": 1.0}, ConfigurationError),
            ({"terrain": "lete-sand"}, ConfigurationError),
            ({"speed": math.inf}, InvalidInputError),
            ({"speed": 1e3}, InvalidInputError),
        ],
    )
    def test_refusals(self, make_env: MakeEnv, options: dict[str, Any], error: type[Exception]) -> None:
        env = make_env()
        env.reset(seed=0)
        before = env.simulator.get_state(), env.simulator.ground
        with pytest.raises(error):
            env.reset(options=options)
        assert (env.simulator.get_state(), env.simulator.ground) == before


class TestStep:
    @pytest.mark.parametrize("engine", ["compiled", "python"])
    def test_observation_and_reward_by_the_formulas(self, make_env: MakeEnv, engine: str) -> None:
        weights = {"speed_weight": 1.3, "yaw_rate_weight": 0.7, "action_change_weight": 0.2, "slip_power_weight": 0.0}
        env = make_env(engine=engine, speed_tolerance=0.4, yaw_rate_tolerance=0.2, yaw_rate_scale=2.0, **weights)
        env.reset(seed=2)
        profile, generator, previous = profile_of(env), np.random.default_rng(0), np.zeros(2)
        for step in range(1, 30):
            action = generator.uniform(-1.0, 1.0, 2).astype(np.float32)
            observation, reward, terminated, truncated, info = env.step(action)
            state, (speed, yaw_rate) = env.simulator.get_state(), profile.at(step * 0.1)
            errors = state.vx - speed, state.yaw_rate - yaw_rate
            assert (info["speed_error"], info["yaw_rate_error"]) == pytest.approx(errors, abs=1e-12)
            ahead = [part for t in (0.4, 0.8, 1.2, 1.6, 2.0) for part in profile.at(step * 0.1 + t)]
            scales = np.array([10.0, 2.0] * 5)
            belts = [state.v_left / 10, state.v_right / 10]
            motion = [state.vx / 10, state.vy / 10, state.yaw_rate / 2, *belts]
            expected = [*motion, errors[0] / 10, errors[1] / 2, *(np.array(ahead) / scales), *action]
            assert observation == pytest.approx(expected, abs=1e-6)
            change = action.astype(np.float64) - previous
            assert info["reward_terms"] == pytest.approx(
                {
                    "speed": 1.3 / (1 + (errors[0] / 0.4) ** 2),
                    "yaw_rate": 0.7 / (1 + (errors[1] / 0.2) ** 2),
                    "action_change": -0.2 * float(change @ change),
                    "slip_power": 0.0,
                },
                abs=1e-12,
            )
            assert reward == pytest.approx(sum(info["reward_terms"].values()), abs=1e-12)
            assert not terminated
            assert not truncated
            previous = action.astype(np.float64)

    def test_is_truncated_at_the_time_limit(self, make_env: MakeEnv) -> None:
        env = make_env(time_limit=0.5)
        for _ in range(2):
            env.reset(seed=0)
            assert [env.step(act(0.3, 0.3))[2:4] for _ in range(5)] == [(False, False)] * 4 + [(False, True)]

    def test_divergence_ends_the_episode(self, poisoned: Callable[..., ForceBackend]) -> None:
        env = SpeedTrackingEnv(poisoned(jacobian_scale=math.nan), speed_weight=2.0)
        env.reset(seed=0)
        observation, reward, terminated, truncated, info = env.step(act(0.0, 0.0))
        assert env.observation_space.contains(observation)
        assert (reward, terminated, truncated, info["diverged"]) == (-3.0, True, False, True)

    @pytest.mark.parametrize("engine", ["compiled", "python"])
    def test_leaving_the_map_ends_the_episode(self, make_env: MakeEnv, engine: str) -> None:
        map_of_ice = TerrainField("rigid", (-5.0, -5.0), 1.0, np.tile(named("ice").parameters, (10, 10, 1)))
        env = make_env(engine=engine, terrain=map_of_ice, observe_terrain=True)
        env.reset(seed=0, options={"state": VehicleState.rolling(5.0)})
        for _ in range(30):
            observation, reward, terminated, _, info = env.step(act(0.5, 0.5))
            assert env.observation_space.contains(observation)
            if terminated:
                break
        assert (reward, info["off_map"]) == (-2.0, True)
        assert env.simulator.get_state().x > 4.5

    @pytest.mark.parametrize("action", [[math.nan, 0.0], [1.1, 0.0], [0.0], [[0.0, 0.0]]])
    def test_actions_out_of_the_box(self, make_env: MakeEnv, action: Any) -> None:
        env = make_env()
        env.reset(seed=0)
        with pytest.raises(InvalidInputError, match="two numbers"):
            env.step(np.array(action, dtype=np.float32))
