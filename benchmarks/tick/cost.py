"""What a simulated second costs: force calls, and wall time over that of the implicit 10 ms tick."""

from __future__ import annotations

import random
from dataclasses import dataclass
from statistics import median
from time import perf_counter
from typing import Final

from grouser.terrain import FloatArray, ForceBackend

from .hosts import METHODS, TICKS, Case, Method, make_host
from .runs import RUNS, play

ROUNDS: Final = 11
RUN: Final = next(run for run in RUNS if run.name == "sine steering")
SECONDS: Final = 2.0


class CountingBackend(ForceBackend):
    """Passes calls on and counts them."""

    name = "counting"

    def __init__(self, backend: ForceBackend) -> None:
        super().__init__(backend.vehicle, backend.mode)
        self._backend = backend
        self.resolution = backend.resolution
        self.plain = 0
        self.with_jacobian = 0

    def forces(self, x: FloatArray) -> FloatArray:
        """Return the forces; one call more."""
        self.plain += 1
        return self._backend.forces(x)

    def forces_and_jacobian(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return forces and Jacobian; one call more of this kind."""
        self.with_jacobian += 1
        return self._backend.forces_and_jacobian(x)


@dataclass(frozen=True)
class Cost:
    """Cost of one method at one tick.

    Parameters
    ----------
    method : str
        Method.
    tick : float
        T_s in s.
    plain, with_jacobian : float
        Force calls a simulated second, without and with the Jacobian.
    wall : float
        Wall time in s a simulated second, median of interleaved rounds.
    wall_ratio : float
        That over the implicit 10 ms tick's.
    """

    method: Method
    tick: float
    plain: float
    with_jacobian: float
    wall: float
    wall_ratio: float


def study_cost(case: Case) -> list[Cost]:
    """Count and time every method at every tick on the sine-steering run."""
    contenders = [(method, tick) for method in METHODS for tick in TICKS]
    times: dict[tuple[Method, float], list[float]] = {contender: [] for contender in contenders}
    for turn in range(ROUNDS):
        for method, tick in random.Random(turn).sample(contenders, len(contenders)):
            times[method, tick].append(_drive(case, method, tick))
    wall = {contender: median(values) / SECONDS for contender, values in times.items()}
    costs = []
    for method, tick in contenders:
        counting = CountingBackend(case.backend)
        _drive(Case(case.name, case.vehicle, case.ground, counting), method, tick)
        costs.append(
            Cost(
                method,
                tick,
                counting.plain / SECONDS,
                counting.with_jacobian / SECONDS,
                wall[method, tick],
                wall[method, tick] / wall["implicit", TICKS[0]],
            )
        )
    return costs


def _drive(case: Case, method: Method, tick: float) -> float:
    commands = RUN.commands(case.vehicle)[: round(SECONDS / 0.1)]
    host = make_host(case, method, tick, RUN.initial_state(case.vehicle))
    began = perf_counter()
    play(host, commands, tick)
    return perf_counter() - began
