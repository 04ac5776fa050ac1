"""``grouser/PathTracking-v0``: checkers, making, seeds, actions, info, rendering."""

import math
import warnings
from collections.abc import Callable
from pathlib import Path as FilePath
from typing import Any

import gymnasium
import numpy as np
import pytest
from grounds import stepped
from gymnasium.utils.env_checker import check_env as gymnasium_check
from path_tracking import BACKENDS, GROUND, Action, MakeEnv, act, episode, tracking_maker, twin

import grouser  # noqa: F401 - registers the environment
from grouser.envs import BeltCommand, Path, PathTrackingEnv, advance_belts, make_path
from grouser.surrogate import Surrogate
from grouser.terrain import (
    ConfigurationError,
    Detection,
    FloatArray,
    ForceBackend,
    GuardedBackend,
    InvalidInputError,
    Mode,
    PhysicsBackend,
    TrackedVehicle,
    named,
    register_backend,
)

M113 = TrackedVehicle.preset("m113")
every_backend = pytest.mark.parametrize("backend", BACKENDS)


@pytest.fixture
def make_env(make_surrogate: Callable[[Mode], Surrogate]) -> MakeEnv:
    return tracking_maker(make_surrogate)


class TestCheckers:
    @every_backend
    @pytest.mark.parametrize("action_mode", ["belts", "twist"])
    @pytest.mark.parametrize("observe_terrain", [False, True])
    @pytest.mark.parametrize("mode", ["rigid", "soil"])
    def test_gymnasium(
        self, make_env: MakeEnv, backend: str, action_mode: str, observe_terrain: bool, mode: Mode
    ) -> None:
        env = make_env(backend, mode, action_mode=action_mode, observe_terrain=observe_terrain)
        gymnasium_check(env, skip_render_check=True)

    @every_backend
    @pytest.mark.parametrize("action_mode", ["belts", "twist"])
    @pytest.mark.parametrize("observe_terrain", [False, True])
    @pytest.mark.parametrize("mode", ["rigid", "soil"])
    def test_stable_baselines(
        self, make_env: MakeEnv, backend: str, action_mode: str, observe_terrain: bool, mode: Mode
    ) -> None:
        checker = pytest.importorskip("stable_baselines3.common.env_checker")
        checker.check_env(make_env(backend, mode, action_mode=action_mode, observe_terrain=observe_terrain))

    def test_gymnasium_through_the_registry(self, make_surrogate: Callable[[Mode], Surrogate]) -> None:
        options = {"artifact": make_surrogate("rigid")}
        env = gymnasium.make("grouser/PathTracking-v0", backend="native", backend_options=options)
        gymnasium_check(env.unwrapped, skip_render_check=True)

    def test_gymnasium_with_rendering(self, monkeypatch: pytest.MonkeyPatch) -> None:
        pytest.importorskip("pygame")
        monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
        env = gymnasium.make("grouser/PathTracking-v0", backend="physics", render_mode="rgb_array")
        gymnasium_check(env.unwrapped)
        env.close()


