"""How far every method is from continuous time, over seven maneuvers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from grouser.terrain import FloatArray

from .hosts import METHODS, TICKS, VARIANTS, Case, Method, make_host
from .reference import solve_live
from .runs import RUNS, Run, play, root_mean_square

LABELS: Final[tuple[Method, ...]] = (*METHODS, *VARIANTS)
#: The stop is told apart: there explicit methods do not converge to anything at these ticks.
STOP: Final = "braking to rest"


@dataclass(frozen=True, eq=False)
class LiveStudy:
    """One case over every run.

    Parameters
    ----------
    errors : dict
        ``errors[run][label]`` has shape (4, 3): root-mean-square error of (Vx, Vy, ω) in m/s, m/s, rad/s by tick.
    memory_gain : float
        Largest spectral radius of ∂Q/∂a/m on the way.
    reference_error : float
        Largest difference, in m/s and rad/s, of the reference's first run to the same at a hundredfold tolerance.
    """

    errors: dict[str, dict[str, FloatArray]]
    memory_gain: float
    reference_error: float

    def pooled(self, label: str) -> FloatArray:
        """Return the root mean square over the driven runs, the stop left out, shape (4, 3)."""
        return root_mean_square(np.array([by[label] for run, by in self.errors.items() if run != STOP]))


def study_live(case: Case) -> LiveStudy:
    """Drive every run by every method at every tick."""
    errors: dict[str, dict[str, FloatArray]] = {}
    gains = []
    for run in RUNS:
        reference = solve_live(case, run.initial_state(case.vehicle), run.commands(case.vehicle))
        gains.append(reference.memory_gain)
        errors[run.name] = {label: _errors(case, run, label, reference.bodies) for label in LABELS}
    first = RUNS[0]
    start, commands = first.initial_state(case.vehicle), first.commands(case.vehicle)
    fine, coarse = solve_live(case, start, commands), solve_live(case, start, commands, (1e-6, 1e-8))
    return LiveStudy(errors, max(gains), float(np.max(np.abs(fine.bodies - coarse.bodies))))


def _errors(case: Case, run: Run, method: Method, reference: FloatArray) -> FloatArray:
    commands, start = run.commands(case.vehicle), run.initial_state(case.vehicle)
    drives = [play(make_host(case, method, tick, start), commands, tick) for tick in TICKS]
    return np.array([root_mean_square(drive.compared() - reference) for drive in drives])
