"""The path-tracking task: where an episode starts, what is observed, what it earns and how it ends."""

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from path_tracking import BACKENDS, MakeEnv, act, episode, tracking_maker, twin

from grouser.envs import BeltCommand, Path, PathTrackingEnv, VehicleState
from grouser.surrogate import Surrogate
from grouser.terrain import (
    ConfigurationError,
    ForceBackend,
    InvalidInputError,
    Mode,
    PhysicsBackend,
    SoilTerrain,
    TrackedVehicle,
    named,
    parameter_ranges,
)

M113 = TrackedVehicle.preset("m113")
every_backend = pytest.mark.parametrize("backend", BACKENDS)


@pytest.fixture
def make_env(make_surrogate: Callable[[Mode], Surrogate]) -> MakeEnv:
    return tracking_maker(make_surrogate)


class TestReset:
    @staticmethod
    def start(env: PathTrackingEnv, seed: int = 5, **options: Any) -> VehicleState:
        env.reset(seed=seed, options=options)
        return env.simulator.get_state()

    def test_rolls_along_the_path_near_its_start(self, make_env: MakeEnv) -> None:
        env = make_env(path="iso-3888-1")
        for seed in range(50):
            state = self.start(env, seed)
            assert state == VehicleState.rolling(state.vx, x=state.x, y=state.y, heading=state.heading)
            assert state.x == pytest.approx(0.0, abs=1e-12)
            assert abs(state.y) <= 0.2
            assert abs(state.heading) <= 0.05
            assert 2.5 <= state.vx <= 5.0

    def test_draws_fill_their_ranges(self, make_env: MakeEnv) -> None:
        env = make_env(path="straight", lateral_spread=1.0, heading_spread=0.5, lowest_start_speed=0.0)
        states = [self.start(env, seed) for seed in range(300)]
        for values, low, high in (
            ([state.y for state in states], -1.0, 1.0),
            ([state.heading for state in states], -0.5, 0.5),
            ([state.vx for state in states], 0.0, 5.0),
        ):
            assert low <= min(values) < low + 0.05 * (high - low)
            assert high - 0.05 * (high - low) < max(values) <= high
            assert np.mean(values) == pytest.approx((low + high) / 2, abs=0.1 * (high - low))

    def test_no_spread_is_on_the_path(self, make_env: MakeEnv) -> None:
        env = make_env(path="straight", lateral_spread=0.0, heading_spread=0.0, lowest_start_speed=1.0)
        assert self.start(env) == VehicleState.rolling(5.0)

    @pytest.mark.parametrize(
        ("options", "changed"),
        [
            ({"speed": 1.5}, {"vx": 1.5, "v_left": 1.5, "v_right": 1.5}),
            ({"lateral_offset": -0.7}, {"y": -0.7}),
            ({"heading_offset": 0.3}, {"heading": 0.3}),
            ({"arc_length": 30.0}, {"x": 30.0}),
            ({"terrain": "ice"}, {}),
            ({"speed": 0.0, "heading_offset": -1.0}, {"vx": 0.0, "v_left": 0.0, "v_right": 0.0, "heading": -1.0}),
        ],
    )
    def test_an_option_changes_only_what_it_names(
        self, make_env: MakeEnv, options: dict[str, Any], changed: dict[str, float]
    ) -> None:
        env = make_env(path="straight")
        drawn = self.start(env)
        given = self.start(env, **options)
        for name in ("x", "y", "heading", "vx", "vy", "yaw_rate", "v_left", "v_right", "ax", "ay", "time"):
            assert getattr(given, name) == pytest.approx(changed.get(name, getattr(drawn, name)), abs=1e-12)
        assert given.guard == drawn.guard
        assert env.simulator.ground == named(options.get("terrain", "asphalt"))
        # Nor does it shift later draws.
        after_options = env.reset()[0]
        self.start(env)
        assert env.reset()[0].tobytes() == after_options.tobytes()

    def test_offsets_are_taken_from_the_path_at_the_arc_length(self, make_env: MakeEnv) -> None:
        env = make_env(path="circle")
        s = 20.0
        state = self.start(env, arc_length=s, lateral_offset=0.5, heading_offset=-0.1, speed=2.0)
        x, y = env.path.point_at(s)
        heading = env.path.heading_at(s)
        expected = VehicleState.rolling(
            2.0, x=x - 0.5 * math.sin(heading), y=y + 0.5 * math.cos(heading), heading=heading - 0.1
        )
        for name in ("x", "y", "heading", "vx"):
            assert getattr(state, name) == pytest.approx(getattr(expected, name), abs=1e-12)
        observation, info = env.reset(
            options={"arc_length": s, "lateral_offset": 0.5, "heading_offset": -0.1, "speed": 2.0}
        )
        assert info["cross_track_error"] == pytest.approx(0.5, abs=1e-6)
        assert observation[5] == pytest.approx(0.1, abs=1e-6)
        assert observation[6] == pytest.approx(-0.1 / math.pi, abs=1e-6)

    def test_a_state_is_taken_whole(self, make_env: MakeEnv) -> None:
        env = make_env(path="straight")
        state = VehicleState(
            x=11.0, y=0.4, heading=0.2, vx=3.0, vy=0.1, yaw_rate=0.2, v_left=2.5, v_right=3.5, ax=0.3, ay=-0.2
        )
        assert self.start(env, state=state) == state
        _, info = env.reset(options={"state": state})
        assert info == {"cross_track_error": pytest.approx(0.4), "progress": 0.0}

    def test_the_others_do_not_matter_beside_a_state(self, make_env: MakeEnv) -> None:
        env = make_env(path="straight")
        state = VehicleState(x=11.0, y=0.4, vx=3.0)
        given = self.start(env, state=state, arc_length=50.0, lateral_offset=1.0, heading_offset=0.3, speed=1.0)
        assert given == state
        assert env.reset(options={"state": state, "arc_length": 50.0})[1]["progress"] == 0.0
        assert env.step(act(0.0, 0.0))[4]["progress"] == pytest.approx(0.3, abs=0.05)

    def test_a_ground_holds_for_one_episode(self, make_env: MakeEnv) -> None:
        env = make_env(observe_terrain=True)
        usual = env.reset(seed=0)[0]
        icy = env.reset(seed=0, options={"terrain": named("ice")})[0]
        assert (usual[:19] == icy[:19]).all()
        assert (usual[19:] != icy[19:]).any()
        assert env.simulator.ground == named("ice")
        env.reset(seed=0)
        assert env.simulator.ground == named("asphalt")

    def test_the_clock_starts_at_zero(self, make_env: MakeEnv) -> None:
        env = make_env()
        episode(env, 0, steps=3)
        assert self.start(env).time == 0.0
        assert self.start(env, state=VehicleState(time=12.0)).time == 0.0

    def test_the_previous_action_is_forgotten(self, make_env: MakeEnv) -> None:
        env = make_env()
        env.reset(seed=0)
        assert env.step(act(1.0, -0.5))[0][17:19].tolist() == [1.0, -0.5]
        assert env.reset(seed=0)[0][17:19].tolist() == [0.0, 0.0]

    def test_refusals(self, make_env: MakeEnv) -> None:
        env = make_env()
        with pytest.raises(ConfigurationError, match="did you mean 'speed'"):
            env.reset(options={"sped": 1.0})
        with pytest.raises(ConfigurationError, match="did you mean 'asphalt'"):
            env.reset(options={"terrain": "asphat"})
        with pytest.raises(ConfigurationError, match="soil"):
            env.reset(options={"terrain": "lete-sand"})

    @pytest.mark.parametrize("name", ["arc_length", "lateral_offset", "heading_offset", "speed"])
    @pytest.mark.parametrize("value", [math.nan, math.inf])
    def test_numbers_that_are_not_finite(self, make_env: MakeEnv, name: str, value: float) -> None:
        with pytest.raises(InvalidInputError):
            make_env().reset(options={name: value})

    def test_a_refused_reset_leaves_the_episode_alone(self, make_env: MakeEnv) -> None:
        env = make_env()
        env.reset(seed=0)
        before = env.simulator.get_state(), env.simulator.ground
        for options in ({"sped": 1.0}, {"terrain": "lete-sand"}, {"speed": math.nan}):
            with pytest.raises((ConfigurationError, InvalidInputError)):
                env.reset(options=options)
            assert (env.simulator.get_state(), env.simulator.ground) == before


