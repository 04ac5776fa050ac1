"""Noise and delay around the scenes: what goes, and what is refused with the reason."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from grouser.envs import ActionDelay, ObservationNoise
from grouser.terrain import ConfigurationError

FULL, STILL = np.ones(2, np.float32), np.zeros(2, np.float32)


@pytest.mark.parametrize("make", ["make_parking", "make_offroad"])
def test_a_delayed_scene_is_one_that_was_asked_earlier(request: pytest.FixtureRequest, make: str) -> None:
    build = request.getfixturevalue(make)
    delayed: Any = ActionDelay(build("physics"), 2)
    plain = build("physics")
    assert delayed.reset(seed=1)[1]["action_delay"] == 2
    plain.reset(seed=1)
    for given, arriving in ((FULL, STILL), (FULL, STILL), (STILL, FULL), (STILL, FULL), (STILL, STILL)):
        np.testing.assert_equal(delayed.step(given), plain.step(arriving))


def test_a_delayed_goal_is_still_recomputed_to_the_bit(make_parking: Any) -> None:
    env: Any = ActionDelay(make_parking("physics", action_change_weight=0.05, slip_power_weight=0.1), (0, 3))
    env.reset(seed=0)
    for action in (FULL, STILL, FULL):
        observation, reward, _, _, info = env.step(action)
        again = env.unwrapped.compute_reward(observation["achieved_goal"], observation["desired_goal"], info)
        assert again == reward


def test_noise_goes_on_the_off_road_task(make_offroad: Any) -> None:
    noisy: Any = ObservationNoise(make_offroad("physics"), 0.01)
    ours, theirs = noisy.reset(seed=0)[0], make_offroad("physics").reset(seed=0)[0]
    assert 0.0 < np.abs(ours - theirs).max() < 0.1


def test_noise_on_goals_is_refused(make_parking: Any) -> None:
    with pytest.raises(ConfigurationError, match="rewards are those of the goals that are observed"):
        ObservationNoise(make_parking("physics"), 0.01)
