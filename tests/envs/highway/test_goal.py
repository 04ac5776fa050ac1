"""Goals: the reward's form against parking-v0's own, errors against geometry, one against many to the bit."""

from __future__ import annotations

import math

import gymnasium
import highway_env
import numpy as np
import pytest

from grouser.envs.highway.goal import GOAL_SCALES, Tolerance, as_goals, goal_errors, goal_reward, make_goal, within
from grouser.terrain import InvalidInputError

TOLERANCE = Tolerance(0.5, math.radians(10.0), 0.1)


def goals(count: int, seed: int = 0) -> np.ndarray:
    generator = np.random.default_rng(seed)
    numbers = generator.uniform([-20, -20, -4, -4, -9], [20, 20, 4, 4, 9], (count, 5)).tolist()
    rows = [make_goal(x, y, vx, vy, heading, 10.0) for x, y, vx, vy, heading in numbers]
    return as_goals(np.array(rows))


def test_the_reward_is_parking_v0s() -> None:
    gymnasium.register_envs(highway_env)
    theirs = gymnasium.make("parking-v0").unwrapped
    scales, weights = np.array([100, 100, 5, 5, 1, 1]), np.array([1, 0.3, 0, 0, 0.02, 0.02])
    ours = tuple((weights * np.array(GOAL_SCALES) / scales).tolist())
    achieved, desired = goals(50), goals(50, seed=1)
    for one, other in zip(achieved, desired, strict=True):
        given = (goal * np.array(GOAL_SCALES) / scales for goal in (one, other))
        expected = theirs.compute_reward(*given, {})  # type: ignore[attr-defined]
        assert goal_reward(one[None], other[None], ours, 0.5)[0] == pytest.approx(expected, rel=1e-12)


def test_errors_are_distance_angle_and_speed() -> None:
    achieved = as_goals(make_goal(3.0, 4.0, 1.0, 0.0, math.radians(170.0), 10.0))
    desired = as_goals(make_goal(0.0, 0.0, 0.0, 0.0, math.radians(-170.0), 10.0))
    errors = goal_errors(achieved, desired)
    assert [float(error[0]) for error in errors] == pytest.approx([5.0, math.radians(20.0), 1.0], abs=1e-5)


@pytest.mark.parametrize(
    ("offset", "turn", "speed", "parked"),
    [
        (0.49, 0.0, 0.0, True),
        (0.51, 0.0, 0.0, False),
        (0.0, 9.9, 0.0, True),
        (0.0, -10.1, 0.0, False),
        (0.0, 180.0, 0.0, False),
        (0.0, 0.0, 0.099, True),
        (0.0, 0.0, 0.101, False),
        (0.4, 9.0, 0.09, True),
    ],
)
def test_parked_is_within_every_tolerance(offset: float, turn: float, speed: float, parked: bool) -> None:
    heading = math.pi / 2
    desired = as_goals(make_goal(10.0, 14.0, 0.0, 0.0, heading, 10.0))
    achieved = as_goals(make_goal(10.0 + offset, 14.0, 0.0, speed, heading + math.radians(turn), 10.0))
    assert within(goal_errors(achieved, desired), TOLERANCE).tolist() == [parked]


def test_one_is_many_to_the_bit() -> None:
    achieved, desired = goals(257), goals(257, seed=1)
    many, errors = goal_reward(achieved, desired, (1.0, 0.7, 0.1, 0.1, 0.2, 0.2), 0.5), goal_errors(achieved, desired)
    for index in range(257):
        one = slice(index, index + 1)
        alone = goal_reward(achieved[one], desired[one], (1.0, 0.7, 0.1, 0.1, 0.2, 0.2), 0.5)
        assert alone[0] == many[index]
        for error, all_errors in zip(goal_errors(achieved[one], desired[one]), errors, strict=True):
            assert error[0] == all_errors[index]


def test_other_shapes_are_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"\(n, 6\)"):
        as_goals(np.zeros((2, 5)))
