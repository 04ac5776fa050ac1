"""Vector environments: each sub-environment is the single one to the bit; autoreset, threads, bad input."""

import copy
import math
import pickle
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from numpy.typing import NDArray

import grouser  # noqa: F401 - registers the environments
from grouser.envs import PathTrackingEnv, SpeedTrackingEnv
from grouser.envs.vector import PathTrackingVectorEnv, SpeedTrackingVectorEnv
from grouser.surrogate import Surrogate
from grouser.terrain import (
    ConfigurationError,
    Disc,
    ForceBackend,
    InvalidInputError,
    Mode,
    Patch,
    TerrainField,
    named,
    paint_field,
)

PATH, SPEED = "grouser/PathTracking-v0", "grouser/SpeedTracking-v0"
COARSE: dict[str, Any] = {"backend": "physics", "backend_options": {"cells": (2, 1)}}
both_tasks = pytest.mark.parametrize("name", [PATH, SPEED])
both_modes = pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
#: Of the single environment's info, what the batched one leaves out unless asked for.
LEFT_OUT = frozenset(f"{mask}{name}" for mask in ("", "_") for name in ("track_forces", "sprocket_power"))


class Checkered:
    """A ground that only Python knows."""

    mode: Mode = "rigid"

    def parameters_at(self, x: float, y: float) -> NDArray[np.float64]:
        return named("asphalt" if round(x + y) % 2 else "ice").parameters

    def gradient_at(self, x: float, y: float) -> tuple[float, float]:
        return 0.0, 0.0


def make(name: str, count: int = 3, **options: Any) -> Any:
    return gymnasium.make_vec(name, num_envs=count, vectorization_mode="vector_entry_point", **(COARSE | options))


def actions(count: int, steps: int, seed: int = 0) -> NDArray[np.float32]:
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (steps, count, 2)).astype(np.float32)


def assert_equal(ours: Any, theirs: Any, left_out: frozenset[str] = LEFT_OUT) -> None:
    """Assert that two infos are equal to the bit, but for what is left out."""
    if isinstance(theirs, dict):
        assert set(ours) == set(theirs) - left_out
        for key, value in ours.items():
            assert_equal(value, theirs[key], left_out)
    elif theirs.dtype == object:
        assert len(ours) == len(theirs)
        assert all(np.array_equal(a, b) for a, b in zip(ours, theirs, strict=True))
    else:
        assert ours.dtype == theirs.dtype
        assert np.array_equal(ours, theirs)


def assert_same_drives(ours: Any, theirs: Any, steps: int, seed: int = 5, left_out: frozenset[str] = LEFT_OUT) -> int:
    """Drive two vector environments side by side and return how many episodes ended."""
    (observations, infos), (expected, expected_infos) = ours.reset(seed=seed), theirs.reset(seed=seed)
    assert observations.tobytes() == expected.tobytes()
    assert_equal(infos, expected_infos, left_out)
    ended = 0
    for action in actions(ours.num_envs, steps):
        outcome, reference = ours.step(action), theirs.step(action)
        for part, wanted in zip(outcome[:4], reference[:4], strict=True):
            assert part.dtype == wanted.dtype
            assert part.tobytes() == wanted.tobytes()
        assert_equal(outcome[4], reference[4], left_out)
        ended += int((outcome[2] | outcome[3]).sum())
    return ended