class TestMaking:
    @pytest.mark.parametrize("name", ["grouser/PathTracking-v0", "grouser:grouser/PathTracking-v0"])
    def test_by_id(self, name: str) -> None:
        env = gymnasium.make(
            name,
            backend="physics",
            vehicle="m113",
            terrain="lete-sand",
            path="iso-3888-1",
            action_mode="belts",
            control_period=0.1,
        )
        observation, _ = env.reset(seed=1)
        assert observation in env.observation_space
        observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
        assert observation in env.observation_space
        assert isinstance(reward, float)
        assert (terminated, truncated) == (False, False)
        assert info["force"].shape == (3,)
        assert isinstance(env.unwrapped, PathTrackingEnv)
        env.close()

    def test_registering_twice_changes_nothing(self) -> None:
        from grouser.envs import register_environments

        before = gymnasium.registry["grouser/PathTracking-v0"]
        register_environments()
        assert gymnasium.registry["grouser/PathTracking-v0"] is before

    def test_a_backend_of_ones_own(self, viscous: Callable[..., ForceBackend]) -> None:
        backend = viscous(rate=2.0, follow_belts=True)
        env = gymnasium.make("grouser/PathTracking-v0", backend=backend, path="straight")
        env.reset(seed=0)
        _, _, _, _, info = env.step(act(0.5, 0.5))
        assert info["backend"] == "viscous"
        assert "track_forces" not in info
        assert "sprocket_power" not in info

    def test_a_registered_backend_of_ones_own(self, viscous: Callable[..., ForceBackend]) -> None:
        register_backend("viscous-for-tracking", lambda vehicle, mode, **options: viscous(vehicle, mode, **options))
        env = PathTrackingEnv("viscous-for-tracking", path="straight", backend_options={"rate": 3.0})
        env.reset(seed=0)
        assert env.step(act(0.5, 0.5))[4]["backend"] == "viscous"

    @pytest.mark.parametrize("vehicle", ["marder", "ugv", "maxxii"])
    def test_every_vehicle(self, vehicle: str) -> None:
        env = PathTrackingEnv("physics", vehicle)
        env.reset(seed=0)
        for _ in range(5):
            observation, reward, _, _, _ = env.step(act(0.5, 0.5))
            assert observation in env.observation_space
            assert math.isfinite(reward)

    def test_paths_and_grounds_as_objects(self) -> None:
        path = Path.from_points("mine", [[0.0, 0.0], [10.0, 0.0], [20.0, 2.0]])
        ground = stepped(named("asphalt"), named("ice"), 3.0)
        env = PathTrackingEnv("physics", M113, ground, path, observe_terrain=True)
        assert env.path is path
        env.reset(seed=0, options={"speed": 5.0})
        thetas = [env.step(act(0.5, 0.5))[0][19:].tolist() for _ in range(10)]
        assert len({tuple(theta) for theta in thetas}) == 2

    def test_a_path_from_a_file(self, tmp_path: FilePath) -> None:
        file = tmp_path / "mine.csv"
        file.write_text("x,y\n0,0\n10,0\n20,2\n", encoding="utf-8")
        assert PathTrackingEnv("physics", path=str(file)).path.length == pytest.approx(20.2, abs=0.1)

    @pytest.mark.parametrize(
        ("settings", "nearest"),
        [
            ({"backend": "pysics"}, "physics"),
            ({"vehicle": "m131"}, "m113"),
            ({"terrain": "asphal"}, "asphalt"),
            ({"path": "figure-eigth"}, "figure-eight"),
            ({"control_perod": 0.1}, "control_period"),
            ({"action_mode": "belt"}, "belts"),
            ({"integrator": "sdirk"}, "sdirk2"),
            ({"render_mode": "rgb"}, "rgb_array"),
        ],
    )
    def test_unknown_names_come_with_the_nearest(self, settings: dict[str, Any], nearest: str) -> None:
        with pytest.raises(ConfigurationError, match=f"did you mean '{nearest}'"):
            PathTrackingEnv(**({"backend": "physics"} | settings))

    def test_a_backend_option_that_the_backend_does_not_take(self) -> None:
        with pytest.raises(ConfigurationError, match="cels"):
            PathTrackingEnv("physics", backend_options={"cels": (2, 1)})

    def test_a_backend_of_another_mode_or_vehicle(self) -> None:
        with pytest.raises(ConfigurationError, match="rigid"):
            PathTrackingEnv(PhysicsBackend(M113, "rigid"), terrain="lete-sand")
        with pytest.raises(ConfigurationError, match="m113"):
            PathTrackingEnv(PhysicsBackend(M113, "rigid"), "ugv")


class TestSpaces:
    @pytest.mark.parametrize(
        ("mode", "observe_terrain", "size"),
        [("rigid", False, 19), ("soil", False, 19), ("rigid", True, 22), ("soil", True, 23)],
    )
    def test_are_boxes_of_float32(self, make_env: MakeEnv, mode: Mode, observe_terrain: bool, size: int) -> None:
        env = make_env(mode=mode, observe_terrain=observe_terrain)
        assert env.action_space == gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)
        assert env.observation_space == gymnasium.spaces.Box(-10.0, 10.0, (size,), np.float32)
        observation, _ = env.reset(seed=0)
        assert observation.dtype == np.float32
        assert observation.shape == (size,)


