"""Lanes that a vehicle must stay in, and by how far it leaves them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..terrain import FloatArray, InvalidInputError


class Lane(NamedTuple):
    """A rectangle along the x axis: from ``start`` to ``end``, between the edges ``right`` < ``left``, all in m."""

    start: float
    end: float
    right: float
    left: float

    @property
    def width(self) -> float:
        """In m."""
        return self.left - self.right

    @property
    def center(self) -> float:
        """The centreline's y in m."""
        return (self.left + self.right) / 2


@dataclass(frozen=True)
class Corridor:
    """Lanes along the x axis; between them the vehicle may be anywhere.

    Parameters
    ----------
    lanes : tuple of Lane
        In order of x, without overlap.

    Raises
    ------
    InvalidInputError
        If a lane is empty or not finite, or two overlap.
    """

    lanes: tuple[Lane, ...]

    def __post_init__(self) -> None:
        for lane in self.lanes:
            if not (all(map(math.isfinite, lane)) and lane.start < lane.end and lane.right < lane.left):
                raise InvalidInputError(f"a lane needs finite start < end and right < left, got {lane}")
        for lane, after in pairwise(self.lanes):
            if after.start < lane.end:
                raise InvalidInputError(f"lanes must follow one another, got one to x = {lane.end:g} before {after}")

    def violation(self, x: float, y: float, heading: float, length: float, width: float) -> float:
        """Return how far the vehicle sticks out of the lanes: :meth:`violations` of one pose, in m."""
        return float(self.violations(x, y, heading, length, width))

    def violations(self, x: ArrayLike, y: ArrayLike, heading: ArrayLike, length: float, width: float) -> FloatArray:
        """Return how far the vehicle sticks out of the lanes at each pose.

        Each corner of the footprint is held against the lane whose x interval it lies in.

        Parameters
        ----------
        x, y : array_like
            Centre of the footprint in m, any shape.
        heading : array_like
            In rad, same shape.
        length, width : float
            Of the rectangular footprint, in m.

        Returns
        -------
        ndarray
            Largest distance of a corner beyond its lane in m, same shape; 0 with all corners in lanes or between.
        """
        ahead = np.array([0.5, 0.5, -0.5, -0.5]) * length
        aside = np.array([0.5, -0.5, -0.5, 0.5]) * width
        angle = np.asarray(heading, dtype=np.float64)[..., None]
        corner_x = np.asarray(x, dtype=np.float64)[..., None] + ahead * np.cos(angle) - aside * np.sin(angle)
        corner_y = np.asarray(y, dtype=np.float64)[..., None] + ahead * np.sin(angle) + aside * np.cos(angle)
        out = np.zeros_like(corner_y)
        for lane in self.lanes:
            within = (lane.start <= corner_x) & (corner_x <= lane.end)
            out = np.maximum(out, np.where(within, np.maximum(lane.right - corner_y, corner_y - lane.left), 0.0))
        worst: FloatArray = out.max(axis=-1)
        return worst