class TestEqualsSingleEnvironments:
    @both_tasks
    @both_modes
    @pytest.mark.parametrize("backend", ["physics", "native", "guarded"])
    def test_episode_after_episode(
        self, make_surrogate: Callable[[Mode], Surrogate], name: str, mode: str, backend: str
    ) -> None:
        options: dict[str, Any] = {"backend": backend, "time_limit": 0.6, "terrain": "asphalt"}
        if backend == "physics":
            options |= COARSE | {"observe_terrain": True, "grade": 0.1}
        else:
            options["backend_options"] = {"artifact": make_surrogate("rigid")}
        ours = make(name, 3, threads=2, autoreset_mode=mode, **options)
        theirs = gymnasium.make_vec(
            name, num_envs=3, vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode}, **options
        )
        assert isinstance(theirs, SyncVectorEnv)
        assert assert_same_drives(ours, theirs, steps=22) >= 9

    @both_modes
    def test_where_the_map_ends(self, mode: str) -> None:
        """Sub-environments end alone, and at different times."""
        field = TerrainField("rigid", (-2.0, -2.0), 0.5, np.tile(named("asphalt").parameters, (8, 8, 1)))
        options = COARSE | {"terrain": field, "observe_terrain": True}
        theirs = gymnasium.make_vec(
            SPEED, num_envs=4, vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode}, **options
        )
        assert assert_same_drives(make(SPEED, 4, autoreset_mode=mode, **options), theirs, steps=60) >= 4

    @pytest.mark.parametrize("sampling", ["vehicle", "tracks"])
    def test_on_ground_that_changes(self, sampling: str) -> None:
        patch = Patch(named("ice"), Disc(8.0, 1.0, 6.0))
        field = paint_field(named("asphalt"), (-20.0, 160.0, -20.0, 25.0), spacing=1.0, patches=[patch])
        options = COARSE | {"terrain": field, "ground_sampling": sampling, "bank": 0.05}
        theirs = gymnasium.make_vec(PATH, num_envs=2, vectorization_mode="sync", **options)
        assert_same_drives(make(PATH, 2, **options), theirs, steps=20)

    @both_modes
    @pytest.mark.parametrize(
        "backend", [COARSE, {"backend": "native", "backend_options": None}], ids=["physics", "native"]
    )
    @pytest.mark.parametrize("sampling", ["vehicle", "tracks"])
    def test_track_forces_where_asked_for(self, sampling: str, backend: dict[str, Any], mode: str) -> None:
        patch = Patch(named("ice"), Disc(8.0, 1.0, 6.0))
        field = paint_field(named("asphalt"), (-20.0, 160.0, -20.0, 25.0), spacing=1.0, patches=[patch])
        options = backend | {"terrain": field, "ground_sampling": sampling, "bank": 0.05, "time_limit": 0.5}
        theirs = gymnasium.make_vec(
            PATH, num_envs=3, vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode}, **options
        )
        ours = make(PATH, 3, autoreset_mode=mode, track_forces=True, **options)
        assert assert_same_drives(ours, theirs, steps=12, left_out=frozenset()) >= 3

    def test_track_forces_of_a_backend_that_knows_none_are_refused(self) -> None:
        with pytest.raises(ConfigurationError, match="has_track_forces"):
            make(PATH, backend="guarded", backend_options=None, track_forces=True)

    @both_tasks
    @pytest.mark.parametrize("mode", ["rigid", "soil"])
    def test_the_python_tick_agrees(self, name: str, mode: Mode) -> None:
        kind: Any = {PATH: PathTrackingEnv, SPEED: SpeedTrackingEnv}[name]
        options = COARSE | {
            "terrain": {"rigid": "asphalt", "soil": "lete-sand"}[mode],
            "observe_terrain": True,
            "action_mode": "twist",
            "grade": 0.05,
        }
        ours, reference = kind(engine="compiled", **options), kind(engine="python", **options)
        assert ours.reset(seed=1)[0] == pytest.approx(reference.reset(seed=1)[0], abs=1e-6)
        for action in actions(1, 60)[:, 0]:
            given, expected = (env.step((0.3, 0.3) * action + (0.5, 0.0)) for env in (ours, reference))
            assert given[0] == pytest.approx(expected[0], abs=1e-6)
            assert given[1] == pytest.approx(expected[1], abs=1e-9)
            assert given[2:4] == expected[2:4]
            assert set(given[4]) == set(expected[4])
            # A residual of 1e-11 m/s at a stiffness of 2.6e4 /s moves the force of 11 t by millinewtons.
            assert given[4]["force"] == pytest.approx(expected[4]["force"], rel=1e-9, abs=0.05)
            state, wanted = ours.simulator.get_state(), reference.simulator.get_state()
            for part in ("x", "y", "heading", "vx", "vy", "yaw_rate", "ax"):
                assert getattr(state, part) == pytest.approx(getattr(wanted, part), abs=1e-9)
            if given[2]:
                break


