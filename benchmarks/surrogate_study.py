"""Both families on the same data: unseen runs, unseen maneuvers, low traction, and accuracy against time.

    python -P benchmarks/surrogate_study.py --data build/presets --output docs

The datasets are those of the presets m113-rigid-paper and m113-soil-paper (grouser train --preset m113-rigid-paper makes
one). Every entry is kept as it is done, in build/surrogate-study, so that the same command goes on after an interruption.
"""

from __future__ import annotations

import argparse
import json
import platform
import sys
from pathlib import Path
from time import perf_counter
from typing import Any

# With -P the folder of a script is not searched, and the package beside it is found from the repository's root.
sys.path.append(str(Path(__file__).resolve().parent.parent))

from benchmarks.surrogates.entries import Sizes, entries
from benchmarks.surrogates.figure import figure
from benchmarks.surrogates.pareto import pareto
from grouser.native import cpu_level
from grouser.surrogate import Surrogate, shipped_names
from grouser.surrogate.offline import load_dataset
from grouser.surrogate.threads import torch_threads
from grouser.terrain import MODES, write_json

TARGETS = {
    "structured, 16 x 2": {"r2": 0.9998, "mz_tail_share": 0.02},
    "without a maneuver": {"worst r2": 0.998},
    "without a maneuver, on trajectories alone": {"worst r2": 0.99},
    "without low traction": {"worst r2": 0.998},
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=Path("build/presets"))
    parser.add_argument("--output", type=Path, default=Path("build/surrogate-study"))
    parser.add_argument("--mode", choices=MODES, action="append", help="both by default")
    parser.add_argument("--runs", type=int, default=300)
    parser.add_argument("--epochs", type=int, default=40, help="of the structured family; the paper's recipe too")
    chosen = parser.parse_args()
    kept = Path("build/surrogate-study/entries")
    sizes = Sizes(chosen.runs, chosen.epochs, chosen.epochs)
    modes: dict[str, Any] = {}
    for mode in chosen.mode or MODES:
        dataset = load_dataset(chosen.data / f"m113-{mode}-paper")
        done = {}
        for name, compute in entries(dataset, sizes):
            file = kept / f"{mode}, {name}, {sizes.runs} runs, {sizes.structured_epochs} epochs.json".replace(" ", "-")
            if not file.exists():
                begin = perf_counter()
                with torch_threads(1):
                    write_json(file, compute() | {"seconds": perf_counter() - begin})
            done[name] = json.loads(file.read_text(encoding="utf-8"))
            print(
                mode,
                name,
                {key: f"{value:.5f}" for key, value in done[name]["r2"].items() if value is not None},
                flush=True,
            )
        artifacts = {name: Surrogate.load(name) for name in shipped_names() if name.startswith(f"m113-{mode}-paper")}
        modes[mode] = {"entries": done, "pareto": pareto(dataset, artifacts, done)}
    if len(modes) < len(MODES):
        return
    results = {
        "command": f"python -P benchmarks/surrogate_study.py --runs {chosen.runs} --epochs {chosen.epochs} --output docs",
        "machine": f"{platform.machine()}, kernels at {cpu_level()}",
        "sizes": {"runs": sizes.runs, "samples a run": 3801, "epochs": sizes.structured_epochs},
        "units": {
            "mz_rmse": "N m",
            "worst_run_mz_rmse": "N m",
            "ns": "ns a call, single, in C",
            "ns_in_a_batch": "ns a row in a batch, one thread, from Python",
        },
        "targets": TARGETS,
        "modes": modes,
    }
    write_json(chosen.output / "results" / "surrogate.json", results)
    figure(results, chosen.output / "figures" / "surrogate-pareto.png")


if __name__ == "__main__":
    main()
