"""Frames a second of PPO in stable-baselines3: our backends, a free environment and highway-env's parking-v0.

    python -P benchmarks/rl_throughput.py --output docs

Every learner has the same hyper-parameters and one torch thread, and all take turns in one process. parking-v0 is so much
slower that it takes part in fewer rounds. About five minutes.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

# With -P the folder of a script is not searched, and the package beside it is found from the repository's root.
sys.path.append(str(Path(__file__).resolve().parent.parent))

from dataclasses import asdict

from benchmarks.rl.results import keep
from benchmarks.rl.throughput import Learner, Setting, free, parking, path_tracking
from grouser.surrogate.threads import torch_threads

FREE, PARKING = "free environment", "highway-env parking-v0"
NATIVE, NATIVE_ALONE = "native, 2 threads", "native, 1 thread"
SHARE = "environment's share"
TARGETS = {
    "fps of native, 2 threads": 30_000,
    "its environment's share": 0.25,
    "its fps over those of parking-v0": 100,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, default=Path("build/rl"))
    parser.add_argument("--rounds", type=int, default=7, help="the first warms up")
    parser.add_argument("--rollouts", type=int, default=6, help="a round")
    chosen = parser.parse_args()
    setting = Setting()
    makers = {
        FREE: free(),
        NATIVE: path_tracking("native", 2),
        NATIVE_ALONE: path_tracking("native", 1),
        "guarded, 2 threads": path_tracking("guarded", 2),
        "physics, 2 threads": path_tracking("physics", 2),
        PARKING: parking(),
    }
    with torch_threads(1):
        learners = {name: Learner(make, setting) for name, make in makers.items()}
        for turn in range(chosen.rounds):
            for name, learner in learners.items():
                if name != PARKING or turn < 3:
                    learner.round(1 if name == PARKING else chosen.rollouts)
            print(f"round {turn + 1} of {chosen.rounds}", flush=True)
    figures: dict[str, Any] = {name: learner.figures() for name, learner in learners.items()}
    for name, values in figures.items():
        print(f"{name:24s} {values['fps']:9.0f} fps, environment {100 * values[SHARE]:.0f} %")
    native = figures[NATIVE]
    reached = {
        "fps of native, 2 threads": native["fps"],
        "its environment's share": native[SHARE],
        "its fps over those of parking-v0": native["fps"] / figures[PARKING]["fps"],
        "its fps over those of physics": native["fps"] / figures["physics, 2 threads"]["fps"],
        "its fps over the free environment's": native["fps"] / figures[FREE]["fps"],
    }
    print(json.dumps(reached, indent=2))
    keep(
        chosen.output,
        "throughput",
        {
            "command": "python -P benchmarks/rl_throughput.py --output docs",
            "setting": asdict(setting) | {"network": "64 x 64, tanh", "torch threads": 1},
            "units": {"fps": "steps of one environment a second, learning included"},
            "learners": figures,
            "reached": reached,
            "targets": TARGETS,
        },
    )


if __name__ == "__main__":
    main()
