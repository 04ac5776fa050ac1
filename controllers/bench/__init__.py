"""How fast is it, and against whom? Kernels, libraries, physics and environments, timed in turn on one machine."""

from .page import page, sections_of
from .report import write_bench, write_bench_docs
from .run import BenchConfig, run_bench
from .targets import TARGETS, Target
from .timing import Contender, Effort, Section

__all__ = [
    "TARGETS",
    "BenchConfig",
    "Contender",
    "Effort",
    "Section",
    "Target",
    "page",
    "run_bench",
    "sections_of",
    "write_bench",
    "write_bench_docs",
]
