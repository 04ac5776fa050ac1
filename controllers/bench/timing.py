"""Times that compare: rounds that take turns, medians, and the figures by section, case and contender."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from statistics import median, quantiles
from time import perf_counter
from timeit import Timer
from typing import Any, Final, NamedTuple

#: Makes a number of calls and returns ns a call.
Burst = Callable[[int], float]
#: Called with a stage, and how many of its steps are done, of how many.
Progress = Callable[[str, int, int], None]
_MOST_CALLS: Final = 1 << 24
_FEWEST_QUARTILES: Final = 4


class Contender(NamedTuple):
    """Something to time.

    Parameters
    ----------
    case : str
        What is computed, such as a network.
    name : str
        Who computes it.
    burst : callable
        Makes a number of calls and returns ns a call.
    """

    case: str
    name: str
    burst: Burst


@dataclass(frozen=True)
class Effort:
    """How long to measure.

    Parameters
    ----------
    rounds : int
        In which every contender has its turn.
    burst : float
        About how long a turn takes, in s.
    """

    rounds: int
    burst: float


@dataclass
class Section:
    """Figures of one kind.

    Parameters
    ----------
    unit : str
        Of all of them.
    about : str
        What was measured, in a sentence.
    figures : dict
        Value by case and contender.
    spread : float, optional
        Median over the contenders of the interquartile range of the rounds, over their median.
    """

    unit: str
    about: str
    figures: dict[str, dict[str, float]] = field(default_factory=dict)
    spread: float | None = None

    def add(self, case: str, name: str, value: float) -> None:
        """Enter a figure."""
        self.figures.setdefault(case, {})[name] = value

    def get(self, case: str, name: str) -> float | None:
        """Return a figure, or None where it was not measured."""
        return self.figures.get(case, {}).get(name)

    def to_dict(self) -> dict[str, Any]:
        """Return what JSON can hold."""
        figures = {
            case: {name: float(f"{value:.4g}") for name, value in values.items()}
            for case, values in self.figures.items()
        }
        spread = {} if self.spread is None else {"spread": round(self.spread, 3)}
        return {"unit": self.unit, "about": self.about, "figures": figures} | spread

    @classmethod
    def from_dict(cls, read: Mapping[str, Any]) -> Section:
        """Return the section of :meth:`to_dict`."""
        figures = {case: dict(values) for case, values in read["figures"].items()}
        return cls(read["unit"], read["about"], figures, read.get("spread"))


def statement(code: str, **names: Any) -> Burst:
    """Return a burst of a Python statement, timed as ``timeit`` does it: garbage collection off.

    Parameters
    ----------
    code : str
        Such as ``"step()"``.
    **names
        That it reads.
    """
    timer = Timer(code, globals=names)
    return lambda calls: 1e9 * timer.timeit(calls) / calls


def measure(
    section: Section, contenders: Iterable[Contender], effort: Effort, progress: Callable[[int, int], None]
) -> None:
    """Enter the median time of every contender, all having had their turn in each round.

    Parameters
    ----------
    section : Section
        Gets the figures, in ns.
    contenders : iterable of Contender
        Each pair of case and name once.
    effort : Effort
        How long.
    progress : callable
        Called with the rounds done and their number.
    """
    progress(0, effort.rounds)
    running = list(contenders)
    calls = [_calls(contender.burst, effort.burst) for contender in running]
    times: list[list[float]] = [[] for _ in running]
    for turn in range(effort.rounds):
        # What ran before leaves its mark on caches and clocks: no contender always follows the same one.
        for index in random.Random(turn).sample(range(len(running)), len(running)):
            times[index].append(running[index].burst(calls[index]))
        progress(turn + 1, effort.rounds)
    spreads = []
    for contender, values in zip(running, times, strict=True):
        middle = median(values)
        section.add(contender.case, contender.name, middle)
        if len(values) >= _FEWEST_QUARTILES:
            low, _, high = quantiles(values, n=4)
            spreads.append((high - low) / middle)
    section.spread = median(spreads) if spreads else None


def _calls(burst: Burst, seconds: float) -> int:
    """Return how many calls take about that long; finding out warms up what is timed."""
    calls = 1
    while calls < _MOST_CALLS:
        taken = _taken(burst, calls)
        if taken >= seconds / 4:
            # A first call may have much to prepare, and any may be interrupted.
            taken = min(taken, _taken(burst, calls))
        if taken >= seconds / 4:
            return max(1, round(calls * seconds / taken))
        calls *= 4
    return calls


def _taken(burst: Burst, calls: int) -> float:
    began = perf_counter()
    burst(calls)
    return perf_counter() - began
