"""A path to follow: samples at equal steps of arc length, projection onto them, and points along them."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ..terrain import FloatArray, InvalidInputError
from ..terrain.parameters import require_in
from .corridor import Corridor
from .spline import COINCIDENT, smooth_samples

_Number = TypeVar("_Number", float, FloatArray)


class Projection(NamedTuple):
    """The foot of a point on a path.

    Parameters
    ----------
    arc_length : float
        Of the foot, in m. On an open path it is negative before the start and beyond ``length`` behind the end.
    cross_track : float
        Distance to the path in m, positive where the point lies to the left of the path.
    heading : float
        Of the path at the foot, in rad, unwrapped.
    curvature : float
        Of the path at the foot, in 1/m, positive in a left turn.
    x, y : float
        Of the foot, in m.
    """

    arc_length: float
    cross_track: float
    heading: float
    curvature: float
    x: float
    y: float


@dataclass(frozen=True, eq=False)
class Path:
    """A smooth curve in the plane, sampled at equal steps of arc length. Build one with :meth:`from_points`.

    A closed path repeats its first point as its last, one turn later in heading. Arc lengths beyond the ends are
    valid everywhere: an open path goes on straight along its end tangent, a closed one wraps, its heading unwrapped.

    Parameters
    ----------
    name : str
        Short name.
    x, y : ndarray
        Points in m, shape (n,).
    arc_length : ndarray
        In m, from 0 in equal steps, shape (n,).
    heading : ndarray
        In rad, unwrapped, shape (n,).
    curvature : ndarray
        In 1/m, positive in a left turn, shape (n,).
    closed : bool
        Whether the path joins its own start.
    corridor : Corridor, optional
        Lanes that the vehicle must stay in.

    Raises
    ------
    InvalidInputError
        If the arrays differ in shape, are not finite, or the arc length does not rise in equal steps from 0.
    """

    name: str
    x: FloatArray
    y: FloatArray
    arc_length: FloatArray
    heading: FloatArray
    curvature: FloatArray
    closed: bool = False
    corridor: Corridor | None = None

    def __post_init__(self) -> None:
        for field in fields(self)[1:6]:
            values = np.array(getattr(self, field.name), dtype=np.float64)
            if values.shape != np.shape(self.x) or values.ndim != 1 or len(values) < 2:
                raise InvalidInputError(
                    f"path {self.name!r}: {field.name} must have shape (n,) like x, n >= 2, got {values.shape}"
                )
            if not np.isfinite(values).all():
                raise InvalidInputError(f"path {self.name!r}: {field.name} must be finite")
            values.flags.writeable = False
            object.__setattr__(self, field.name, values)
        # O(1) look-up rests on equal steps.
        even = np.linspace(0.0, self.arc_length[-1], len(self.x))
        if self.arc_length[-1] <= 0.0 or not np.allclose(self.arc_length, even, rtol=0.0, atol=1e-3 * even[1]):
            raise InvalidInputError(f"path {self.name!r}: arc_length must rise from 0 in equal steps")

    @classmethod
    def from_points(
        cls,
        name: str,
        points: ArrayLike,
        *,
        closed: bool = False,
        spacing: float = 0.1,
        corridor: Corridor | None = None,
    ) -> Path:
        """Pass a smooth curve (cubic spline, continuous curvature) through points.

        Parameters
        ----------
        name : str
            Short name.
        points : array_like
            Shape (n, 2), n at least 3, in m.
        closed : bool
            Whether to join the last point to the first, which is not repeated.
        spacing : float
            Step of the samples in m, in (0, 10].
        corridor : Corridor, optional
            Lanes that the vehicle must stay in.

        Raises
        ------
        InvalidInputError
            If there are fewer than 3 points, neighbours coincide, a number is not finite, or the curve turns back.
        """
        require_in("spacing", spacing, 0.0, 10.0, low_open=True)
        xy = np.array(points, dtype=np.float64)
        if xy.ndim != 2 or xy.shape[1] != 2 or len(xy) < 3:
            raise InvalidInputError(f"path {name!r}: points must have shape (n, 2) with n >= 3, got {xy.shape}")
        if not np.isfinite(xy).all():
            raise InvalidInputError(f"path {name!r}: points must be finite, got {xy[~np.isfinite(xy).all(axis=1)][0]}")
        gaps = np.hypot(*(np.roll(xy, -1, axis=0) - xy).T)[: None if closed else -1]
        if gaps.min() < COINCIDENT:
            first = int(gaps.argmin())
            raise InvalidInputError(
                f"path {name!r}: points {first} and {(first + 1) % len(xy)} coincide at {xy[first]}"
            )
        return cls(name, *smooth_samples(xy, closed=closed, spacing=spacing), closed=closed, corridor=corridor)

    @property
    def length(self) -> float:
        """In m; of a closed path, once around."""
        return self._length

    def project(
        self,
        x: float,
        y: float,
        near: float | None = None,
        *,
        window: float = 5.0,
        heading: float | None = None,
    ) -> Projection:
        """Return the foot of (x, y) on the path.

        The foot moves continuously with the point, as long as the point stays nearer to the path than its
        centre of curvature.

        Parameters
        ----------
        x, y : float
            In m.
        near : float, optional
            Arc length in m of a former foot. The search then keeps to ``window`` around it, so that it does not
            jump branches where a path crosses itself, and on a closed path the arc length counts on over the laps.
            Without it the whole path is searched and a closed path answers within [0, length).
        window : float
            Half-width of that search in m.
        heading : float, optional
            Of the vehicle in rad. Without ``near``, stretches of the path that run more than 60° off it are passed
            over, so that a vehicle at a crossing is put on the branch that it drives; unless all do.

        Raises
        ------
        InvalidInputError
            If a number is not finite.
        """
        if not math.isfinite(x + y + (0.0 if near is None else near)):
            raise InvalidInputError(f"project needs finite numbers, got x={x!r}, y={y!r}, near={near!r}")
        step, last = self._step, len(self._nodes) - 1
        first, stop = 0, last + 1
        if near is not None:
            reach = max(1, math.ceil(window / step))
            if self.closed:
                reach = min(reach, last // 2)
                middle = round(near / step)
            else:
                middle = min(max(round(near / step), 0), last)
            first, stop = middle - reach, middle + reach + 1
            if not self.closed:
                first, stop = max(first, 0), min(stop, last + 1)
        if first >= 0 and stop <= last + 1:
            dx, dy = self.x[first:stop] - x, self.y[first:stop] - y
        else:
            index = np.arange(first, stop) % last
            dx, dy = self.x[index] - x, self.y[index] - y
        distance = dx * dx + dy * dy
        if near is None and heading is not None:
            along_path = np.cos(self.heading - heading) > 0.5
            if along_path.any():
                distance = np.where(along_path, distance, math.inf)
        nearest = first + int(distance.argmin())

        # Newton on (p − c(s))·t(s) = 0 from the nearest sample; the foot lies within a step of it, or past an open end.
        s = nearest * step
        low = -math.inf if nearest == 0 and not self.closed else s - step
        high = math.inf if nearest == last and not self.closed else s + step
        for _ in range(4):
            foot_x, foot_y, direction, curvature = self._at(s)
            cosine, sine = math.cos(direction), math.sin(direction)
            along = (x - foot_x) * cosine + (y - foot_y) * sine
            cross = (y - foot_y) * cosine - (x - foot_x) * sine
            moved = min(max(s + along / max(1.0 - curvature * cross, 0.2), low), high)
            if abs(moved - s) < 1e-9:
                break
            s = moved
        if near is None and self.closed:
            lap = math.floor(s / self._length)
            s, direction = s - lap * self._length, direction - lap * self._turn
            if s >= self._length:  # a foot a rounding error before the start
                s, direction = 0.0, direction - self._turn
        return Projection(s, cross, direction, curvature, foot_x, foot_y)

    def follow(self, positions: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return arc lengths and cross-track errors in m, both (n,), of positions (n, 2) that follow one another."""
        near = 0.0
        feet: list[tuple[float, float]] = []
        for x, y in np.asarray(positions, dtype=np.float64).tolist():
            foot = self.project(x, y, near=near)
            near = foot.arc_length
            feet.append((near, foot.cross_track))
        table = np.array(feet, dtype=np.float64).reshape(-1, 2)
        return table[:, 0], table[:, 1]

    def point_at(self, arc_length: float) -> tuple[float, float]:
        """Return (x, y) in m at an arc length in m."""
        return self._at(arc_length)[:2]

    def heading_at(self, arc_length: float) -> float:
        """Return the heading in rad, unwrapped, at an arc length in m."""
        return self._at(arc_length)[2]

    def curvature_at(self, arc_length: float) -> float:
        """Return the curvature in 1/m at an arc length in m; 0 past the ends of an open path."""
        return self._at(arc_length)[3]

    def sample(self, arc_length: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return x, y in m, heading in rad (unwrapped) and curvature in 1/m, each of the shape of ``arc_length``."""
        s = np.asarray(arc_length, dtype=np.float64)
        if self.closed:
            lap, inside = np.divmod(s, self._length)
            beyond = np.zeros_like(s)
        else:
            inside = np.clip(s, 0.0, self._length)
            lap, beyond = np.zeros_like(s), s - inside
        index = np.clip((inside / self._step).astype(np.intp), 0, len(self.x) - 2)
        u = inside / self._step - index
        node, after = self._table[:, index], self._table[:, index + 1]
        x = _hermite(u, self._step, node[0], after[0], node[4], after[4])
        y = _hermite(u, self._step, node[1], after[1], node[5], after[5])
        heading = node[2] + u * (after[2] - node[2])
        curvature = np.where(beyond == 0.0, node[3] + u * (after[3] - node[3]), 0.0)
        return x + beyond * np.cos(heading), y + beyond * np.sin(heading), heading + lap * self._turn, curvature

    def _at(self, arc_length: float) -> tuple[float, float, float, float]:
        # Plain floats: a scalar look-up through NumPy costs ten times as much, and this runs several times a tick.
        s, turned = arc_length, 0.0
        if self.closed:
            lap, s = divmod(s, self._length)
            turned = lap * self._turn
        elif s < 0.0 or s > self._length:
            x, y, heading, _, cosine, sine = self._nodes[0 if s < 0.0 else -1]
            beyond = s if s < 0.0 else s - self._length
            return x + beyond * cosine, y + beyond * sine, heading, 0.0
        index = min(int(s / self._step), len(self._nodes) - 2)
        u = s / self._step - index
        x0, y0, heading0, curvature0, cosine0, sine0 = self._nodes[index]
        x1, y1, heading1, curvature1, cosine1, sine1 = self._nodes[index + 1]
        return (
            _hermite(u, self._step, x0, x1, cosine0, cosine1),
            _hermite(u, self._step, y0, y1, sine0, sine1),
            heading0 + u * (heading1 - heading0) + turned,
            curvature0 + u * (curvature1 - curvature0),
        )

    @cached_property
    def _length(self) -> float:
        return float(self.arc_length[-1])

    @cached_property
    def _step(self) -> float:
        return self._length / (len(self.x) - 1)

    @cached_property
    def _turn(self) -> float:
        return float(self.heading[-1] - self.heading[0])

    @cached_property
    def _table(self) -> FloatArray:
        return np.stack([self.x, self.y, self.heading, self.curvature, np.cos(self.heading), np.sin(self.heading)])

    @cached_property
    def _nodes(self) -> list[Any]:
        return list(map(tuple, self._table.T.tolist()))


def _hermite(u: _Number, step: float, start: _Number, end: _Number, slope0: _Number, slope1: _Number) -> _Number:
    v = 1.0 - u
    return v * v * (1.0 + 2.0 * u) * start + u * u * (3.0 - 2.0 * u) * end + step * u * v * (v * slope0 - u * slope1)
