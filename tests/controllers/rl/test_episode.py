"""One episode, instant by instant: what Gymnasium's own loop sees, with the environment standing at every instant."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from numpy.typing import NDArray

from grouser.controllers.rl.episode import drive_episode
from grouser.controllers.rl.evaluation import judge_episode


class Countdown(gymnasium.Env[int, Any]):
    """Counts down from the seed; the observation is what is left, the reward the action."""

    observation_space: Any = gymnasium.spaces.Discrete(10)
    action_space = gymnasium.spaces.Box(-10.0, 10.0, (1,))

    def __init__(self, *, truncate: bool = False) -> None:
        self.left = 0
        self._truncate = truncate

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[int, dict[str, Any]]:
        self.left = seed or 0
        return self.left, {"level_error": 0.0, "level": float(self.left)}

    def step(self, action: Any) -> tuple[int, float, bool, bool, dict[str, Any]]:
        self.left -= 1
        over = self.left == 0
        told = {"level_error": float(action[0]), "level": float(self.left)}
        return self.left, float(action[0]), over and not self._truncate, over and self._truncate, told


class Twice:
    """Acts with twice what it observes."""

    def act(self, observation: Any) -> NDArray[np.float32]:
        return np.array([2 * observation], np.float32)


def test_an_episode_is_its_start_and_every_step() -> None:
    start, *steps = drive_episode(Twice(), Countdown(), 3)
    assert (start.observation, start.info["level"], start.action, start.reward) == (3, 3.0, None, 0.0)
    assert [step.observation for step in steps] == [2, 1, 0]
    # Every action follows from the observation before it.
    assert np.ravel([step.action for step in steps]).tolist() == [6.0, 4.0, 2.0]
    assert [step.reward for step in steps] == [6.0, 4.0, 2.0]
    assert [step.terminated for step in steps] == [False, False, True]
    assert not any(step.truncated for step in steps)


def test_the_environment_stands_where_the_instant_says() -> None:
    environment = Countdown()
    assert all(environment.left == instant.observation for instant in drive_episode(Twice(), environment, 4))


@pytest.mark.parametrize("truncate", [False, True])
def test_what_an_episode_came_to(truncate: bool) -> None:
    found = judge_episode(Twice(), Countdown(truncate=truncate), 3)
    assert (found.seed, found.episode_return, found.length) == (3, 12.0, 3)
    assert found.ended == ("truncated" if truncate else "terminated")
    assert found.success is None
    # Of an error the root of the mean square of 6, 4 and 2; of anything else the last value.
    assert found.measures == {"level_error_rmse": pytest.approx((56 / 3) ** 0.5), "level": 0.0}
