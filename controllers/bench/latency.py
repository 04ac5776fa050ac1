"""How late a single call can be: quantiles of calls one by one, from Python."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter_ns, sleep
from typing import Final

import numpy as np

from ...native import Mlp
from ...surrogate import ACTIVATIONS, random_network
from .timing import Progress, Section

#: Quantiles by name.
QUANTILES: Final = {"p50": 0.5, "p99": 0.99, "p99.9": 0.999, "max": 1.0}
_PERIOD: Final = 1_000_000
_COLD_BYTES: Final = 32 * 1024 * 1024
_DENORMAL: Final = 1e-40


def latencies(calls: dict[str, Callable[[], None]], *, free: int, paced: int, cold: int, progress: Progress) -> Section:
    """Return quantiles in ns of calls that nothing was averaged over; the clock's own cost is taken off.

    Parameters
    ----------
    calls : dict
        Bound calls by name; one with denormals everywhere is added.
    free, paced, cold : int
        Number of calls one after another, of calls a millisecond apart, and of calls after 32 MB were read.
    progress : callable
        Called with stage, steps done and their number.
    """
    section = Section(
        "ns",
        "One bound call at a time from Python: one after another, a millisecond apart after sleeping, and with caches "
        "that hold something else. The largest values are the operating system's.",
    )
    clock = _clock_cost()
    memory = np.ones(_COLD_BYTES, np.uint8)
    kinds: list[tuple[str, int, Callable[[], object]]] = [
        ("free-running", free, lambda: None),
        ("at 1 kHz", paced, _wait_for_the_millisecond),
        ("cold caches", cold, lambda: int(memory.sum())),
    ]
    runs = [(f"{name}, {kind}", call, count, before) for name, call in calls.items() for kind, count, before in kinds]
    runs.append(("64x64, free-running, denormal inputs", _denormal_call(), free, lambda: None))
    for done, (case, call, count, before) in enumerate(runs, start=1):
        values = _times(call, count, before) - clock
        for name, quantile in QUANTILES.items():
            section.add(case, name, float(max(0.0, np.quantile(values, quantile))))
        progress("latency", done, len(runs))
    return section


def _times(call: Callable[[], None], count: int, before: Callable[[], object]) -> np.ndarray:
    times = np.empty(count)
    for _ in range(min(count, 100)):
        call()
    for index in range(count):
        before()
        began = perf_counter_ns()
        call()
        times[index] = perf_counter_ns() - began
    return times


def _clock_cost() -> float:
    return float(np.median(_times(lambda: None, 20_000, lambda: None)))


def _wait_for_the_millisecond() -> None:
    sleep((_PERIOD - perf_counter_ns() % _PERIOD) * 1e-9)


def _denormal_call() -> Callable[[], None]:
    """Return a call of a network whose every product is a denormal: tiny inputs, and no bias that would lift them."""
    network = random_network((10, 64, 64, 3), "relu", np.random.default_rng(3))
    kernel = Mlp(
        activation=ACTIVATIONS.index("relu"),
        widths=network.widths,
        parameters=network.packed(),
        input_mean=np.zeros(10),
        input_scale=np.ones(10),
        output_mean=np.zeros(3),
        output_scale=np.ones(3),
    )
    return kernel.bind(np.full(10, _DENORMAL), np.empty(3))
