"""Park an M113 by a rule of thumb: to the mouth of the spot, turn on the spot, roll in, stop."""

import math

import gymnasium
import numpy as np

import grouser  # noqa: F401 - registers the ids

GOAL_SCALES = np.array([5.0, 5.0, 5.0, 5.0, 1.0, 1.0])  # m, m/s, 1: see the environment's docstring
CONTROL_PERIOD = 0.2


def park(observation: dict[str, np.ndarray]) -> np.ndarray:
    """Return a ``twist`` action: speed over 4 m/s, yaw rate over 1 rad/s."""
    x, y, _, _, cosine, sine = observation["achieved_goal"] * GOAL_SCALES
    goal_x, goal_y, _, _, goal_cosine, goal_sine = observation["desired_goal"] * GOAL_SCALES
    heading, goal_heading = math.atan2(sine, cosine), math.atan2(goal_sine, goal_cosine)
    # Distance still to go along the spot, and to its left.
    ahead = (goal_x - x) * goal_cosine + (goal_y - y) * goal_sine
    aside = (goal_y - y) * goal_cosine - (goal_x - x) * goal_sine
    if ahead > 8.0 and abs(aside) > 0.4:
        # A point before the mouth of the spot, where there is room to turn.
        target_x, target_y = goal_x - 10.0 * goal_cosine, goal_y - 10.0 * goal_sine
        course, distance = math.atan2(target_y - y, target_x - x), math.hypot(target_x - x, target_y - y)
    else:
        # Lateral error is steered out on the way in.
        course = goal_heading + math.atan2(aside, 4.0) * (ahead > 0.3)
        distance = ahead
    turn = math.remainder(course - heading, 2 * math.pi)
    speed = 0.0 if abs(turn) > 0.4 else max(-1.0, min(2.5, 0.8 * distance))
    return np.clip([speed / 4.0, 1.5 * turn], -1.0, 1.0).astype(np.float32)


def main() -> None:
    env = gymnasium.make("grouser/Parking-v0", backend="physics", action_mode="twist")
    for seed in range(5):
        observation, info = env.reset(seed=seed)
        while True:
            observation, _, terminated, truncated, info = env.step(park(observation))
            if terminated or truncated:
                break
        print(
            f"seed {seed}: {'parked' if info['is_success'] else 'not parked'} after "
            f"{CONTROL_PERIOD * info['steps']:.1f} s, {info['position_error']:.2f} m and "
            f"{math.degrees(info['heading_error']):.1f} degrees off"
        )


if __name__ == "__main__":
    main()