class TestFallBack:
    def test_a_ground_that_only_python_knows(self) -> None:
        env, reference = PathTrackingEnv(terrain=Checkered(), **COARSE), PathTrackingEnv(engine="python", **COARSE)
        env.reset(seed=0)
        assert env.step(actions(1, 1)[0, 0])[4]["force"].shape == (3,)
        # And for one episode of an environment that is otherwise compiled.
        env = PathTrackingEnv(**COARSE)
        for each in (env, reference):
            each.reset(seed=0, options={"terrain": Checkered()})
        for action in actions(1, 5)[:, 0]:
            outcome, expected = env.step(action), reference.step(action)
            assert outcome[0].tobytes() == expected[0].tobytes()
            assert repr(outcome[1:]) == repr(expected[1:])
        first, again = (env.reset(seed=3)[0].tobytes() for _ in range(2))
        assert first == again
        with pytest.raises(ConfigurationError, match="compiled"):
            PathTrackingEnv(engine="compiled", terrain=Checkered(), **COARSE)


class TestThreads:
    @both_tasks
    def test_do_not_change_a_bit(self, name: str) -> None:
        traces = []
        for threads in (1, 2, 3):
            env = make(name, 70, threads=threads, time_limit=0.4)
            trace = [env.reset(seed=1)[0].tobytes()]
            for action in actions(70, 7):
                observations, rewards, *_ = env.step(action)
                trace += [observations.tobytes(), rewards.tobytes()]
            traces.append(trace)
        assert traces[0] == traces[1] == traces[2]

    def test_neighbours_do_not_either(self) -> None:
        crowd, alone = make(PATH, 33), make(PATH, 1)
        crowd.reset(seed=10)
        alone.reset(seed=42)
        for action in actions(33, 10):
            assert crowd.step(action)[0][32].tobytes() == alone.step(action[32:])[0][0].tobytes()


class TestSeeds:
    def test_a_number_a_list_and_none(self) -> None:
        env = make(PATH, 3)
        by_number = env.reset(seed=7)[0]
        assert env.np_random_seed == (7, 8, 9)
        assert len(env.np_random) == 3
        assert env.reset(seed=[7, 8, 9])[0].tobytes() == by_number.tobytes()
        after = env.reset()[0]
        assert after.tobytes() != by_number.tobytes()
        env.reset(seed=7)
        assert env.reset()[0].tobytes() == after.tobytes()
        with pytest.raises(InvalidInputError, match="seed"):
            env.reset(seed=[1, 2])

    def test_unseeded_environments_differ(self) -> None:
        observations, _ = make(PATH, 4).reset()
        assert len({row.tobytes() for row in observations}) == 4

    def test_some_alone(self) -> None:
        env = make(PATH, 3)
        env.reset(seed=7)
        moved = env.step(actions(3, 1)[0])[0]
        mask = np.array([False, True, False])
        observations, infos = env.reset(seed=7, options={"reset_mask": mask})
        assert observations[[0, 2]].tobytes() == moved[[0, 2]].tobytes()
        assert observations[1].tobytes() == env.reset(seed=7)[0][1].tobytes()
        assert infos["_progress"].tolist() == mask.tolist()
        for wrong in ([True] * 3, np.ones(2, bool), np.ones(3), np.zeros(3, bool)):
            with pytest.raises(InvalidInputError, match="reset_mask"):
                env.reset(options={"reset_mask": wrong})

    def test_options_are_those_of_the_single_environment(self) -> None:
        env = make(PATH, 2, path="straight")
        _, infos = env.reset(seed=0, options={"lateral_offset": 0.75, "terrain": "ice"})
        assert infos["cross_track_error"] == pytest.approx([0.75, 0.75])
        assert env.batch.fleet.ground(1) == named("ice")
        env.reset(seed=0)
        assert env.batch.fleet.ground(1) == named("asphalt")
        with pytest.raises(ConfigurationError, match="did you mean 'speed'"):
            env.reset(options={"sped": 1.0})


