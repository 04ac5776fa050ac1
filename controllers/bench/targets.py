"""What the figures are to reach, each a ratio within one run, and whether they did."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

from .calls import GATED, OURS, SCALAR, STRUCTURED, WITH_JACOBIAN
from .compiled_rivals import PLAIN_FLAGS
from .environments import DOUBLE, column
from .environments import STRUCTURED as STRUCTURED_ENVIRONMENT
from .timing import Section

Sections = Mapping[str, Section]
_OPTIMISED, _FASTEST = PLAIN_FLAGS
_STEP: Final = "grouser, bound step()"
_ONNX: Final = "ONNX Runtime, bound"
_EAGER: Final = "torch, eager"
#: Name of the least time in the section of bounds.
BOUND: Final = "bound"
_ALONE, _SHARED = column(1024, 1), column(1024, 2)


@dataclass(frozen=True)
class Target:
    """One thing to reach.

    Parameters
    ----------
    group : str
        What it belongs to.
    name : str
        The ratio in words.
    sense : {"at least", "at most"}
        On which side to be.
    threshold : float
        To reach.
    unit : str
        Of both numbers.
    measure : callable
        Returns what was reached, from the sections; None where it was not measured.
    ceiling : callable
        Returns the most that the processor's measured limits leave room for; None where nothing is known of it.
    """

    group: str
    name: str
    sense: Literal["at least", "at most"]
    threshold: float
    unit: str
    measure: Callable[[Sections], float | None]
    ceiling: Callable[[Sections], float | None] = lambda sections: None

    def judge(self, sections: Sections) -> dict[str, Any]:
        """Return the target with what was reached, as JSON can hold it; ``met`` is None where it was not measured."""
        value, ceiling = self.measure(sections), self.ceiling(sections)
        met = None
        if value is not None:
            value = float(f"{value:.3g}")
            met = value >= self.threshold if self.sense == "at least" else value <= self.threshold
        return {
            "group": self.group,
            "name": self.name,
            "sense": self.sense,
            "target": self.threshold,
            "unit": self.unit,
            "reached": value,
            "ceiling": None if ceiling is None else float(f"{ceiling:.3g}"),
            "met": met,
        }


def _ratio(section: str, over: tuple[str, str], under: tuple[str, str], other: str = "") -> Callable[..., float | None]:
    """Return what divides a figure of a section by one of it, or of another."""

    def measure(sections: Sections) -> float | None:
        if section not in sections or (other or section) not in sections:
            return None
        a, b = sections[section].get(*over), sections[other or section].get(*under)
        return None if a is None or b is None else a / b

    return measure


def _figure(section: str, case: str, name: str) -> Callable[[Sections], float | None]:
    return lambda sections: sections[section].get(case, name) if section in sections else None


def _all() -> Iterator[Target]:
    own = "against our own SIMD physics"
    physics = "physics 16x4 float64 SIMD (640 cells)"
    yield Target(own, f"{physics} / {GATED}", "at least", 1.0, "x",
                 _ratio("physics_c", ("16x4", "float64"), (GATED, OURS), "networks_c"))  # fmt: skip
    yield Target(own, "environment steps/s, N = 1024, one thread: structured / physics 16x4 float64", "at least", 4.0,
                 "x", _ratio("environments", (STRUCTURED_ENVIRONMENT, _ALONE), (DOUBLE, _ALONE)))  # fmt: skip
    yield Target(own, "physics 16x4: scalar float64 -O2 / float32 SIMD", "at least", 10.0, "x",
                 _ratio("physics_c", ("16x4", SCALAR), ("16x4", "float32")))  # fmt: skip
    yield Target(own, f"{GATED} / plain 64x64", "at most", 250 / 80, "x",
                 _ratio("networks_c", (GATED, OURS), ("64x64", OURS)))  # fmt: skip
    for case in ("64x64", STRUCTURED):
        yield Target(own, f"{case}: forward and Jacobian / forward", "at most", 4.0, "x",
                     _ratio("networks_c", (case, WITH_JACOBIAN), (case, OURS)))  # fmt: skip
    library = "against libraries, called from Python"
    for case, bound, eager in (("64x64", 20.0, 100.0), ("128x128", 7.0, 38.0)):
        for rival, least in ((_ONNX, bound), (_EAGER, eager)):
            yield Target(library, f"{case}: {rival} / {_STEP}", "at least", least, "x",
                         _ratio("python", (case, rival), (case, _STEP)))  # fmt: skip
    plain = "against plain C, single sample"
    for case, fastest in (("64x64", 4.5), ("128x128", 3.0), ("128x4", 2.8), ("256x4", 2.5)):
        for rival, least in ((_FASTEST, fastest), (_OPTIMISED, 19.0)):
            yield Target(plain, f"{case}: {rival} / grouser", "at least", least, "x",
                         _ratio("networks_c", (case, rival), (case, OURS)),
                     _ratio("networks_c", (case, rival), (case, BOUND), "bounds"))  # fmt: skip
    throughput = "throughput"
    for case in ("128x128", "128x4"):
        yield Target(throughput, f"{case}, batch of 256: share of the multiply-add peak", "at least", 0.75, "of peak",
                     _figure("batch_peak", case, "share of peak"))  # fmt: skip
    yield Target(throughput, "environment steps/s, structured, N = 1024, one thread", "at least", 150_000.0,
                 "steps/s", _figure("environments", STRUCTURED_ENVIRONMENT, _ALONE))  # fmt: skip
    yield Target(throughput, "environment steps/s, structured, N = 1024: two threads / one", "at least", 1.8, "x",
                 _ratio("environments", (STRUCTURED_ENVIRONMENT, _SHARED), (STRUCTURED_ENVIRONMENT, _ALONE)))  # fmt: skip


#: In the order of the report.
TARGETS: Final = tuple(_all())


def judged(sections: Sections) -> list[dict[str, Any]]:
    """Return every target with what was reached."""
    return [target.judge(sections) for target in TARGETS]
