"""Time one force call and one tick from Python on every backend, interleaved in one process, against our own physics.

    python benchmarks/force_call.py --output build/bench/force_call.json

Times compare as ratios within one run: the rounds take turns, and medians are reported.
"""

from __future__ import annotations

import argparse
import json
import platform
import random
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import perf_counter

import numpy as np

import grouser
from grouser.envs import BeltCommand, Simulator, VehicleState
from grouser.native import cpu_level
from grouser.surrogate import Surrogate
from grouser.terrain import ForceBackend, TrackedVehicle, make_backend, named, reference_forces

ROUNDS, CALLS = 15, 300


def contenders(vehicle: TrackedVehicle, rows: np.ndarray) -> dict[str, Callable[[], object]]:
    """Return, by name, functions that make CALLS calls."""
    built: dict[str, ForceBackend] = {
        f"physics {along}x{across}": make_backend("physics", mode="rigid", vehicle=vehicle, cells=(along, across))
        for along, across in ((2, 1), (4, 2), (8, 4), (16, 4), (32, 8))
    }
    for name in ("native", "torch", "guarded"):
        built[name] = make_backend(name, mode="rigid", vehicle=vehicle)
    calls: dict[str, Callable[[], object]] = {}
    for name, backend in built.items():
        calls[f"{name}, forces"] = lambda backend=backend: [backend.forces(row) for row in rows]  # type: ignore[misc]
        calls[f"{name}, forces and Jacobian"] = lambda backend=backend: [  # type: ignore[misc]
            backend.forces_and_jacobian(row) for row in rows
        ]
    calls["numpy physics 16x4, forces"] = lambda: [reference_forces(vehicle, "rigid", row) for row in rows]
    for name in ("physics 2x1", "physics 16x4", "native", "guarded"):
        calls[f"{name}, tick"] = lambda name=name: drive(vehicle, built[name])  # type: ignore[misc]
    return calls


def drive(vehicle: TrackedVehicle, backend: ForceBackend) -> None:
    simulator = Simulator(vehicle, backend, named("asphalt"), state=VehicleState.rolling(4.0))
    for index in range(CALLS):
        swing = 0.5 * np.sin(index / 30)
        simulator.step(BeltCommand(4.0 + swing, 4.0 - swing))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, default=Path("build/bench/force_call.json"))
    output: Path = parser.parse_args().output
    try:
        import torch

        torch.set_num_threads(1)
    except ImportError:
        pass
    vehicle = TrackedVehicle.preset("m113")
    simulator = Simulator(vehicle, "physics", named("asphalt"), state=VehicleState.rolling(4.0))
    rows = np.array([simulator.step(BeltCommand(4 + np.sin(i / 30), 4 - np.sin(i / 30))).row for i in range(CALLS)])
    functions = contenders(vehicle, rows)
    times: dict[str, list[float]] = {name: [] for name in functions}
    names = list(functions)
    for turn in range(ROUNDS):
        # What ran before leaves its mark on caches and clocks: no contender always follows the same one.
        for name in random.Random(turn).sample(names, len(names)):
            function = functions[name]
            began = perf_counter()
            function()
            times[name].append((perf_counter() - began) / CALLS * 1e9)
    medians = {name: median(values) for name, values in times.items()}
    reference = medians["physics 16x4, forces"]
    result = {
        "command": "python benchmarks/force_call.py",
        "grouser": grouser.__version__,
        "machine": f"{platform.machine()}, kernels at {cpu_level()}",
        "network": list(Surrogate.shipped(vehicle, "rigid").network.widths),
        "unit": "ns a call from Python, median of rounds",
        "nanoseconds": {name: round(value) for name, value in medians.items()},
        "over_physics_16x4_forces": {name: round(value / reference, 3) for name, value in medians.items()},
    }
    output.parent.mkdir(parents=True, exist_ok=True)
    output.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    for name, value in medians.items():
        print(f"{name:44s} {value:10.0f} ns   {value / reference:7.2f}")


if __name__ == "__main__":
    main()
