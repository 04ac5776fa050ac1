"""Reference speed along a path: a target, less in curves, and rest at the end where that is asked for."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from ..envs.path import Path
from ..terrain import FloatArray
from ..terrain.parameters import require_in

_STEP: Final = 0.25


@dataclass(frozen=True, eq=False)
class SpeedProfile:
    """Speed over arc length, linear between equal steps. Build one with :meth:`along`.

    Parameters
    ----------
    speed : ndarray
        In m/s, at equal steps of arc length from 0 to ``length``, shape (n,).
    length : float
        Of the path in m.
    closed : bool
        Whether the path joins its own start.
    """

    speed: FloatArray
    length: float
    closed: bool

    @classmethod
    def along(
        cls,
        path: Path,
        target: float,
        *,
        lateral_acceleration: float = math.inf,
        acceleration: float = 1.0,
        stop_at_end: bool = False,
    ) -> SpeedProfile:
        """Return the fastest profile within the limits.

        Parameters
        ----------
        path : Path
            The path.
        target : float
            In m/s, positive; nowhere exceeded.
        lateral_acceleration : float
            Limit on speed² · |curvature| in m/s², positive.
        acceleration : float
            Limit on speeding up and slowing down along the path in m/s², positive. The vehicle is taken to arrive
            at the profile's first speed.
        stop_at_end : bool
            Whether to come to rest at the end of an open path; a closed path has none.

        Raises
        ------
        InvalidInputError
            If a limit is out of range.
        """
        require_in("target", target, 0.0, 1e3, low_open=True)
        require_in("lateral_acceleration", lateral_acceleration, 0.0, math.inf, low_open=True)
        require_in("acceleration", acceleration, 0.0, 1e3, low_open=True)
        count = max(2, math.ceil(path.length / _STEP) + 1)
        arc_length, step = np.linspace(0.0, path.length, count, retstep=True)
        curvature = np.abs(path.sample(arc_length)[3])
        square = np.minimum(target**2, lateral_acceleration / np.maximum(curvature, 1e-9))
        if stop_at_end and not path.closed:
            square[-1] = 0.0
        gain = 2 * acceleration * float(step)
        # Twice around a closed path carries every limit past the join.
        for _ in range(2 if path.closed else 1):
            for i in range(1, count):
                square[i] = min(square[i], square[i - 1] + gain)
            for i in range(count - 2, -1, -1):
                square[i] = min(square[i], square[i + 1] + gain)
            if path.closed:
                square[0] = square[-1] = min(square[0], square[-1])
        return cls(np.sqrt(square), path.length, path.closed)

    def at(self, arc_length: ArrayLike) -> FloatArray:
        """Return the speed in m/s at arc lengths in m; past the ends of an open path, that of the end."""
        s = np.asarray(arc_length, dtype=np.float64)
        inside = np.mod(s, self.length) if self.closed else s
        return np.interp(inside, np.linspace(0.0, self.length, len(self.speed)), self.speed)