class TestAutoreset:
    def test_the_mode_is_declared(self) -> None:
        assert make(PATH).metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
        for mode in ("SameStep", "SAME_STEP", AutoresetMode.SAME_STEP):
            assert make(PATH, autoreset_mode=mode).metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
        for mode in ("NextStp", AutoresetMode.DISABLED):
            with pytest.raises(ConfigurationError, match="autoreset mode"):
                make(PATH, autoreset_mode=mode)

    def test_one_lost_vehicle_of_a_thousand(self) -> None:
        env, other = (make(PATH, 1000, time_limit=1.0) for _ in range(2))
        for each in (env, other):
            each.reset(seed=0)
        env.batch.fleet.numbers[3, 417] = math.nan
        rest = np.arange(1000) != 417
        for step, action in enumerate(actions(1000, 3)):
            observations, rewards, terminations, _, infos = env.step(action)
            expected = other.step(action)
            assert observations[rest].tobytes() == expected[0][rest].tobytes()
            assert rewards[rest].tobytes() == expected[1][rest].tobytes()
            assert env.observation_space.contains(observations)
            if step == 0:
                assert terminations.nonzero()[0].tolist() == [417]
                assert infos["diverged"].nonzero()[0].tolist() == [417]
                assert rewards[417] == -1.0 - 2.5**2
                assert not infos["_force"][417]
            else:
                assert not terminations.any()
                assert "diverged" not in infos
        assert np.isfinite(env.batch.fleet.numbers).all()

    def test_what_is_returned_is_ones_own(self) -> None:
        env = make(PATH, 2, time_limit=0.2, autoreset_mode="SameStep")
        first = env.reset(seed=0)[0]
        kept = first.copy()
        outcomes = [env.step(action) for action in actions(2, 4)]
        assert first.tobytes() == kept.tobytes()
        assert len({outcome[0].tobytes() for outcome in outcomes}) == 4
        assert [outcome[3].tolist() for outcome in outcomes] == [[False] * 2, [True] * 2] * 2
        final = outcomes[1][4]["final_obs"]
        assert final[0].tobytes() != outcomes[1][0][0].tobytes()
        assert final[0].tobytes() != outcomes[3][4]["final_obs"][0].tobytes()


class TestBadInput:
    @pytest.mark.parametrize("count", [0, -1, 1.5, True])
    def test_numbers_of_environments(self, count: Any) -> None:
        with pytest.raises(InvalidInputError, match="num_envs"):
            PathTrackingVectorEnv(count, **COARSE)

    @pytest.mark.parametrize("threads", [0, -1, 1.5, 1000])
    def test_numbers_of_threads(self, threads: Any) -> None:
        with pytest.raises(InvalidInputError, match="threads"):
            SpeedTrackingVectorEnv(2, threads=threads, **COARSE)

    def test_names_come_with_the_nearest(self) -> None:
        with pytest.raises(ConfigurationError, match="did you mean 'control_period'"):
            make(PATH, control_perod=0.1)
        with pytest.raises(ConfigurationError, match="did you mean 'physics'"):
            make(SPEED, backend="pysics", backend_options=None)

    def test_a_backend_that_is_not_compiled(self, viscous: Callable[..., ForceBackend]) -> None:
        with pytest.raises(ConfigurationError, match=r"compiled.*vectorization_mode='sync'"):
            PathTrackingVectorEnv(2, viscous())
        with pytest.raises(ConfigurationError, match=r"TerrainField.*vectorization_mode='sync'"):
            make(SPEED, terrain=Checkered())

    @pytest.mark.parametrize(
        "wrong",
        [
            np.zeros((2, 2)),
            np.zeros((3, 3)),
            np.zeros(6),
            np.full((3, 2), "a"),
            np.array([[0.0, 0.0], [0.0, math.nan], [0.0, 0.0]]),
            np.array([[0.0, 0.0], [0.0, 0.0], [1.001, 0.0]]),
        ],
    )
    def test_actions(self, wrong: Any) -> None:
        env, other = make(PATH, 3), make(PATH, 3)
        for each in (env, other):
            each.reset(seed=0)
        with pytest.raises(InvalidInputError, match=r"numbers .*\[-1, 1\]"):
            env.step(wrong)
        # Nothing has moved.
        good = actions(3, 1)[0]
        assert env.step(good)[0].tobytes() == other.step(good)[0].tobytes()

    def test_a_step_before_the_first_reset(self) -> None:
        env = make(SPEED, 2)
        with pytest.raises(gymnasium.error.ResetNeeded):
            env.step(actions(2, 1)[0])
        env.reset(options={"reset_mask": np.array([True, False])})
        with pytest.raises(gymnasium.error.ResetNeeded):
            env.step(actions(2, 1)[0])

    def test_actions_of_environments_that_reset_are_ignored(self) -> None:
        env = make(PATH, 2, time_limit=0.1)
        env.reset(seed=0)
        assert env.step(np.zeros((2, 2), np.float32))[3].all()
        observations, rewards, _, truncations, _ = env.step(np.full((2, 2), math.nan))
        assert env.observation_space.contains(observations)
        assert (rewards.tolist(), truncations.tolist()) == ([0.0, 0.0], [False, False])


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_gymnasiums_wrappers_count_its_episodes(mode: str) -> None:
    env = gymnasium.wrappers.vector.RecordEpisodeStatistics(make(SPEED, 3, time_limit=0.5, autoreset_mode=mode))
    env.reset(seed=0)
    lengths, total = [], np.zeros(3)
    for action in actions(3, 5):
        _, rewards, _, truncations, infos = env.step(action)
        total += rewards
        if truncations.any():
            episode = infos["episode"] if "episode" in infos else infos["final_info"]["episode"]
            lengths += episode["l"].tolist()
            assert episode["r"] == pytest.approx(total)
    assert lengths == [5, 5, 5]