class TestObservation:
    STATE = VehicleState(
        x=30.0, y=1.5, heading=0.25, vx=4.0, vy=-0.3, yaw_rate=0.4, v_left=3.0, v_right=5.0, ax=0.5, ay=0.1
    )

    def test_by_hand_on_a_straight_path(self, make_env: MakeEnv) -> None:
        env = make_env(path="straight", observe_terrain=True, yaw_rate_scale=2.0)
        observation, _ = env.reset(options={"state": self.STATE})
        # Training speed 10 m/s; v_ref is half of it, so that the points lie 2, 4, 6, 8 and 10 m ahead.
        expected = [0.4, -0.03, 0.2, 0.3, 0.5, 1.5 / 5.0, 0.25 / math.pi]
        c, s = math.cos(0.25), math.sin(0.25)
        for ahead in (2.0, 4.0, 6.0, 8.0, 10.0):
            expected += [(c * ahead - s * 1.5) / 10.0, (-s * ahead - c * 1.5) / 10.0]
        expected += [0.0, 0.0]
        # μ .8 in [.1, 1], f_r .03 in [.01, .2], K .025 in [.005, .06].
        expected += [2 * 0.7 / 0.9 - 1, 2 * 0.02 / 0.19 - 1, 2 * 0.02 / 0.055 - 1]
        assert observation == pytest.approx(np.array(expected, dtype=np.float32), abs=1e-6)

    def test_soil_over_the_wide_ranges(self, make_env: MakeEnv) -> None:
        env = make_env(mode="soil", observe_terrain=True)
        low, high = (
            np.array(bound) for bound in (parameter_ranges("wide", "soil").low, (70e3, 42 * math.pi / 180, 0.2, 0.06))
        )
        for values, expected in ((low, -1.0), (high, 1.0), ((low + high) / 2, 0.0)):
            observation, _ = env.reset(options={"terrain": SoilTerrain(*values.tolist())})
            assert observation[19:] == pytest.approx(np.full(4, expected), abs=1e-6)

    @pytest.mark.parametrize("laps", [0, 1, -3])
    def test_the_heading_error_is_wrapped(self, make_env: MakeEnv, laps: int) -> None:
        env = make_env(path="straight")
        for heading in (0.1, -3.0, 3.1):
            state = replace(self.STATE, heading=heading + 2 * math.pi * laps)
            assert env.reset(options={"state": state})[0][6] == pytest.approx(heading / math.pi, abs=1e-6)

    def test_look_ahead_follows_the_path_at_reference_speed(self, make_env: MakeEnv) -> None:
        env = make_env(path="circle", reference_speed=3.0)
        s = 10.0
        state = VehicleState(x=1.0, y=2.0, heading=0.7)
        observation, _ = env.reset(options={"state": state})
        s = env.path.project(1.0, 2.0).arc_length
        for index, seconds in enumerate((0.4, 0.8, 1.2, 1.6, 2.0)):
            angle = (s + 3.0 * seconds) / 15.0
            ahead = complex(15.0 * math.sin(angle) - 1.0, 15.0 * (1.0 - math.cos(angle)) - 2.0)
            body = ahead * complex(math.cos(0.7), -math.sin(0.7)) / 6.0
            assert observation[7 + 2 * index : 9 + 2 * index] == pytest.approx([body.real, body.imag], abs=1e-4)

    def test_the_previous_action_is_the_last_given(self, make_env: MakeEnv) -> None:
        env = make_env(action_mode="twist")
        env.reset(seed=0)
        for action in (act(0.5, -0.25), act(-1.0, 1.0)):
            assert env.step(action)[0][17:19].tolist() == action.tolist()

    def test_is_clipped_into_its_box(self, make_env: MakeEnv) -> None:
        env = make_env(path="straight")
        observation, _ = env.reset(options={"state": VehicleState(yaw_rate=50.0, vx=-300.0)})
        assert observation[2] == 10.0
        assert observation[0] == -10.0
        assert observation in env.observation_space

    def test_scales_follow_the_vehicle(self) -> None:
        env = PathTrackingEnv("physics", "maxxii", path="straight")
        observation, _ = env.reset(options={"state": VehicleState(vx=0.25, v_left=0.5, v_right=-0.75)})
        assert observation[[0, 3, 4]].tolist() == [0.25, 0.5, -0.75]
        assert observation[7:17:2] == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0], abs=1e-6)


