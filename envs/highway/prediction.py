"""Where a vehicle will be if its belts hold a command."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ...terrain import FloatArray
from ..state import BeltCommand
from .motion import Motion


def predict(motion: Motion, command: BeltCommand, times: ArrayLike) -> tuple[list[FloatArray], list[float]]:
    """Return positions in m, each of shape (2,), and headings in rad; the motion itself stays where it is.

    Parameters
    ----------
    motion : Motion
        Of the vehicle now.
    command : BeltCommand
        That is held.
    times : array_like, shape (n,)
        From now in s, in their order, each to the nearest tick.
    """
    moved = motion.copy()
    positions: list[FloatArray] = []
    headings: list[float] = []
    elapsed = 0
    for time in np.asarray(times, dtype=np.float64).tolist():
        ticks = round(time / moved.tick) - elapsed
        if ticks > 0:
            moved.advance(command, ticks)
            elapsed += ticks
        x, y, heading, *_ = moved.kinematics()
        positions.append(np.array([x, y]))
        headings.append(heading)
    return positions, headings
