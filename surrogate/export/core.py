"""What an export takes of the C core: the only place that knows its files by name."""

from __future__ import annotations

from typing import Final

_PHYSICS: Final = ("src/load.c", "src/soft_cells.c", "src/soft_cells_single.c", "src/physics.c")
_EXACT: Final = ("src/exact_cells.c",)
_NETWORK: Final = ("src/dense.c", "src/dense_backward.c")
_PLAIN: Final = ("src/mlp.c",)
_STRUCTURED: Final = ("src/track_net.c",)
_GUARD: Final = ("src/detector.c", "src/guard.c")
_TICK: Final = ("src/ground.c", "src/body.c", "src/tick.c")

#: How the core marks functions that are static where its files are included into one: here they all are.
LINKAGE: Final = "GROUSER_CORE "
#: What says so in a header, and is left out.
LINKAGE_DEFINITION: Final = r"/\*[^*]*\*/\n#ifndef GROUSER_CORE\n#define GROUSER_CORE\n#endif\n"

#: Types that the public header shows, in order: of each header, what to search for.
PUBLIC_TYPES: Final[tuple[tuple[str, tuple[str, ...]], ...]] = (
    ("include/grouser/interface.h", ("GROUSER_OUTPUTS", "enum grouser_motion")),
    ("include/grouser/detector.h", ("enum grouser_reason", "GROUSER_PRIMARY_OUTPUT", "grouser_detection")),
    ("include/grouser/guard.h", ("enum grouser_guard_mode", "grouser_guard_state")),
    ("include/grouser/tick.h", ("enum grouser_status", "grouser_vehicle_state", "grouser_tick_record")),
)

#: Enumerator of the guard's header: samples that it remembers.
ENTRY_WINDOW: Final = "GROUSER_MAX_ENTRY_WINDOW"

#: Headers that declare the structs of the tables.
PHYSICS_HEADER: Final = "include/grouser/physics.h"
DENSE_HEADER: Final = "include/grouser/dense.h"
PLAIN_HEADER: Final = "include/grouser/mlp.h"
STRUCTURED_HEADER: Final = "include/grouser/track_net.h"
DETECTOR_HEADER: Final = "include/grouser/detector.h"
GUARD_HEADER: Final = "include/grouser/guard.h"
TICK_HEADER: Final = "include/grouser/tick.h"
KERNEL_HEADER: Final = "include/grouser/kernel.h"

# GROUSER_PANEL of the core's dense.h.
_PANEL: Final = 16
# Floats that its kernels store at once at the widest. Narrower layers never come there, and gcc, which cannot know,
# would warn of the bounds.
_LEAST_WIDTH: Final = 64

# The block asks for its path by name: without the exact one, its name is the soft one's.
_NO_EXACT_PATH: Final = """\
/* The fallback takes the soft path: the exact one is left out. */
#define grouser_exact_cells grouser_soft_cells
"""


def limits(widths: tuple[int, ...], wheels: int) -> dict[str, int]:
    """Return the core's limits as an artifact needs them: they are what its stack is made of.

    Parameters
    ----------
    widths : tuple of int
        Of the network's layers, inputs and outputs included.
    wheels : int
        Contact elements a side.
    """
    return {
        "GROUSER_MAX_LAYERS": len(widths) - 1,
        "GROUSER_MAX_WIDTH": padded(max(*widths, _LEAST_WIDTH)),
        # Three units a wheel, a whole number of panels together.
        "GROUSER_MAX_WHEELS": padded(wheels),
    }


def padded(width: int) -> int:
    """Return a width as the core's layers have it: whole panels."""
    return -(-width // _PANEL) * _PANEL


def core_files(*, structured: bool, exact: bool) -> tuple[str, ...]:
    """Return the C files of an artifact, by their places under ``native``.

    Parameters
    ----------
    structured : bool
        Whether the surrogate is a structured one.
    exact : bool
        Whether its fallback takes the exact shear path.
    """
    surrogate = _STRUCTURED if structured else _PLAIN
    return (*_PHYSICS, *(_EXACT if exact else ()), *_NETWORK, *surrogate, *_GUARD, *_TICK)


def preamble(*, exact: bool) -> str:
    """Return what the core's files need before them."""
    return "" if exact else _NO_EXACT_PATH