class TestReward:
    """progress − cross-track − action change − slip power, after the formula in the docstring."""

    @staticmethod
    def slip_power(env: PathTrackingEnv, before: VehicleState, command: BeltCommand) -> float:
        """Belt power less the power that reaches the body, in the last tick, at 2 × 1 cells, without rolling resistance."""
        other = twin(env, before, command)
        assert other.state == env.simulator.get_state()
        row = other.row.copy()
        row[-2] = 0.0
        left, right = PhysicsBackend(env.vehicle, env.simulator.backend.mode, cells=(2, 1)).track_forces(row, row)[0]
        qx, qy, mz = left + right
        return float(row[5] * left[0] + row[6] * right[0] - qx * row[0] - qy * row[1] - mz * row[2])

    @pytest.mark.parametrize("mode", ["rigid", "soil"])
    @pytest.mark.parametrize("backend", BACKENDS)
    def test_terms_by_the_formula(self, make_env: MakeEnv, backend: str, mode: Mode) -> None:
        weights = {
            "progress_weight": 1.3,
            "cross_track_weight": 0.7,
            "action_change_weight": 0.2,
            "slip_power_weight": 0.4,
        }
        env = make_env(backend, mode, path="sine", **weights)
        env.reset(seed=2)
        generator = np.random.default_rng(0)
        previous, s_before = np.zeros(2), 0.0
        for _ in range(12):
            action = generator.uniform(-1.0, 1.0, 2).astype(np.float32)
            before = env.simulator.get_state()
            _, reward, _, _, info = env.step(action)
            terms = info["reward_terms"]
            assert set(terms) == {"progress", "cross_track", "action_change", "slip_power"}
            assert reward == pytest.approx(sum(terms.values()), abs=1e-12)
            state = env.simulator.get_state()
            foot = env.path.project(state.x, state.y, near=s_before)
            p = (foot.arc_length - s_before) / (5.0 * 0.1)
            assert terms["progress"] == pytest.approx(1.3 * min(p, 2.0 - p), abs=1e-9)
            assert terms["cross_track"] == pytest.approx(-0.7 * (foot.cross_track / 2.0) ** 2, abs=1e-9)
            change = action.astype(np.float64) - previous
            assert terms["action_change"] == pytest.approx(-0.2 * float(change @ change), abs=1e-12)
            left, right = (10.0 * action.astype(np.float64)).tolist()
            power = self.slip_power(env, before, BeltCommand(left, right))
            assert terms["slip_power"] == pytest.approx(-0.4 * power / (M113.mass * 9.81 * 5.0), rel=1e-9, abs=1e-12)
            assert info["cross_track_error"] == pytest.approx(foot.cross_track, abs=1e-9)
            previous, s_before = action.astype(np.float64), foot.arc_length

    @pytest.mark.parametrize("backend", BACKENDS)
    @pytest.mark.parametrize("mode", ["rigid", "soil"])
    def test_slip_power_is_never_gained(self, make_env: MakeEnv, backend: str, mode: Mode) -> None:
        env = make_env(backend, mode, maximum_cross_track=1000.0)
        env.reset(seed=0)
        generator = np.random.default_rng(1)
        terms = [env.step(generator.uniform(-1.0, 1.0, 2).astype(np.float32))[4]["reward_terms"] for _ in range(40)]
        assert max(term["slip_power"] for term in terms) <= 0.0
        assert min(term["slip_power"] for term in terms) < -1e-4

    @pytest.mark.parametrize(("speed", "best"), [(2.0, False), (4.5, False), (5.0, True), (5.5, False), (9.0, False)])
    def test_progress_earns_most_at_reference_speed(
        self, viscous: Callable[..., ForceBackend], speed: float, best: bool
    ) -> None:
        env = PathTrackingEnv(viscous(rate=1.0, follow_belts=True), path="straight")
        env.reset(options={"state": VehicleState.rolling(speed)})
        progress = env.step(act(speed / 10.0, speed / 10.0))[4]["reward_terms"]["progress"]
        assert progress == pytest.approx(1.0 - abs(speed / 5.0 - 1.0), abs=1e-6)
        assert (progress > 1.0 - 1e-6) == best

    def test_going_back_costs(self, viscous: Callable[..., ForceBackend]) -> None:
        env = PathTrackingEnv(viscous(rate=1.0, follow_belts=True), path="straight")
        env.reset(options={"state": VehicleState.rolling(-2.0, x=30.0)})
        _, _, _, _, info = env.step(act(-0.2, -0.2))
        assert info["reward_terms"]["progress"] == pytest.approx(-0.4, abs=1e-6)
        assert info["progress"] == pytest.approx(-0.2, abs=1e-6)

    def test_weights_of_zero_silence_their_terms(self, make_env: MakeEnv) -> None:
        names = ("progress", "cross_track", "action_change", "slip_power")
        env = make_env(**{f"{name}_weight": 0.0 for name in names})
        env.reset(seed=0)
        assert env.step(act(1.0, -1.0))[1] == 0.0


