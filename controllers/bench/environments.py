"""Steps of batched environments, and ticks of the fleets under them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from time import perf_counter
from typing import Any, Final

import gymnasium
import numpy as np

from ...envs import VehicleFleet, VehicleState
from ...terrain import ForceBackend, TrackedVehicle, named
from .absences import Absences
from .driving_network import driving_network
from .subjects import DEFAULT_GRID, Subjects
from .timing import Burst, Contender, Section

#: Backends by the name that tables give them.
STRUCTURED, PLAIN, GUARDED = "native, structured", "native, plain 64x64", "guarded, structured"
DOUBLE, SINGLE = "physics 16x4, float64", "physics 16x4, float32"
# About as accurate as the structured surrogate.
COARSE: Final = "physics 4x2, float32"
COUNTS: Final = (1, 64, 1024)
THREADS: Final = (1, 2)
TICKS: Final = 10
_PERIOD: Final = 0.1
_TICK: Final = 0.01
_ACTION_SETS: Final = 8
_SECONDS: Final = 1e9


def column(count: int, threads: int) -> str:
    """Return the heading of a number of vehicles on a number of threads."""
    return f"N = {count}, {threads} thread{'s' if threads > 1 else ''}"


def backends(subjects: Subjects, absent: Absences) -> dict[str, ForceBackend]:
    """Return the backends that are driven on, and note the one that could not be made."""
    plain: dict[str, ForceBackend] = {}
    with absent.noting(PLAIN):
        plain[PLAIN] = driving_network(subjects, (64, 64))
    return {
        STRUCTURED: subjects.structured,
        **plain,
        GUARDED: subjects.guarded,
        DOUBLE: subjects.physics(DEFAULT_GRID),
        SINGLE: subjects.physics(DEFAULT_GRID, "float32"),
        COARSE: subjects.physics((4, 2), "float32"),
    }


def environment_steps(
    vehicle: TrackedVehicle, driven: Mapping[str, ForceBackend], counts: tuple[int, ...]
) -> Iterator[Contender]:
    """Yield steps of ``grouser/PathTracking-v0`` through ``VectorEnv.step``, resets included, in ns a step of one."""
    for name, backend in driven.items():
        for count in counts:
            for threads in _threads(count):
                made = gymnasium.make_vec(
                    "grouser/PathTracking-v0",
                    num_envs=count,
                    vectorization_mode="vector_entry_point",
                    backend=backend,
                    vehicle=vehicle,
                    threads=threads,
                    control_period=_PERIOD,
                    tick=_TICK,
                )
                made.reset(seed=0)
                yield Contender(name, column(count, threads), _steps(made, count))


def fleet_ticks(
    vehicle: TrackedVehicle, driven: Mapping[str, ForceBackend], counts: tuple[int, ...]
) -> Iterator[Contender]:
    """Yield ticks of a fleet alone, ten a call, in ns a vehicle tick."""
    generator = np.random.default_rng(5)
    for name, backend in driven.items():
        for count in counts:
            for threads in _threads(count):
                fleet = VehicleFleet(
                    vehicle,
                    backend,
                    named("asphalt"),
                    count,
                    tick=_TICK,
                    threads=threads,
                    state=VehicleState.rolling(4.0),
                )
                belts = generator.uniform(3.0, 5.0, (_ACTION_SETS, count, 2))
                yield Contender(name, column(count, threads), _ticks(fleet, belts))


def steps_per_second(section: Section) -> Section:
    """Return the section of :func:`environment_steps` as rates."""
    made = Section("steps/s", section.about, spread=section.spread)
    for case, values in section.figures.items():
        for name, value in values.items():
            made.add(case, name, _SECONDS / value)
    return made


def _threads(count: int) -> tuple[int, ...]:
    return THREADS if count > 1 else (1,)


def _steps(environments: Any, count: int) -> Burst:
    """Return a burst of steps under actions that keep the vehicles going forward, each at a speed of its own."""
    generator = np.random.default_rng(11)
    speed = generator.uniform(0.3, 0.5, (count, 1))
    actions = (speed + generator.uniform(-0.02, 0.02, (_ACTION_SETS, count, 2))).astype(np.float32)

    def run(calls: int) -> float:
        began = perf_counter()
        for index in range(calls):
            environments.step(actions[index % _ACTION_SETS])
        return _SECONDS * (perf_counter() - began) / (calls * count)

    return run


def _ticks(fleet: VehicleFleet, belts: np.ndarray) -> Burst:
    def run(calls: int) -> float:
        began = perf_counter()
        for index in range(calls):
            fleet.advance(belts[index % _ACTION_SETS], TICKS)
        return _SECONDS * (perf_counter() - began) / (calls * TICKS * len(fleet))

    return run
