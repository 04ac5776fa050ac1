"""Noise and delay: what they do, and that a wrapped batch is a batch of wrapped environments."""

import math
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from hypothesis import given, settings
from hypothesis import strategies as st

import grouser  # noqa: F401 - registers the environments
from grouser.envs import ActionDelay, ObservationNoise, VectorActionDelay, VectorObservationNoise
from grouser.envs.disturbances import DelayLine
from grouser.terrain import ConfigurationError, InvalidInputError

PATH, SPEED = "grouser/PathTracking-v0", "grouser/SpeedTracking-v0"
COARSE: dict[str, Any] = {"backend": "physics", "backend_options": {"cells": (2, 1)}}
NOISE = 0.05 * np.arange(19)
BOX = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)


def make(name: str = PATH, **options: Any) -> Any:
    return gymnasium.make(name, **(COARSE | options))


def actions(count: int, steps: int, seed: int = 0) -> Any:
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (steps, count, 2)).astype(np.float32)


class TestObservationNoise:
    def test_is_of_the_given_size_in_each_component(self) -> None:
        clean, noisy = make(SPEED, time_limit=1000.0), ObservationNoise(make(SPEED, time_limit=1000.0), NOISE)
        clean.reset(seed=0)
        noisy.reset(seed=0)
        still = np.zeros(2, np.float32)
        pairs = [(noisy.step(still)[0], clean.step(still)[0]) for _ in range(600)]
        errors = np.array([ours - theirs for ours, theirs in pairs])
        # A standard deviation out of 600 draws is off by 3 %.
        assert errors.std(axis=0) == pytest.approx(NOISE, rel=0.12)
        assert errors.mean(axis=0) == pytest.approx(np.zeros(19), abs=0.2)

    def test_stays_in_the_space(self) -> None:
        noisy = ObservationNoise(make(), 100.0)
        observation, _ = noisy.reset(seed=0)
        assert noisy.observation_space.contains(observation)
        assert (np.abs(observation) == 10.0).sum() > 10

    def test_leaves_the_environments_own_draws(self) -> None:
        clean, noisy = make(SPEED), ObservationNoise(make(SPEED), 0.1)
        for seed in (1, None, None):
            clean.reset(seed=seed)
            noisy.reset(seed=seed)
            assert clean.unwrapped.simulator.get_state() == noisy.unwrapped.simulator.get_state()  # type: ignore[attr-defined]

    @pytest.mark.parametrize("deviation", [-1.0, math.nan, [0.1, 0.2], "much"])
    def test_impossible_deviations_are_refused(self, deviation: Any) -> None:
        with pytest.raises(InvalidInputError, match="standard deviations are one number or 19"):
            ObservationNoise(make(), deviation)

    def test_other_spaces_are_refused(self) -> None:
        env: Any = gymnasium.make("FrozenLake-v1")
        with pytest.raises(ConfigurationError, match="float32 Box of one axis"):
            ObservationNoise(env, 0.1)


class TestActionDelay:
    def test_is_an_environment_that_was_asked_earlier(self) -> None:
        """Against commands shifted by hand, zeros first."""
        delayed, plain = ActionDelay(make(), 3), make()
        assert delayed.reset(seed=1)[1]["action_delay"] == 3
        plain.reset(seed=1)
        asked = actions(1, 12)[:, 0]
        shifted = np.concatenate([np.zeros((3, 2), np.float32), asked[:-3]])
        for action, arriving in zip(asked, shifted, strict=True):
            assert delayed.step(action)[0].tobytes() == plain.step(arriving)[0].tobytes()

    @given(low=st.integers(0, 5), span=st.integers(0, 5), episodes=st.integers(1, 4), seed=st.integers(0, 99))
    @settings(max_examples=50, deadline=None)
    def test_any_line_delays_by_what_it_says(self, low: int, span: int, episodes: int, seed: int) -> None:
        line, everyone = DelayLine((low, low + span), BOX, 2), np.arange(2)
        for row in range(2):
            line.seed(row, seed)
        for episode in range(episodes):
            line.begin(everyone)
            assert np.all((low <= line.delays) & (line.delays <= low + span))
            asked = actions(2, 14, episode)
            given_back = [line.shift(each) for each in asked]
            for row, delay in enumerate(line.delays):
                expected = np.concatenate([np.zeros((delay, 2)), asked[:, row]])[:14]
                assert np.array([each[row] for each in given_back]).tolist() == expected.tolist()

    def test_is_drawn_for_each_episode(self) -> None:
        env = ActionDelay(make(), (0, 4))
        env.reset(seed=0)
        assert {env.reset()[1]["action_delay"] for _ in range(60)} == {0, 1, 2, 3, 4}

    @pytest.mark.parametrize("delay", [-1, 1.5, (3, 1), (1, 2, 3), True, (0, 10**6), "two"])
    def test_impossible_delays_are_refused(self, delay: Any) -> None:
        with pytest.raises(InvalidInputError, match="number of control periods"):
            ActionDelay(make(), delay)

    @pytest.mark.parametrize("action", [[math.nan, 0.0], [1.5, 0.0], [0.0]])
    def test_an_impossible_action_is_refused_when_it_comes(self, action: Any) -> None:
        env = ActionDelay(make(), 2)
        env.reset(seed=0)
        with pytest.raises(InvalidInputError, match="actions are of shape"):
            env.step(np.array(action))


