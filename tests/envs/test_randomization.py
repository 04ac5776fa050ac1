"""Domain randomization: what an episode draws, how it is distributed, and that every form of a task draws the same."""

import json
import math
import pickle
from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env as check_gymnasium

import grouser  # noqa: F401 - registers the environments
from grouser.envs import PathTrackingEnv, Randomization, SpeedTrackingEnv
from grouser.envs.randomization import DRAWN_VEHICLE_NAMES
from grouser.envs.tracking_config import tracking_config
from grouser.surrogate import Surrogate
from grouser.terrain import (
    ConfigurationError,
    Disc,
    InvalidInputError,
    Mode,
    Patch,
    RigidTerrain,
    SlopedGround,
    TerrainField,
    TrackedVehicle,
    interface,
    named,
    paint_field,
    parameter_ranges,
)

PATH, SPEED = "grouser/PathTracking-v0", "grouser/SpeedTracking-v0"
COARSE: dict[str, Any] = {"backend": "physics", "backend_options": {"cells": (2, 1)}}
VEHICLE = {"belt_time_constant": (0.5, 2.0), "belt_acceleration": (0.8, 1.25), "yaw_inertia": (0.8, 1.25)}
M113 = TrackedVehicle.preset("m113")
both_tasks = pytest.mark.parametrize("kind", [PathTrackingEnv, SpeedTrackingEnv])


class Checkered:
    """A ground that only Python knows."""

    mode: Mode = "rigid"

    def parameters_at(self, x: float, y: float) -> Any:
        return named("asphalt" if round(x + y) % 2 else "ice").parameters

    def gradient_at(self, x: float, y: float) -> tuple[float, float]:
        return 0.0, 0.0


def path_env(**settings: Any) -> PathTrackingEnv:
    return PathTrackingEnv(**(COARSE | {"path": "straight"} | settings))


def draws(count: int, seed: int = 0, **settings: Any) -> list[dict[str, float]]:
    """What `count` episodes in a row draw."""
    env = path_env(**settings)
    env.reset(seed=seed)
    return [env.reset()[1]["randomization"] for _ in range(count)]


class TestTerrain:
    @pytest.mark.parametrize("mode", ["rigid", "soil"])
    @pytest.mark.parametrize("name", ["wide", "paper"])
    def test_is_drawn_as_training_runs_are(self, name: str, mode: Mode) -> None:
        """Against the ranges' own law: medians of uniform draws are mid-range, of cubed cohesion an eighth."""
        ground = {"rigid": "asphalt", "soil": "lete-sand"}[mode]
        ranges = parameter_ranges(name, mode)
        drawn = draws(400, terrain=ground, randomize={"terrain": name})
        for column, (low, high) in enumerate(zip(ranges.low, ranges.high, strict=True)):
            values = np.array([each[interface(mode).parameter_names[column]] for each in drawn])
            assert low <= values.min() < values.max() <= high
            cubed = mode == "soil" and column == 0 and low == 0
            assert np.median((values - low) / (high - low)) == pytest.approx(0.125 if cubed else 0.5, abs=0.08)

    def test_one_of_several_grounds(self) -> None:
        grounds = ("asphalt", RigidTerrain(0.4, fr=0.05), {"mu": 0.1})
        drawn = draws(300, randomize=Randomization(terrain=grounds))
        counts = [sum(each["mu"] == mu for each in drawn) for mu in (named("asphalt").mu, 0.4, 0.1)]  # type: ignore[union-attr]
        assert sum(counts) == 300
        assert min(counts) > 70

    def test_factors_on_the_own_ground(self) -> None:
        base = named("asphalt").parameters
        mu = np.array([each["mu"] for each in draws(300, randomize={"terrain": {"mu": (0.25, 1.0)}})]) / base[0]
        assert 0.25 <= mu.min() < mu.max() <= 1.0
        assert np.median(mu) == pytest.approx(0.5, abs=0.06)  # log-uniform: the geometric mean of the ends
        assert {(each["fr"], each["k"]) for each in draws(5, randomize={"terrain": {"mu": (0.5, 1.0)}})} == {
            tuple(base[1:])
        }

    def test_factors_scale_a_field_and_what_lies_on_a_slope(self) -> None:
        field = paint_field(
            named("asphalt"), (-20.0, 140.0, -20.0, 20.0), patches=[Patch(named("ice"), Disc(0, 0, 6.0))]
        )
        env = path_env(terrain=SlopedGround(field, 0.05), randomize={"terrain": {"mu": (0.5, 0.5)}})
        env.reset(seed=0)
        drawn = env.simulator.ground
        assert isinstance(drawn, SlopedGround)
        assert isinstance(drawn.ground, TerrainField)
        assert drawn.grade == 0.05
        assert drawn.ground.parameters[..., 0] == pytest.approx(field.parameters[..., 0] / 2)

    def test_the_configured_slope_is_under_every_draw(self) -> None:
        env = path_env(grade=0.1, randomize={"terrain": "wide"})
        env.reset(seed=0)
        assert env.simulator.ground.gradient_at(0.0, 0.0) == pytest.approx((math.tan(0.1), 0.0))

    def test_the_reset_option_has_the_last_word(self) -> None:
        env = path_env(randomize={"terrain": "wide", **VEHICLE})
        _, drawn = env.reset(seed=3)
        _, given = env.reset(seed=3, options={"terrain": "ice"})
        assert [given["randomization"][name] for name in ("mu", "fr", "k")] == named("ice").parameters.tolist()
        assert all(given["randomization"][name] == drawn["randomization"][name] for name in DRAWN_VEHICLE_NAMES)


