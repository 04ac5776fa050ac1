"""The whole measurement."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from ...native import cpu_level
from ...surrogate.threads import torch_threads
from ...terrain import ForceBackend, TrackedVehicle
from .absences import Absences
from .accuracy import accuracies, varied_rows
from .calls import OURS, Calls
from .environments import COUNTS, backends, environment_steps, fleet_ticks, steps_per_second
from .latency import latencies
from .limits import PEAK, bound, first_level_cache, products, rate
from .python_rivals import single_blas_thread
from .subjects import BATCH, Subjects
from .targets import BOUND, judged
from .timing import Contender, Effort, Progress, Section, measure
from .toolchain import Toolchain

_PACKAGES: Final = ("numpy", "torch", "onnxruntime", "casadi")

_CALLS: Final = Effort(31, 0.008)
_ENVIRONMENTS: Final = Effort(9, 0.1)


@dataclass(frozen=True)
class BenchConfig:
    """How long to measure.

    Parameters
    ----------
    calls : Effort
        Of single samples and batches.
    environments : Effort
        Of environments and fleets.
    counts : tuple of int
        Numbers of vehicles.
    free, paced, cold : int
        Numbers of calls of which the latency is looked at, a kind.
    """

    calls: Effort = _CALLS
    environments: Effort = _ENVIRONMENTS
    counts: tuple[int, ...] = COUNTS
    free: int = 200_000
    paced: int = 3_000
    cold: int = 200

    @classmethod
    def quick(cls) -> BenchConfig:
        """Return sizes that only show that everything runs."""
        return cls(Effort(3, 0.0005), Effort(2, 0.005), (1, 16), 2_000, 50, 5)


def run_bench(
    vehicle: TrackedVehicle, config: BenchConfig, *, command: str = "grouser bench", progress: Progress
) -> dict[str, Any]:
    """Measure everything, and return it as JSON can hold it.

    Parameters
    ----------
    vehicle : TrackedVehicle
        Whose surrogates and physics are timed.
    config : BenchConfig
        How long.
    command : str
        That is to be written down.
    progress : callable
        Called with stage, steps done and their number.

    Returns
    -------
    dict
        ``meta``, what was there and does not change from run to run; ``absent``, what could not be had and why;
        ``times``, the figures by section; ``targets``, what they are to reach.
    """
    blas = single_blas_thread()
    toolchain, absent, sections = Toolchain.find(), Absences(), dict[str, Section]()
    with _single_torch_thread(), TemporaryDirectory(prefix="grouser-bench-") as folder:
        progress("preparation", 0, 1)
        calls = Calls(Subjects(vehicle), toolchain, Path(folder), absent)
        progress("preparation", 1, 1)

        def timed(stage: str, section: Section, contenders: Iterable[Contender], effort: Effort) -> Section:
            measure(section, contenders, effort, lambda done, total: progress(stage, done, total))
            return section

        in_c = "One sample in C, 10 columns in and 3 forces out, each call waiting for the last."
        networks = Section("ns", in_c)
        sections["networks_c"] = timed("networks in C", networks, calls.networks_in_c(), config.calls)
        if calls.limits is not None:
            sections["limits"] = calls.limits.rates(networks)
        sections["physics_c"] = timed("physics in C", Section("ns", in_c), calls.physics_in_c(), config.calls)
        about = "One sample called from Python, on arrays that are held ready."
        sections["python"] = timed("called from Python", Section("ns", about), calls.from_python(), config.calls)
        about = f"A batch of {BATCH} rows, called from Python, by the row."
        sections["batch"] = timed("batches", Section("ns a row", about), calls.batched(), config.calls)
        _derive(sections, calls)
        progress("accuracy", 0, 1)
        sections["accuracy"] = accuracies(calls.subjects, varied_rows(calls.subjects))
        progress("accuracy", 1, 1)
        sections["latency"] = latencies(
            calls.bound_steps(), free=config.free, paced=config.paced, cold=config.cold, progress=progress
        )
        progress("driving network", 0, 1)
        driven = backends(calls.subjects, absent)
        progress("driving network", 1, 1)
        sections |= _environments(vehicle, driven, config, timed)
    return {
        "meta": _meta(command, toolchain, blas, calls.widths()),
        "absent": dict(absent),
        "times": {name: section.to_dict() for name, section in sections.items()},
        "targets": judged(sections),
    }


def _environments(
    vehicle: TrackedVehicle,
    driven: Mapping[str, ForceBackend],
    config: BenchConfig,
    timed: Callable[[str, Section, Iterable[Contender], Effort], Section],
) -> dict[str, Section]:
    about = (
        "grouser/PathTracking-v0 through VectorEnv.step, 10 ticks of 10 ms a step, resets included; a step is one "
        "vehicle's."
    )
    section = Section("ns a step", about)
    timed("environments", section, environment_steps(vehicle, driven, config.counts), config.environments)
    fleets = Section("ns a vehicle tick", "VehicleFleet.advance alone, 10 ticks a call: the share of the dynamics.")
    timed("fleets", fleets, fleet_ticks(vehicle, driven, config.counts), config.environments)
    return {"environments": steps_per_second(section), "fleets": fleets}


def _derive(sections: dict[str, Section], calls: Calls) -> None:
    """Enter bounds, and shares of them and of the peak, where the processor's limits were measured."""
    limits = sections.get("limits")
    if limits is None:
        return
    kilobytes = first_level_cache() // 1024
    bounds = Section(
        "ns, and shares of 1",
        f"Every weight read once, {kilobytes} kB of them from the first-level cache and the others from the second, and "
        "multiplied once, at the measured rates: who reads them all in float32 takes at least the longer of both.",
    )
    peaks = Section("share of 1", f"Batches of {BATCH}: operations over the measured multiply-add peak.")
    peak = rate(limits, PEAK)
    for name, widths in calls.widths().items():
        least, time = bound(limits, widths), sections["networks_c"].get(name, OURS)
        if least is not None and time is not None:
            bounds.add(name, "reading", least.read)
            bounds.add(name, "multiplying", least.compute)
            bounds.add(name, BOUND, least.least)
            bounds.add(name, OURS, time)
            bounds.add(name, "share reached", least.least / time)
        by_row = sections["batch"].get(name, OURS)
        if peak is not None and by_row is not None:
            peaks.add(name, "share of peak", 2 * products(widths) / (by_row * peak))
    sections["bounds"], sections["batch_peak"] = bounds, peaks


def _meta(command: str, toolchain: Toolchain | None, blas: str, widths: dict[str, tuple[int, ...]]) -> dict[str, Any]:
    packages = {}
    for name in _PACKAGES:
        try:
            packages[name] = version(name)
        except PackageNotFoundError:
            packages[name] = "missing"
    return {
        "command": command,
        "grouser": version("grouser"),
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} CPUs, {_processor()}",
        "kernels": cpu_level(),
        "compiler of the rivals": "none" if toolchain is None else toolchain.version,
        "threads": f"one, but where two are named; OpenBLAS: {blas}",
        "packages": packages,
        "networks": {name: list(values) for name, values in widths.items()},
    }


def _processor() -> str:
    """Return the processor's model in words."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or "an unknown processor"
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), "unnamed processor")


def _single_torch_thread() -> AbstractContextManager[None]:
    return torch_threads(1) if find_spec("torch") else nullcontext()
