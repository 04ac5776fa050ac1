"""What each ingredient of the structured surrogate is worth, on unseen runs, three seeds each.

    python -P benchmarks/surrogate_ablation.py --data build/presets --output docs

The datasets are those of the presets m113-rigid-paper and m113-soil-paper. Every training is kept as it is done, in
build/surrogate-ablation, so that the same command goes on after an interruption.
"""

from __future__ import annotations

import argparse
import json
import platform
import sys
from pathlib import Path
from typing import Any

# With -P the folder of a script is not searched, and the package beside it is found from the repository's root.
sys.path.append(str(Path(__file__).resolve().parent.parent))

from benchmarks.surrogates.ablation import ablations, quadrature_alone
from grouser.native import cpu_level
from grouser.surrogate.offline import load_dataset
from grouser.surrogate.threads import torch_threads
from grouser.terrain import MODES, write_json


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=Path("build/presets"))
    parser.add_argument("--output", type=Path, default=Path("build/surrogate-ablation"))
    parser.add_argument("--mode", choices=MODES, action="append", help="both by default")
    parser.add_argument("--runs", type=int, default=300)
    parser.add_argument("--epochs", type=int, default=40)
    chosen = parser.parse_args()
    kept = Path("build/surrogate-ablation/entries")
    modes: dict[str, Any] = {}
    for mode in chosen.mode or MODES:
        dataset = load_dataset(chosen.data / f"m113-{mode}-paper")
        subset = dataset.select(record.run for record in dataset.records[: chosen.runs])
        done: dict[str, Any] = {"quadrature alone": quadrature_alone(subset)}
        for name, compute in ablations(subset, chosen.epochs):
            label = f"{mode}, {name}, {chosen.runs} runs, {chosen.epochs} epochs".replace(" ", "-")
            file = kept / f"{label}.json"
            if not file.exists():
                with torch_threads(1):
                    write_json(file, compute())
            done[name] = json.loads(file.read_text(encoding="utf-8"))
            print(mode, name, {key: f"{value:.6f}" for key, value in done[name].items()}, flush=True)
        modes[mode] = done
    if len(modes) == len(MODES):
        results = {
            "command": f"python -P benchmarks/surrogate_ablation.py --runs {chosen.runs} --epochs {chosen.epochs} --output docs",
            "machine": f"{platform.machine()}, kernels at {cpu_level()}",
            "sizes": {"runs": chosen.runs, "samples a run": 3801, "epochs": chosen.epochs},
            "what": "R² on unseen runs by output",
            "modes": modes,
        }
        write_json(chosen.output / "results" / "surrogate_ablation.json", results)


if __name__ == "__main__":
    main()