class TestVehicle:
    def test_factors_are_log_uniform_on_its_own_numbers(self) -> None:
        drawn = draws(300, randomize=VEHICLE)
        for name, (low, high) in VEHICLE.items():
            factors = np.array([each[name] for each in drawn]) / getattr(M113, name)
            assert low <= factors.min() < factors.max() <= high
            assert np.median(np.log(factors)) == pytest.approx(0.0, abs=0.12 * math.log(high / low))

    @both_tasks
    @pytest.mark.parametrize("engine", ["python", "compiled"])
    def test_an_episode_is_that_of_such_a_vehicle(self, kind: Any, engine: str) -> None:
        """Against an environment that is made for the drawn vehicle."""
        env = kind(engine=engine, randomize=VEHICLE, **COARSE)
        first, info = env.reset(seed=5)
        drawn = replace(M113, **{name: info["randomization"][name] for name in DRAWN_VEHICLE_NAMES})
        other = kind(engine=engine, vehicle=drawn, **COARSE)
        assert other.reset(seed=5)[0].tobytes() == first.tobytes()
        for _ in range(8):
            action = np.array([0.8, 0.1], np.float32)
            assert env.step(action)[0].tobytes() == other.step(action)[0].tobytes()
        assert env.simulator.get_state() == other.simulator.get_state()
        assert env.simulator.vehicle == drawn

    def test_a_slower_drive_lags(self) -> None:
        """The belt's closed form: with an unlimited rate the gap closes by e^(−t/T)."""
        settings = {"belt_time_constant": (2.0, 2.0), "belt_acceleration": (100.0, 100.0)}
        env = path_env(randomize=settings, lateral_spread=0.0)
        env.reset(seed=0, options={"speed": 0.0})
        for _ in range(5):
            env.step(np.array([0.5, 0.5], np.float32))
        target = 0.5 * M113.training_speed
        gap = math.exp(-0.5 / (2.0 * M113.belt_time_constant))
        assert env.simulator.get_state().v_left == pytest.approx(target * (1 - gap), rel=1e-6)


class TestDraws:
    @both_tasks
    def test_nothing_randomized_draws_what_was_drawn_before(self, kind: Any) -> None:
        """Starts and commands come first: the first episode of a seed begins alike with and without."""
        plain, randomized = kind(**COARSE), kind(randomize=VEHICLE | {"terrain": ("asphalt",)}, **COARSE)
        assert "randomization" not in plain.reset(seed=2)[1]
        plain.reset(seed=2)
        randomized.reset(seed=2)
        state, other = plain.simulator.get_state(), randomized.simulator.get_state()
        assert (state.x, state.y, state.heading, state.vx) == (other.x, other.y, other.heading, other.vx)

    def test_what_is_randomized_changes_no_other_draw(self) -> None:
        everything = draws(4, randomize=VEHICLE | {"terrain": "wide"})
        terrain, vehicle = draws(4, randomize={"terrain": "wide"}), draws(4, randomize=VEHICLE)
        for both, ground, drive in zip(everything, terrain, vehicle, strict=True):
            assert [both[name] for name in ("mu", "fr", "k")] == [ground[name] for name in ("mu", "fr", "k")]
            assert all(both[name] == drive[name] for name in DRAWN_VEHICLE_NAMES)

    def test_the_profile_keeps_within_what_was_drawn(self) -> None:
        """On ground without grip, a speed profile may hardly change."""
        env = SpeedTrackingEnv(randomize={"terrain": {"mu": (0.01, 0.01)}}, **COARSE)
        env.reset(seed=0)
        assert env._begun is not None
        rise = np.abs(np.diff(env._begun.profile.speed)).max()
        held = 9.81 * 0.01 * named("asphalt").parameters[0]
        assert rise <= env.config.effort * env.config.ramp_time * held

    @pytest.mark.parametrize("name", [PATH, SPEED])
    @pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
    def test_batched_is_single_to_the_bit(self, name: str, mode: str) -> None:
        options: dict[str, Any] = COARSE | {"time_limit": 0.4, "observe_terrain": True, "bank": 0.03}
        options["randomize"] = VEHICLE | {"terrain": "wide"}
        ours = gymnasium.make_vec(
            name, 3, "vector_entry_point", vector_kwargs=None, autoreset_mode=mode, threads=2, **options
        )
        theirs = gymnasium.make_vec(name, 3, "sync", vector_kwargs={"autoreset_mode": mode}, **options)
        assert_equal(ours.reset(seed=1), theirs.reset(seed=1))
        generator = np.random.default_rng(0)
        for _ in range(14):
            actions = generator.uniform(-1.0, 1.0, (3, 2)).astype(np.float32)
            assert_equal(ours.step(actions), theirs.step(actions))


