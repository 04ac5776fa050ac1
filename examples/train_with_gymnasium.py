"""Step the environment as Gymnasium has it, with the ground's answer as an argument.

python examples/train_with_gymnasium.py
"""

import gymnasium

import grouser  # noqa: F401 - registers the environments

env = gymnasium.make("grouser/PathTracking-v0", backend="guarded", terrain="asphalt", action_mode="twist")
observation, info = env.reset(seed=0)
total, finished = 0.0, False
while not finished:
    # Full ahead at reference speed, turning towards the furthest look-ahead point.
    action = env.action_space.sample() * 0
    action[0], action[1] = 0.5, min(1.0, max(-1.0, 2.0 * float(observation[16])))
    observation, reward, terminated, truncated, info = env.step(action)
    total += float(reward)
    finished = terminated or truncated
print(f"return {total:.1f}, progress {info['progress']:.1f} m, last answer from {info['backend']}")
env.close()
