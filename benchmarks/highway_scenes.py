"""Draw a frame of each scene, and time Parking-v0 beside highway-env's parking-v0.

    python -P benchmarks/highway_scenes.py --output docs

It writes ``figures/highway-parking.png``, ``figures/highway-offroad.png`` and ``results/highway.json``. The times are
those of one thread; contenders take turns, so that the ratios carry over to another machine. With ``--figures-only``
nothing is timed.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import sys
import time
from pathlib import Path
from typing import Any

import gymnasium
import highway_env
import imageio.v3 as iio
import numpy as np

# -P keeps this folder off the path. At the end of it, the repository's root shadows nothing.
sys.path.append(str(Path(__file__).resolve().parents[1]))

import grouser  # noqa: F401 - registers the ids
from examples.highway_parking import park
from grouser.envs.highway import tracked_vehicle_class, use_tracked_vehicle
from grouser.terrain import write_json

ROUNDS = 7
STEPS = {"grouser": 600, "highway-env": 60}


def draw_parking(path: Path) -> None:
    """Roll into a spot between others, by the rule of thumb of the example."""
    env = gymnasium.make(
        "grouser/Parking-v0", backend="native", action_mode="twist", parked_vehicles=9, render_mode="rgb_array"
    )
    observation, _ = env.reset(seed=2, options={"spot": 9})
    for _ in range(72):
        observation, _, terminated, truncated, _ = env.step(park(observation))
        frame: Any = env.render()
        if terminated or truncated:
            break
    iio.imwrite(path, frame)


def draw_offroad(path: Path) -> None:
    """Follow the road at half speed for a while."""
    env = gymnasium.make("grouser/OffRoad-v0", backend="native", action_mode="twist", render_mode="rgb_array")
    observation, _ = env.reset(seed=12)
    for _ in range(108):
        ahead, aside = observation[13:15].tolist()
        action = [0.4, max(-1.0, min(1.0, 2.0 * math.atan2(aside, ahead)))]
        observation, _, terminated, truncated, _ = env.step(np.array(action, np.float32))
        frame: Any = env.render()
        if terminated or truncated:
            break
    iio.imwrite(path, frame)


def contenders() -> dict[str, gymnasium.Env[Any, Any]]:
    """Return environments by name; those of highway-env begin with its own."""
    gymnasium.register_envs(highway_env)

    def theirs() -> gymnasium.Env[Any, Any]:
        return gymnasium.make("parking-v0", disable_env_checker=True)

    ours = {
        f"grouser/Parking-v0, {backend}": gymnasium.make(
            "grouser/Parking-v0", backend=backend, disable_env_checker=True
        )
        for backend in ("native", "physics")
    }
    native = tracked_vehicle_class("native")
    return {
        "highway-env parking-v0": theirs(),
        "highway-env parking-v0, tracked vehicle, native": use_tracked_vehicle(theirs(), native),
    } | ours


def steps_per_second(env: gymnasium.Env[Any, Any], steps: int) -> float:
    """Step under random actions, resets included."""
    start = time.perf_counter()
    for _ in range(steps):
        _, _, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
    return steps / (time.perf_counter() - start)


def measure() -> dict[str, Any]:
    """Return medians over rounds, and ratios to highway-env within a round."""
    envs = contenders()
    rates: dict[str, list[float]] = {name: [] for name in envs}
    for env in envs.values():
        env.reset(seed=0)
        env.action_space.seed(0)
    for _ in range(ROUNDS):
        for name, env in envs.items():
            rates[name].append(steps_per_second(env, STEPS[name.split("/")[0].split(" ")[0]]))
    reference = rates["highway-env parking-v0"]
    return {
        name: {
            "steps_per_second": round(statistics.median(each)),
            "over_highway_env": round(statistics.median(a / b for a, b in zip(each, reference, strict=True)), 1),
        }
        for name, each in rates.items()
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, default=Path("build/highway"))
    parser.add_argument("--figures-only", action="store_true")
    arguments = parser.parse_args()
    output: Path = arguments.output
    for folder in ("figures", "results"):
        (output / folder).mkdir(parents=True, exist_ok=True)
    draw_parking(output / "figures" / "highway-parking.png")
    draw_offroad(output / "figures" / "highway-offroad.png")
    if arguments.figures_only:
        return
    measured = {"command": "python -P benchmarks/highway_scenes.py --output docs", "rates": measure()}
    write_json(output / "results" / "highway.json", measured)
    print(json.dumps(measured["rates"], indent=2))


if __name__ == "__main__":
    main()