def assert_equal(ours: Any, theirs: Any) -> None:
    """Assert equality to the bit, but for what a batch leaves out."""
    if isinstance(theirs, tuple):
        for mine, other in zip(ours, theirs, strict=True):
            assert_equal(mine, other)
    elif isinstance(theirs, dict):
        left_out = {f"{mask}{name}" for mask in ("", "_") for name in ("track_forces", "sprocket_power")}
        assert set(ours) == set(theirs) - left_out
        for key, value in ours.items():
            assert_equal(value, theirs[key])
    else:
        assert ours.dtype == theirs.dtype
        if ours.dtype == object:
            assert all(np.array_equal(a, b) for a, b in zip(ours, theirs, strict=True))
        else:
            assert ours.tobytes() == theirs.tobytes()


class TestCheckers:
    @pytest.fixture(params=["physics", "torch", "native", "guarded"])
    def options(self, request: pytest.FixtureRequest, make_surrogate: Callable[[Mode], Surrogate]) -> dict[str, Any]:
        backend: str = request.param
        if backend == "torch":
            pytest.importorskip("torch")
        artifact = {"cells": (2, 1)} if backend == "physics" else {"artifact": make_surrogate("rigid")}
        return {"backend": backend, "backend_options": artifact, "randomize": VEHICLE | {"terrain": "wide"}}

    @both_tasks
    def test_gymnasium(self, kind: Any, options: dict[str, Any]) -> None:
        check_gymnasium(kind(**options), skip_render_check=True)

    @both_tasks
    def test_stable_baselines(self, kind: Any, options: dict[str, Any]) -> None:
        pytest.importorskip("stable_baselines3.common.env_checker").check_env(kind(**options))


class TestRefusals:
    @pytest.mark.parametrize(
        ("settings", "message"),
        [
            ({"terain": "wide"}, "did you mean 'terrain'"),
            ({"terrain": "wid"}, "did you mean 'wide'"),
            ({"terrain": {"mew": (0.5, 1.0)}}, "did you mean 'mu'"),
            ({"terrain": ("asphalt", "lete-sand")}, "rigid ground"),
            ({"terrain": ("asfalt",)}, "did you mean 'asphalt'"),
        ],
    )
    def test_of_names(self, settings: dict[str, Any], message: str) -> None:
        with pytest.raises(ConfigurationError, match=message):
            path_env(randomize=settings)

    @pytest.mark.parametrize(
        ("settings", "message"),
        [
            ({"yaw_inertia": 0.5}, "pair 0 < low <= high"),
            ({"yaw_inertia": (1.2, 0.8)}, "pair 0 < low <= high"),
            ({"belt_time_constant": (0.0, 1.0)}, "pair 0 < low <= high"),
            ({"belt_acceleration": (math.nan, 1.0)}, "pair 0 < low <= high"),
            ({"terrain": {"mu": (0.5, 9.0)}}, r"mu must lie in \(0, 2\]"),
            ({"terrain": ()}, "at least one ground"),
            ({"terrain": 3.0}, "sequence of grounds"),
            ("wide", "a Randomization or a mapping"),
        ],
    )
    def test_of_values(self, settings: Any, message: str) -> None:
        with pytest.raises(InvalidInputError, match=message):
            path_env(randomize=settings)

    def test_a_ground_without_parameters_of_its_own_has_none_to_scale(self) -> None:
        with pytest.raises(ConfigurationError, match="not to a Checkered"):
            path_env(terrain=Checkered(), randomize={"terrain": {"mu": (0.5, 1.0)}})

    def test_a_batch_draws_compiled_grounds_alone(self) -> None:
        with pytest.raises(ConfigurationError, match="vectorization_mode='sync'"):
            gymnasium.make_vec(PATH, 2, "vector_entry_point", randomize={"terrain": ("asphalt", Checkered())}, **COARSE)


@pytest.mark.parametrize("terrain", ["wide", ("asphalt", "ice"), {"mu": (0.5, 1.2)}])
def test_a_copied_environment_draws_on(terrain: Any) -> None:
    env: Any = gymnasium.make_vec(
        PATH, 2, "vector_entry_point", randomize=VEHICLE | {"terrain": terrain}, **COARSE
    ).unwrapped
    env.reset(seed=0)
    again = pickle.loads(pickle.dumps(env))
    for _ in range(2):
        assert_equal(again.reset(), env.reset())
    actions = np.full((2, 2), 0.5, np.float32)
    assert_equal(again.step(actions), env.step(actions))


def test_settings_survive_json() -> None:
    """As a policy file keeps them."""
    terrain = (RigidTerrain(0.4), "ice")
    config = tracking_config({"randomize": Randomization(terrain=terrain, yaw_inertia=(0.8, 1.25))})
    again = tracking_config(json.loads(json.dumps(asdict(config))))
    assert path_env(randomize=again.randomize).reset(seed=4)[1] == path_env(randomize=config.randomize).reset(seed=4)[1]
