"""The ground under a moving vehicle: anything that gives θ at a position."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from .errors import ConfigurationError, InvalidInputError
from .interface import FloatArray, Mode
from .named import named
from .parameters import Terrain


class Ground(Protocol):
    """One terrain mode, and its parameters at every position. Every terrain is a ground that is alike everywhere."""

    @property
    def mode(self) -> Mode:
        """Terrain mode."""

    def parameters_at(self, x: float, y: float) -> FloatArray:
        """Return θ at (x, y) in m, in interface order."""


@dataclass(frozen=True)
class SteppedTerrain:
    """One terrain up to a line across the x axis and another beyond it.

    Parameters
    ----------
    before, beyond : Terrain
        Of the same mode.
    boundary : float
        x in m of the line.

    Raises
    ------
    ConfigurationError
        If the modes differ.
    InvalidInputError
        If the boundary is not finite.
    """

    before: Terrain
    beyond: Terrain
    boundary: float

    def __post_init__(self) -> None:
        if not math.isfinite(self.boundary):
            raise InvalidInputError(f"boundary must be finite, got {self.boundary!r}")
        if self.before.mode != self.beyond.mode:
            raise ConfigurationError(
                f"a ground has one mode, got {self.before.mode} before and {self.beyond.mode} beyond the boundary"
            )

    @property
    def mode(self) -> Mode:
        """Terrain mode."""
        return self.before.mode

    def parameters_at(self, x: float, y: float) -> FloatArray:
        """Return θ of the side that (x, y) lies on."""
        return (self.before if x < self.boundary else self.beyond).parameters


def resolve_ground(ground: str | Ground) -> Ground:
    """Return a ground given by name or as itself.

    Raises
    ------
    ConfigurationError
        If it is neither.
    """
    if not isinstance(ground, str) and hasattr(ground, "mode") and hasattr(ground, "parameters_at"):
        return ground
    return named(str(ground))
