"""The ground under a moving vehicle: anything that gives θ and the slope at a position."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from typing import Protocol

from .errors import InvalidInputError
from .field_file import FIELD_SUFFIX, load_field
from .interface import FloatArray, Mode
from .named import named
from .parameters import require_in

Gradient = tuple[float, float]


class Ground(Protocol):
    """One terrain mode, and its parameters and slope at every position.

    Every terrain is a ground that is alike everywhere, and level.
    """

    @property
    def mode(self) -> Mode:
        """Terrain mode."""

    def parameters_at(self, x: float, y: float) -> FloatArray:
        """Return θ at (x, y) in m, in interface order."""

    def gradient_at(self, x: float, y: float) -> Gradient:
        """Return (∂z/∂x, ∂z/∂y) of the surface at (x, y) in m."""


@dataclass(frozen=True)
class SlopedGround:
    """A ground on a plane that is tilted, added to whatever slope it has of its own.

    Parameters
    ----------
    ground : Ground
        What the plane consists of.
    grade : float
        Slope along the plane's x axis in rad, in (−π/4, π/4); positive where x leads uphill.
    bank : float
        Slope along its y axis in rad, in (−π/4, π/4); positive where y leads uphill.

    Raises
    ------
    InvalidInputError
        If a slope is out of range.
    """

    ground: Ground
    grade: float = 0.0
    bank: float = 0.0

    def __post_init__(self) -> None:
        for name in ("grade", "bank"):
            require_in(name, getattr(self, name), -math.pi / 4, math.pi / 4)

    @property
    def mode(self) -> Mode:
        """Terrain mode."""
        return self.ground.mode

    def parameters_at(self, x: float, y: float) -> FloatArray:
        """Return θ of the ground itself."""
        return self.ground.parameters_at(x, y)

    def gradient_at(self, x: float, y: float) -> Gradient:
        """Return (tan grade, tan bank) plus the ground's own gradient."""
        along, aside = self.ground.gradient_at(x, y)
        return along + math.tan(self.grade), aside + math.tan(self.bank)


def resolve_ground(ground: str | os.PathLike[str] | Ground) -> Ground:
    """Return a ground given by name, by a TOML or ``.npz`` file, or as itself.

    Raises
    ------
    ConfigurationError
        If the name is unknown.
    InvalidInputError
        If it is something else, or the file cannot be read.
    """
    if isinstance(ground, str | os.PathLike):
        return load_field(ground) if os.fspath(ground).endswith(FIELD_SUFFIX) else named(ground)
    for member in ("mode", "parameters_at", "gradient_at"):
        if not hasattr(ground, member):
            raise InvalidInputError(
                f"a ground has mode, parameters_at and gradient_at, got {ground!r} without {member}"
            )
    return ground