class TestVector:
    @pytest.mark.parametrize("name", [PATH, SPEED])
    @pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
    @pytest.mark.parametrize("outer", ["noise", "delay"])
    def test_a_wrapped_batch_is_a_batch_of_wrapped_ones(self, name: str, mode: str, outer: str) -> None:
        def single() -> Any:
            env = make(name, time_limit=0.4)
            if outer == "noise":
                return ObservationNoise(ActionDelay(env, (0, 3)), NOISE)
            return ActionDelay(ObservationNoise(env, NOISE), (0, 3))

        theirs = SyncVectorEnv([single] * 3, autoreset_mode=mode)
        batch: Any = gymnasium.make_vec(name, 3, "vector_entry_point", autoreset_mode=mode, time_limit=0.4, **COARSE)
        ours: Any
        if outer == "noise":
            ours = VectorObservationNoise(VectorActionDelay(batch, (0, 3)), NOISE)
        else:
            ours = VectorActionDelay(VectorObservationNoise(batch, NOISE), (0, 3))
        (observations, infos), (expected, wanted) = ours.reset(seed=7), theirs.reset(seed=7)
        assert observations.tobytes() == expected.tobytes()
        assert infos["action_delay"].tolist() == wanted["action_delay"].tolist()
        ended = 0
        for each in actions(3, 16):
            outcome, reference = ours.step(each), theirs.step(each)
            for part, other in zip(outcome[:4], reference[:4], strict=True):
                assert part.tobytes() == other.tobytes()
            infos, wanted = outcome[4], reference[4]
            assert ("final_obs" in infos) == ("final_obs" in wanted)
            for key in ("action_delay", "_action_delay", "_final_obs"):
                assert (key in infos) == (key in wanted)
                if key in infos:
                    assert infos[key].tolist() == wanted[key].tolist()
            if "final_obs" in infos:
                for last, other in zip(infos["final_obs"], wanted["final_obs"], strict=True):
                    assert np.array_equal(last, other)
            ended += int((outcome[2] | outcome[3]).sum())
        assert ended >= 9

    def test_a_masked_reset_leaves_the_others(self) -> None:
        env: Any = VectorActionDelay(VectorObservationNoise(make_vec(3), NOISE), (1, 6))
        before, _ = env.reset(seed=0)
        after, infos = env.reset(seed=9, options={"reset_mask": np.array([False, True, False])})
        assert [np.array_equal(a, b) for a, b in zip(before, after, strict=True)] == [True, False, True]
        assert infos["_action_delay"].tolist() == [False, True, False]

    def test_without_autoreset(self) -> None:
        """In mode Disabled, an episode begins in a masked reset alone."""
        theirs = SyncVectorEnv([lambda: ActionDelay(make(SPEED, time_limit=0.2), 1)] * 2, autoreset_mode="Disabled")
        inner = SyncVectorEnv([lambda: make(SPEED, time_limit=0.2)] * 2, autoreset_mode=AutoresetMode.DISABLED)
        ours: Any = VectorActionDelay(inner, 1)
        assert ours.reset(seed=0)[0].tobytes() == theirs.reset(seed=0)[0].tobytes()
        for each in actions(2, 6):
            outcome, reference = ours.step(each), theirs.step(each)
            assert outcome[0].tobytes() == reference[0].tobytes()
            if (outcome[2] | outcome[3]).any():
                masks = ({"reset_mask": outcome[3].copy()} for _ in range(2))
                again, other = (env.reset(options=mask) for env, mask in zip((ours, theirs), masks, strict=True))
                assert again[0].tobytes() == other[0].tobytes()

    def test_an_environment_that_hides_its_mode_is_refused(self) -> None:
        env = make_vec(2)
        env.metadata = {}
        with pytest.raises(ConfigurationError, match="autoreset_mode"):
            VectorObservationNoise(env, 0.1)


def make_vec(count: int, **options: Any) -> Any:
    return gymnasium.make_vec(PATH, count, "vector_entry_point", **(COARSE | options))


@pytest.mark.parametrize("name", [PATH, SPEED])
@pytest.mark.filterwarnings("ignore:.*is different from the unwrapped version")
def test_gymnasium_has_nothing_to_say(name: str) -> None:
    check_env(ObservationNoise(make(name), 0.1), skip_render_check=True)
    check_env(ActionDelay(make(name), (0, 2)), skip_render_check=True)


def test_a_wrapped_environment_is_made_again_from_its_spec() -> None:
    env = ObservationNoise(ActionDelay(make(), (1, 2)), 0.25)
    assert env.spec is not None
    again = gymnasium.make(env.spec)
    assert again.reset(seed=3)[0].tobytes() == env.reset(seed=3)[0].tobytes()