class TestCopies:
    @both_tasks
    @pytest.mark.parametrize("backend", ["physics", "guarded"])
    @pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
    def test_go_on_where_the_original_is(
        self, make_surrogate: Callable[[Mode], Surrogate], name: str, backend: str, copied: Callable[[Any], Any]
    ) -> None:
        options = {"backend": backend, "time_limit": 1.0, "terrain": "asphalt", "observe_terrain": True}
        if backend == "guarded":
            options["backend_options"] = {"artifact": make_surrogate("rigid")}
        for env in (make(name, 3, **COARSE | options), gymnasium.make(name, **COARSE | options).unwrapped):
            env.reset(seed=1)
            drive = actions(3, 14) if env.action_space.shape == (3, 2) else actions(1, 14)[:, 0]
            for action in drive[:5]:
                env.step(action)
            twin = copied(env)
            for action in drive[5:]:
                outcome, expected = twin.step(action), env.step(action)
                assert outcome[0].tobytes() == expected[0].tobytes()
                assert np.all(outcome[1] == expected[1])
                assert repr(outcome[2:]) == repr(expected[2:])
                if not isinstance(env, gymnasium.vector.VectorEnv) and outcome[3]:
                    assert twin.reset()[0].tobytes() == env.reset()[0].tobytes()


class TestFrames:
    def test_are_those_of_single_environments(self) -> None:
        pytest.importorskip("pygame")
        options: dict[str, Any] = COARSE | {"render_mode": "rgb_array"}
        ours = make(SPEED, 2, **options)
        theirs: Any = gymnasium.make_vec(SPEED, 2, "sync", **options)
        for env in (ours, theirs):
            env.reset(seed=0)
            env.step(actions(2, 1)[0])
        frames, expected = ours.render(), theirs.render()
        assert np.array_equal(np.stack(frames), np.stack(expected))
        ours.close()

    def test_of_the_first_few(self) -> None:
        pytest.importorskip("pygame")
        env = make(PATH, 3, render_mode="rgb_array", rendered_envs=1)
        env.reset(seed=0)
        assert [frame.shape for frame in env.render()] == [(540, 960, 3)]

    def test_a_window_is_for_single_environments(self) -> None:
        with pytest.raises(ConfigurationError, match="render mode of a vector environment"):
            make(PATH, 2, render_mode="human")

    @pytest.mark.parametrize("count", [0, 4, 1.5, True])
    def test_of_more_than_there_are(self, count: Any) -> None:
        with pytest.raises(InvalidInputError, match="rendered_envs"):
            make(PATH, 3, render_mode="rgb_array", rendered_envs=count)