class TestEnds:
    @pytest.mark.parametrize("side", [1.0, -1.0])
    def test_terminates_beyond_five_meters_from_the_path(
        self, viscous: Callable[..., ForceBackend], side: float
    ) -> None:
        env = PathTrackingEnv(viscous(rate=1.0, follow_belts=True), path="straight")
        heading = side * math.pi / 2
        env.reset(options={"state": VehicleState.rolling(2.0, x=50.0, y=side * 4.5, heading=heading)})
        ends = []
        for _ in range(4):
            _, _, terminated, truncated, info = env.step(act(0.2, 0.2))
            assert not truncated
            assert terminated == (abs(info["cross_track_error"]) > 5.0)
            ends.append(terminated)
        assert ends == [False, False, True, True] or ends == [False, True, True, True]

    def test_maximum_cross_track_is_a_setting(self, viscous: Callable[..., ForceBackend]) -> None:
        env = PathTrackingEnv(viscous(), path="straight", maximum_cross_track=1.0)
        env.reset(options={"state": VehicleState(x=50.0, y=1.1)})
        assert env.step(act(0.0, 0.0))[2] is True

    def test_terminates_at_the_end_of_the_path(self, make_env: MakeEnv) -> None:
        env = make_env(path="straight")
        env.reset(seed=0, options={"arc_length": env.path.length - 1.2, "speed": 5.0})
        for _ in range(10):
            _, _, terminated, truncated, _ = env.step(act(0.5, 0.5))
            assert not truncated
            assert terminated == (env.simulator.get_state().x >= 120.0)
            if terminated:
                break
        assert terminated

    def test_a_closed_path_ends_after_one_lap(self, viscous: Callable[..., ForceBackend]) -> None:
        vehicle = TrackedVehicle.preset("maxxii")
        radius = 2.0
        angle = np.linspace(0.0, 2 * math.pi, 100, endpoint=False)
        path = Path.from_points(
            "ring", radius * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)]), closed=True, spacing=0.05
        )
        # Steers back to the ring by the observation.
        env = PathTrackingEnv(viscous(vehicle, rate=50.0, follow_belts=True), vehicle, path=path, action_mode="twist")
        observation, _ = env.reset(seed=0, options={"arc_length": 9.0, "lateral_offset": 0.0, "heading_offset": 0.0})
        assert path.length == pytest.approx(2 * math.pi * radius, rel=1e-4)
        steps = 0
        for _ in range(400):
            steps += 1
            wanted = 1.0 / radius - 2.0 * 5.0 * float(observation[5]) - 2.0 * math.pi * float(observation[6])
            observation, _, terminated, truncated, info = env.step(act(0.9, min(max(0.9 * wanted, -1.0), 1.0)))
            assert not truncated
            assert abs(info["cross_track_error"]) < 0.3
            assert terminated == (info["progress"] >= path.length)
            if terminated:
                break
        assert 100 < steps < 200

    def test_is_truncated_at_forty_seconds(self, viscous: Callable[..., ForceBackend]) -> None:
        env = PathTrackingEnv(viscous(follow_belts=True), path="straight", control_period=0.5, tick=0.1)
        env.reset(seed=0, options={"speed": 0.0})
        ends = [env.step(act(0.0, 0.0))[2:4] for _ in range(80)]
        assert ends == [(False, False)] * 79 + [(False, True)]
        assert env.simulator.get_state().time == pytest.approx(40.0)

    def test_time_limit_is_a_setting_and_counts_afresh_each_episode(self, make_env: MakeEnv) -> None:
        env = make_env(time_limit=0.5)
        for _ in range(2):
            env.reset(seed=0)
            assert [env.step(act(0.3, 0.3))[3] for _ in range(5)] == [False] * 4 + [True]

    def test_termination_beats_truncation(self, viscous: Callable[..., ForceBackend]) -> None:
        env = PathTrackingEnv(viscous(), path="straight", time_limit=0.1)
        env.reset(options={"state": VehicleState(x=50.0, y=5.5)})
        assert env.step(act(0.0, 0.0))[2:4] == (True, False)

    def test_progress_accumulates_from_the_start(self, make_env: MakeEnv) -> None:
        env = make_env(path="straight")
        env.reset(seed=0, options={"arc_length": 40.0, "speed": 5.0})
        progress = [0.0] + [env.step(act(0.5, 0.5))[4]["progress"] for _ in range(10)]
        assert all(b > a for a, b in pairwise(progress))
        assert progress[-1] == pytest.approx(env.simulator.get_state().x - 40.0, abs=1e-6)

    def test_divergence_ends_the_episode_and_says_so(self, poisoned: Callable[..., ForceBackend]) -> None:
        env = PathTrackingEnv(poisoned(jacobian_scale=math.nan), path="straight")
        env.reset(seed=0)
        observation, reward, terminated, truncated, info = env.step(act(0.0, 0.0))
        assert env.observation_space.contains(observation)
        assert (terminated, truncated, info["diverged"]) == (True, False, True)
        assert reward == pytest.approx(-1.0 - (5.0 / 2.0) ** 2)
        env.reset(seed=1)
