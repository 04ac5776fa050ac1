"""What the processor can do: bytes read and float32 operations a nanosecond, and the bound that follows for a network."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Final, NamedTuple

from .timing import Contender, Section
from .toolchain import Toolchain, Unit

#: Bytes of the read loops. A neighbour on the same core may hold half of the first-level cache: 8 kB fit all the same.
SIZES: Final = (8 * 1024, 16 * 1024, 256 * 1024)
_STEPS: Final = 1000
_CASE: Final = "this core"
#: Names of the figures.
READS = tuple(f"reading {size // 1024} kB over and over, bytes/ns" for size in SIZES)
PEAK: Final = "float32 multiply-add peak, operations/ns"
_CACHE: Final = 32 * 1024

# Sixteen sums wait for nobody; with 16 registers in all, twelve leave room for the factors.
_SOURCE: Final = """\
#include <time.h>
#if defined(__AVX512F__)
enum { BYTES = 64 };
#define SUMS(X) X(0) X(1) X(2) X(3) X(4) X(5) X(6) X(7) X(8) X(9) X(10) X(11) X(12) X(13) X(14) X(15)
enum { COUNT = 16 };
#else
#if defined(__AVX__)
enum { BYTES = 32 };
#else
enum { BYTES = 16 };
#endif
#define SUMS(X) X(0) X(1) X(2) X(3) X(4) X(5) X(6) X(7) X(8) X(9) X(10) X(11)
enum { COUNT = 12 };
#endif
typedef float lanes __attribute__((vector_size(BYTES)));
typedef int words __attribute__((vector_size(BYTES)));
static char memory[%(most)d] __attribute__((aligned(64)));
volatile float kept;
static double now_ns(void) {
  struct timespec t;
  timespec_get(&t, TIME_UTC);
  return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}
double read_bytes(long bytes, long passes, long *read) {
#define BEGIN(n) words a##n = {0};
#define NEXT(n) a##n ^= from[n];
#define END(n) total ^= a##n;
  SUMS(BEGIN)
  const long steps = bytes / (COUNT * BYTES);
  const double begin = now_ns();
  for (long pass = 0; pass < passes; pass++) {
    const words *from = (const words *)memory;
    for (long step = 0; step < steps; step++, from += COUNT) { SUMS(NEXT) }
    __asm__ volatile("" ::: "memory");
  }
  const double end = now_ns();
  words total = {0};
  SUMS(END)
  kept = (float)total[0];
  *read = steps * COUNT * BYTES;
  return (end - begin) / (double)passes;
}
double multiply_add(long steps, long passes, long *operations) {
#define START(n) lanes b##n = {n};
#define STEP(n) b##n = b##n * factor + term;
#define ADD(n) sum += b##n;
  SUMS(START)
  const float scale = kept * 0.0f + 0.5f;
  const lanes zero = {0}, factor = zero + scale, term = zero + 1.0f;
  const double begin = now_ns();
  for (long step = 0; step < steps * passes; step++) { SUMS(STEP) }
  const double end = now_ns();
  lanes sum = {0};
  SUMS(ADD)
  kept = sum[0] * 0.0f;
  *operations = steps * COUNT * (BYTES / 4) * 2;
  return (end - begin) / (double)passes;
}
"""


class Limits:
    """Loops that do nothing but read, or nothing but multiply and add.

    Parameters
    ----------
    toolchain : Toolchain
        The compiler.
    folder : Path
        Takes the files.
    """

    def __init__(self, toolchain: Toolchain, folder: Path) -> None:
        flags = ("-O3", "-march=native", "-ffp-contract=fast")
        self._library = toolchain.library(folder, "limits", [Unit(_SOURCE % {"most": SIZES[-1]}, flags)])
        self._amounts: dict[str, int] = {}

    def contenders(self) -> list[Contender]:
        """Return the loops, to be timed between everything else."""
        return [
            *(
                Contender(_CASE, name, self._loop(name, self._library.read_bytes, size))
                for name, size in zip(READS, SIZES, strict=True)
            ),
            Contender(_CASE, PEAK, self._loop(PEAK, self._library.multiply_add, _STEPS)),
        ]

    def rates(self, times: Section) -> Section:
        """Return amounts a nanosecond, from the section that the loops were timed into; they leave it."""
        made = Section("as named", "What one core can read and compute, measured between the kernels.")
        for name, time in times.figures.pop(_CASE).items():
            made.add(_CASE, name, self._amounts[name] / time)
        return made

    def _loop(self, name: str, function: Callable[..., float], size: int) -> Callable[[int], float]:
        function.restype = ctypes.c_double  # type: ignore[attr-defined]
        amount = ctypes.c_long()

        def run(calls: int) -> float:
            time = function(ctypes.c_long(size), ctypes.c_long(calls), ctypes.byref(amount))
            self._amounts[name] = amount.value
            return time

        return run


def rate(limits: Section, name: str) -> float | None:
    """Return a rate of :meth:`Limits.rates`, or None where it was not measured."""
    return limits.get(_CASE, name)


class Bound(NamedTuple):
    """The least time of a single sample.

    Parameters
    ----------
    read, compute : float
        Time in ns to read every weight once, and to multiply and add it.
    """

    read: float
    compute: float

    @property
    def least(self) -> float:
        """The longer of both, in ns: they overlap at best."""
        return max(self.read, self.compute)


def bound(limits: Section, widths: tuple[int, ...]) -> Bound | None:
    """Return the bound of a network, or None where nothing was measured.

    As many of its weights as the first-level cache holds are read from there, the others from the second.
    """
    rates = [found for name in READS if (found := rate(limits, name)) is not None]
    peak = rate(limits, PEAK)
    if len(rates) < len(READS) or peak is None:
        return None
    size = 4 * (products(widths) + sum(widths[1:]))
    near = min(size, first_level_cache())
    return Bound(near / max(rates) + (size - near) / rates[-1], 2 * products(widths) / peak)


def products(widths: tuple[int, ...]) -> int:
    """Return the number of multiply-adds of a sample: its weights."""
    return sum(inputs * outputs for inputs, outputs in pairwise(widths))


def first_level_cache() -> int:
    """Return its size in bytes, 32 kB where the system does not say."""
    try:
        return os.sysconf("SC_LEVEL1_DCACHE_SIZE") or _CACHE
    except (AttributeError, ValueError, OSError):
        return _CACHE