class TestSeeds:
    @every_backend
    @pytest.mark.parametrize("mode", ["rigid", "soil"])
    def test_equal_seeds_give_equal_episodes(self, make_env: MakeEnv, backend: str, mode: Mode) -> None:
        env = make_env(backend, mode)
        first = episode(env, 3)
        assert episode(env, 3) == first
        assert episode(make_env(backend, mode), 3) == first

    @every_backend
    def test_different_seeds_differ(self, make_env: MakeEnv, backend: str) -> None:
        env = make_env(backend)
        traces = [episode(env, seed, steps=3) for seed in (1, 2, 3)]
        for index in range(3):
            assert len({repr(trace[index + 1]) for trace in traces}) == 3

    def test_an_unseeded_reset_goes_on_drawing(self, make_env: MakeEnv) -> None:
        env, other = make_env(), make_env()
        env.reset(seed=4)
        other.reset(seed=4)
        follow_ups = [env.reset()[0].tobytes() for _ in range(3)]
        assert [other.reset()[0].tobytes() for _ in range(3)] == follow_ups
        assert len(set(follow_ups)) == 3

    def test_a_former_episode_leaves_no_trace(self, make_env: MakeEnv) -> None:
        env = make_env()
        episode(env, 1, steps=7, terrain="ice", arc_length=20.0)
        assert episode(env, 2) == episode(make_env(), 2)


class TestActions:
    @pytest.mark.parametrize(
        "action",
        [
            [math.nan, 0.0],
            [0.0, math.nan],
            [math.inf, 0.0],
            [1.001, 0.0],
            [0.0, -1.001],
            [0.0],
            [0.0, 0.0, 0.0],
            [[0.0, 0.0]],
            0.5,
        ],
    )
    @pytest.mark.parametrize("action_mode", ["belts", "twist"])
    def test_what_is_not_in_the_box_is_refused(self, make_env: MakeEnv, action: Any, action_mode: str) -> None:
        env = make_env(action_mode=action_mode)
        env.reset(seed=0)
        before = env.simulator.get_state()
        with pytest.raises(InvalidInputError, match=r"two numbers in \[-1, 1\]"):
            env.step(np.array(action, dtype=np.float32))
        assert env.simulator.get_state() == before

    @staticmethod
    def assert_belts(env: PathTrackingEnv, action: Action, expected: tuple[float, float]) -> None:
        """The belts after one control period are those that the expected command leads to."""
        # From a speed near the command the lag is not rate-limited, and shows the very command.
        env.reset(options={"speed": min(max(sum(expected) / 2, 0.0), 5.0)})
        before = env.simulator.get_state()
        env.step(action)
        after = env.simulator.get_state()
        belts = advance_belts(env.vehicle, (before.v_left, before.v_right), BeltCommand(*expected), 0.1)
        assert (after.v_left, after.v_right) == pytest.approx(belts, abs=1e-9)

    @pytest.mark.parametrize(("left", "right"), [(0.375, 0.4375), (0.5, 0.25), (1.0, -1.0), (0.0, 0.0)])
    def test_belts(self, make_env: MakeEnv, left: float, right: float) -> None:
        self.assert_belts(make_env(), act(left, right), (10.0 * left, 10.0 * right))

    @pytest.mark.parametrize("yaw_rate_scale", [0.25, 1.0])
    @pytest.mark.parametrize(("speed", "turn"), [(0.375, 0.25), (0.375, -0.25), (0.4375, 0.0), (0.25, 1.0)])
    def test_twist(self, make_env: MakeEnv, speed: float, turn: float, yaw_rate_scale: float) -> None:
        env = make_env(action_mode="twist", yaw_rate_scale=yaw_rate_scale)
        half = yaw_rate_scale * turn * M113.tread / 2
        self.assert_belts(env, act(speed, turn), (10.0 * speed - half, 10.0 * speed + half))

    def test_a_twist_saturates_at_the_training_speed(self, viscous: Callable[..., ForceBackend]) -> None:
        env = PathTrackingEnv(viscous(follow_belts=True), path="straight", action_mode="twist", maximum_cross_track=1e4)
        for action, expected in (
            (act(1.0, 1.0), (10.0 - M113.tread / 2, 10.0)),
            (act(-1.0, 1.0), (-10.0, -10.0 + M113.tread / 2)),
            (act(1.0, -1.0), (10.0, 10.0 - M113.tread / 2)),
        ):
            env.reset(seed=0)
            for _ in range(80):
                env.step(action)
            state = env.simulator.get_state()
            assert (state.v_left, state.v_right) == pytest.approx(expected, abs=1e-3)

    def test_a_positive_twist_turns_left(self, make_env: MakeEnv) -> None:
        env = make_env(action_mode="twist", path="straight")
        env.reset(seed=0, options={"heading_offset": 0.0})
        for _ in range(10):
            env.step(act(0.3, 0.5))
        assert env.simulator.get_state().heading > 0.1
        assert env.simulator.get_state().yaw_rate > 0.1

    @pytest.mark.parametrize(("period", "ticks"), [(0.05, 5), (0.1, 10), (0.5, 50)])
    def test_is_held_for_one_control_period(self, make_env: MakeEnv, period: float, ticks: int) -> None:
        env = make_env(control_period=period)
        env.reset(seed=0)
        other = twin(env, env.simulator.get_state(), BeltCommand(2.5, 5.0), ticks)
        env.step(act(0.25, 0.5))
        assert other.state == env.simulator.get_state()


