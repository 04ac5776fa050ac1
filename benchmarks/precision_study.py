"""Weights of fewer bits in the forward pass: accuracy of the shipped artifacts, the closed loop, and time in C.

    python -P benchmarks/precision_study.py --output docs

Rows are driven again as the datasets of the artifacts hold them, so that none has to be there. Accuracy and drives are kept
as they are done, in build/precision-study, so that the same command goes on after an interruption. About half an hour on
a quiet core, most of it for the drives with rounded activations.
"""

from __future__ import annotations

import argparse
import json
import platform
import sys
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

# With -P the folder of a script is not searched, and the package beside it is found from the repository's root.
sys.path.append(str(Path(__file__).resolve().parent.parent))

import grouser
from benchmarks.precision.accuracy import Rows, accuracy, logged_rows
from benchmarks.precision.figure import draw
from benchmarks.precision.loop import CONTROLLERS, MARGIN, drive, judged
from benchmarks.precision.speed import DRAWN, drawn_subjects, shipped_subject, speed
from grouser.native import cpu_level
from grouser.surrogate import Surrogate, shipped_names
from grouser.surrogate.offline import PRESETS
from grouser.terrain import write_json

#: Structured surrogates, and a plain one, which the policy goes nowhere on.
DRIVES = (*product(("m113-rigid", "m113-soil"), CONTROLLERS), ("m113-rigid-paper-recipe", CONTROLLERS[0]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, default=Path("build/precision"))
    parser.add_argument("--runs", type=int, default=300, help="of the datasets, of which 15 %% are test runs")
    parser.add_argument("--samples", type=int, default=3801, help="logged ticks a run")
    parser.add_argument("--starts", type=int, default=10, help="paired drives")
    parser.add_argument("--rounds", type=int, default=501, help="of the times")
    parser.add_argument("--artifact", action="append", help="shipped artifact; all of them by default")
    parser.add_argument("--network", action="append", choices=DRAWN, help="to be timed; all of them by default")
    parser.add_argument("--kept", type=Path, default=Path("build/precision-study"))
    chosen = parser.parse_args()
    names = chosen.artifact or shipped_names()

    def rows_of(name: str) -> Rows:
        return logged_rows(replace(PRESETS[name].data, runs=chosen.runs, samples_per_run=chosen.samples))

    def errors_of(name: str) -> dict[str, Any]:
        return accuracy(Surrogate.load(name), rows_of(name))

    errors = {}
    for name in names:
        label = f"{name}, {chosen.runs} runs, {chosen.samples} samples"
        errors[name] = kept(chosen.kept, label, errors_of, name)
        print(f"accuracy  {name}", flush=True)
    drives = {}
    for name, controller in DRIVES:
        if name not in names:
            continue
        label = f"{name}, {controller}, {chosen.starts} starts"
        driven = kept(chosen.kept, label, drive, Surrogate.load(name), controller, chosen.starts)
        drives[f"{name}, {controller}"] = {"starts": driven, "judged": judged(driven)}
        print(f"drives    {name}, {controller}", flush=True)
    subjects = drawn_subjects(chosen.network or DRAWN)
    subjects += [shipped_subject(name, rows_of(name).inputs) for name in names if not Surrogate.load(name).structured]
    with TemporaryDirectory(prefix="grouser-precision-") as folder:
        times = speed(subjects, chosen.rounds, Path(folder), tell)
    results: dict[str, Any] = {
        "command": "python -P benchmarks/precision_study.py --output docs",
        "grouser": grouser.__version__,
        "machine": f"{platform.machine()}, kernels at {cpu_level()}",
        "sizes": {
            "runs": chosen.runs,
            "samples a run": chosen.samples,
            "starts": chosen.starts,
            "rounds": chosen.rounds,
        },
        "units": {
            "accuracy": "over the standard deviation of the logged force",
            "drives": "m; shares of 1",
            "ns": "ns a call, single, in C",
        },
        "noticed": f"growth less half of its 95 % interval above {MARGIN:g} m, or a drive lost that float32 finishes",
        "accuracy": errors,
        "drives": drives,
        "speed": times,
    }
    write_json(chosen.output / "results" / "precision.json", results)
    draw(results, chosen.output / "figures" / "precision.png")


def kept(folder: Path, label: str, compute: Callable[..., Any], *arguments: Any) -> Any:
    """Return what is computed under a label, from its file where an earlier run left one."""
    file = folder / f"{label}.json".replace(" ", "-")
    if not file.exists():
        write_json(file, compute(*arguments))
    return json.loads(file.read_text(encoding="utf-8"))


def tell(done: int, total: int) -> None:
    """Say how far the times are."""
    if done % 100 == 0 or done == total:
        print(f"times     round {done} of {total}", flush=True)


if __name__ == "__main__":
    main()