class FlagIce:
    """Flags slippery rows."""

    def score(self, x: FloatArray) -> FloatArray:
        return np.where(np.atleast_2d(x)[:, 7] < 0.3, 3.0, 0.25)

    def detect(self, row: FloatArray) -> Detection:
        score = float(self.score(row)[0])
        return Detection(score, "box" if score > 1 else "none", "mu")


class TestInfo:
    @pytest.mark.parametrize("mode", ["rigid", "soil"])
    def test_physics_knows_the_tracks_apart(self, make_env: MakeEnv, mode: Mode) -> None:
        env = make_env("physics", mode)
        env.reset(seed=0)
        before = env.simulator.get_state()
        _, _, _, _, info = env.step(act(0.25, 0.75))
        assert info["force"].tobytes() == twin(env, before, BeltCommand(2.5, 7.5)).forces.tobytes()
        assert info["backend"] == "physics"
        assert info["track_forces"].shape == (2, 3)
        assert info["track_forces"].sum(axis=0) == pytest.approx(info["force"], rel=1e-9, abs=1e-6)
        assert "ood_score" not in info
        assert "fallback_weight" not in info

    @pytest.mark.parametrize("mode", ["rigid", "soil"])
    def test_steady_driving_takes_the_power_of_rolling_resistance(self, make_env: MakeEnv, mode: Mode) -> None:
        env = make_env("physics", mode, path="straight")
        env.reset(seed=0, options={"lateral_offset": 0.0, "heading_offset": 0.0, "speed": 5.0})
        for _ in range(30):
            info = env.step(act(0.5, 0.5))[4]
        rolling = named(GROUND[mode]).fr * M113.weight * 5.0
        # Slip adds its own share: the belts run faster than the vehicle.
        assert info["sprocket_power"] == pytest.approx(rolling, rel=2e-3)

    @pytest.mark.parametrize("backend", ["torch", "native"])
    def test_a_plain_network_does_not(self, make_env: MakeEnv, backend: str) -> None:
        env = make_env(backend)
        env.reset(seed=0)
        info = env.step(act(0.25, 0.75))[4]
        assert info["backend"] == backend
        assert info["force"].shape == (3,)
        assert not {"track_forces", "sprocket_power", "ood_score", "fallback_weight"} & set(info)

    def test_force_is_a_copy(self, make_env: MakeEnv) -> None:
        env, other = make_env(), make_env()
        for each in (env, other):
            each.reset(seed=0)
        for _ in range(3):
            info = env.step(act(0.25, 0.75))[4]
            assert info["force"].tobytes() == other.step(act(0.25, 0.75))[4]["force"].tobytes()
            info["force"][:] = np.nan

    def test_a_guard_tells_who_answered(self, viscous: Callable[..., ForceBackend]) -> None:
        backend = GuardedBackend(viscous(follow_belts=True), PhysicsBackend(M113, "rigid"), FlagIce())
        env = PathTrackingEnv(backend, M113, stepped(named("asphalt"), named("ice"), 1.5), "straight")
        env.reset(seed=0, options={"speed": 5.0})
        seen = []
        for _ in range(6):
            info = env.step(act(0.5, 0.5))[4]
            seen.append((info["backend"], info["ood_score"], info["fallback_weight"]))
        assert seen[0] == ("viscous", 0.25, 0.0)
        assert seen[-1] == ("physics", 3.0, 1.0)

    def test_the_guarded_surrogate(self, make_env: MakeEnv) -> None:
        env = make_env("guarded")
        env.reset(seed=0)
        for _ in range(10):
            info = env.step(act(0.5, 0.75))[4]
            assert info["backend"] in ("native", "physics")
            if info["fallback_weight"] in (0.0, 1.0):
                assert info["backend"] == ("physics" if info["fallback_weight"] else "native")
            assert info["ood_score"] > 0.0

    def test_a_reset_starts_with_a_fresh_guard(self, viscous: Callable[..., ForceBackend]) -> None:
        backend = GuardedBackend(viscous(follow_belts=True), PhysicsBackend(M113, "rigid"), FlagIce())
        env = PathTrackingEnv(backend, M113, "asphalt", "straight")
        env.reset(seed=0, options={"terrain": "ice"})
        assert env.step(act(0.5, 0.5))[4]["backend"] == "physics"
        env.reset(seed=0)
        assert env.simulator.get_state().guard.fallback_weight == 0.0
        assert env.step(act(0.5, 0.5))[4]["backend"] == "viscous"


class TestRendering:
    def test_rgb_array(self, make_env: MakeEnv) -> None:
        pytest.importorskip("pygame")
        env = make_env(render_mode="rgb_array")
        env.reset(seed=0)
        first = env.render()
        assert first is not None
        assert first.dtype == np.uint8
        assert first.ndim == 3
        assert first.shape[2] == 3
        for _ in range(5):
            env.step(act(0.5, 0.5))
        second = env.render()
        assert second is not None
        assert second.shape == first.shape
        assert (first != second).any()
        env.close()
        env.close()

    def test_the_frame_rate_is_that_of_control(self, make_env: MakeEnv) -> None:
        assert PathTrackingEnv.metadata["render_modes"] == ["rgb_array", "human"]
        assert make_env().metadata["render_fps"] == 10
        assert make_env(control_period=0.05).metadata["render_fps"] == 20
        assert PathTrackingEnv.metadata["render_fps"] == 10

    def test_without_a_mode_it_warns_and_shows_nothing(self, make_env: MakeEnv) -> None:
        env = make_env()
        env.reset(seed=0)
        with pytest.warns(UserWarning, match="render_mode"):
            assert env.render() is None

    def test_rendering_does_not_change_the_episode(self, make_env: MakeEnv) -> None:
        pytest.importorskip("pygame")
        env, other = make_env(render_mode="rgb_array"), make_env()
        for each in (env, other):
            each.reset(seed=0)
        for _ in range(3):
            env.render()
            assert env.step(act(0.5, 0.25))[0].tobytes() == other.step(act(0.5, 0.25))[0].tobytes()
        env.close()


def test_making_and_stepping_warns_of_nothing(make_env: MakeEnv) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        episode(make_env("guarded"), 0)


def test_the_double_lane_change_can_be_driven(make_env: MakeEnv) -> None:
    """A crude follower by the observation alone gets to the end on every ground."""
    for mode in ("rigid", "soil"):
        env = make_env("physics", mode, action_mode="twist")
        observation, _ = env.reset(seed=0)
        total = 0.0
        for _ in range(400):
            turn = 1.2 * math.atan2(float(observation[10]), float(observation[9]))
            observation, reward, terminated, truncated, info = env.step(act(0.5, min(max(turn, -1.0), 1.0)))
            total += reward
            if terminated or truncated:
                break
        assert terminated
        assert info["progress"] >= make_path("iso-3888-1", M113).length - 1.0
        assert total > 100.0
