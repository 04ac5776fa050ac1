"""Terrain parameters θ, validated and frozen, and the ranges they are sampled from."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Final, Literal

import numpy as np

from .errors import InvalidInputError, unknown_name
from .interface import FloatArray, Interface, Mode, interface

RangeName = Literal["wide", "paper"]


def require_in(name: str, value: float, low: float, high: float, *, low_open: bool = False) -> None:
    """Raise InvalidInputError unless ``value`` is a finite number in [low, high], or (low, high] if ``low_open``."""
    inside = (
        isinstance(value, int | float | np.number)
        and not isinstance(value, bool)
        and (low < value if low_open else low <= value)
        and value <= high
    )
    if not inside:
        bracket = "(" if low_open else "["
        raise InvalidInputError(f"{name} must lie in {bracket}{low:g}, {high:g}], got {value!r}")


def require_whole(name: str, value: int, least: int, most: int | None = None) -> None:
    """Raise InvalidInputError unless ``value`` is a whole number of at least ``least``, and at most ``most``."""
    if isinstance(value, bool) or not isinstance(value, int) or value < least or (most is not None and value > most):
        interval = f"of at least {least}" if most is None else f"in [{least}, {most}]"
        raise InvalidInputError(f"{name} must be a whole number {interval}, got {value!r}")


#: Interval of every parameter, in interface order. A ground needs strength besides: μ > 0, or c and φ not both 0.
PARAMETER_LIMITS: Final[Mapping[Mode, tuple[tuple[float, float], ...]]] = {
    "rigid": ((0.0, 2.0), (0.0, 1.0), (1e-6, 1.0)),
    "soil": ((0.0, 5e5), (0.0, 1.2), (0.0, 1.0), (1e-6, 1.0)),
}


def _require_within_limits(terrain: Terrain) -> None:
    limits = zip(interface(terrain.mode).parameter_names, PARAMETER_LIMITS[terrain.mode], strict=True)
    for name, (low, high) in limits:
        require_in(name, getattr(terrain, name), low, high, low_open=name == "mu")


@dataclass(frozen=True)
class RigidTerrain:
    """Firm ground, where friction limits the shear stress: τ_max = μ p.

    Parameters
    ----------
    mu : float
        Friction coefficient, in (0, 2].
    fr : float
        Rolling resistance coefficient, in [0, 1].
    k : float
        Shear deformation modulus in m, in [1e-6, 1].

    Raises
    ------
    InvalidInputError
        If a parameter lies outside its interval.
    """

    mu: float
    fr: float = 0.03
    k: float = 0.025

    mode: ClassVar[Mode] = "rigid"

    def __post_init__(self) -> None:
        _require_within_limits(self)

    @property
    def parameters(self) -> FloatArray:
        """θ = (μ, f_r, K), shape (3,)."""
        return np.array([self.mu, self.fr, self.k])

    def parameters_at(self, x: float, y: float) -> FloatArray:
        """θ under a vehicle at (x, y) in m: the same everywhere."""
        return self.parameters

    def gradient_at(self, x: float, y: float) -> tuple[float, float]:
        """Slope of the surface at (x, y) in m: level everywhere."""
        return 0.0, 0.0


@dataclass(frozen=True)
class SoilTerrain:
    """Soil, whose strength limits the shear stress: τ_max = c + p tan φ.

    Parameters
    ----------
    c : float
        Cohesion in Pa, in [0, 500 000].
    phi : float
        Angle of internal friction in rad, in [0, 1.2]; c and phi are not both zero.
    fr : float
        Rolling resistance coefficient, in [0, 1].
    k : float
        Shear deformation modulus in m, in [1e-6, 1].

    Raises
    ------
    InvalidInputError
        If a parameter lies outside its interval, or the soil has no strength.
    """

    c: float
    phi: float
    fr: float = 0.10
    k: float = 0.025

    mode: ClassVar[Mode] = "soil"

    def __post_init__(self) -> None:
        _require_within_limits(self)
        if self.c == 0 and self.phi == 0:
            raise InvalidInputError("a soil needs strength: c and phi are both 0")

    @property
    def parameters(self) -> FloatArray:
        """θ = (c, φ, f_r, K), shape (4,)."""
        return np.array([self.c, self.phi, self.fr, self.k])

    def parameters_at(self, x: float, y: float) -> FloatArray:
        """θ under a vehicle at (x, y) in m: the same everywhere."""
        return self.parameters

    def gradient_at(self, x: float, y: float) -> tuple[float, float]:
        """Slope of the surface at (x, y) in m: level everywhere."""
        return 0.0, 0.0


Terrain = RigidTerrain | SoilTerrain


def terrain_type(mode: Mode) -> type[RigidTerrain | SoilTerrain]:
    """Return the class of the terrains of a mode."""
    return RigidTerrain if mode == "rigid" else SoilTerrain


def terrain_from_mapping(values: Mapping[str, Any]) -> Terrain:
    """Build a terrain from ``{"mode": ..., parameter: value, ...}``.

    Raises
    ------
    ConfigurationError
        If the mode or a key is unknown.
    InvalidInputError
        If a value is impossible or a required one is missing.
    """
    remaining = dict(values)
    mode = interface(remaining.pop("mode", "rigid" if "mu" in remaining else "soil")).mode
    kind = terrain_type(mode)
    known = {field.name for field in fields(kind)}
    for key in remaining:
        if key not in known:
            raise unknown_name(f"{mode} terrain parameter", key, known)
    try:
        return kind(**remaining)
    except TypeError as error:
        raise InvalidInputError(f"a {mode} terrain needs {', '.join(sorted(known))}: {error}") from error


@dataclass(frozen=True)
class ParameterRanges:
    """Box of terrain parameters that runs are drawn from and that a guard declares.

    Parameters
    ----------
    mode : {"rigid", "soil"}
        Terrain mode.
    low, high : tuple of float
        Bounds of θ, in interface order and SI units.
    """

    mode: Mode
    low: tuple[float, ...]
    high: tuple[float, ...]

    def __post_init__(self) -> None:
        size = len(self.interface.parameter_names)
        if (
            len(self.low) != size
            or len(self.high) != size
            or any(a > b for a, b in zip(self.low, self.high, strict=True))
        ):
            raise InvalidInputError(
                f"{self.mode} ranges are {size} bounds low <= high each, got {self.low} and {self.high}"
            )

    @property
    def interface(self) -> Interface:
        """The interface of the mode."""
        return interface(self.mode)

    def contains(self, terrain: Terrain) -> bool:
        """Whether a terrain of this mode lies in the box, bounds included."""
        if terrain.mode != self.mode:
            return False
        theta = terrain.parameters
        return bool(np.all(theta >= self.low) and np.all(theta <= self.high))

    def sample(self, generator: np.random.Generator) -> Terrain:
        """Draw one terrain: cohesion by the cube of a uniform draw, everything else uniform.

        Published cohesions crowd near 1-5 kPa in a range that reaches 70 kPa; the cube puts half of the draws of
        the wide range below an eighth of it.
        """
        theta = self.at(generator.random(len(self.low))).tolist()
        return RigidTerrain(*theta) if self.mode == "rigid" else SoilTerrain(*theta)

    def at(self, draw: FloatArray) -> FloatArray:
        """Return θ, shape (..., p), at places of the unit cube, shape (..., p), by the law of :meth:`sample`."""
        columns = list(draw.T)
        if self.mode == "soil" and self.low[0] == 0:
            columns[0] = columns[0] ** 3
        bounds = zip(self.low, self.high, columns, strict=True)
        return np.array([low + column * (high - low) for low, high, column in bounds]).T


_DEGREE = math.pi / 180
_RANGES: Final[dict[tuple[str, Mode], ParameterRanges]] = {
    ("wide", "rigid"): ParameterRanges("rigid", (0.1, 0.01, 0.005), (1.0, 0.20, 0.06)),
    ("wide", "soil"): ParameterRanges("soil", (0.0, 4 * _DEGREE, 0.01, 0.005), (70e3, 42 * _DEGREE, 0.20, 0.06)),
    ("paper", "rigid"): ParameterRanges("rigid", (0.4, 0.01, 0.005), (1.0, 0.10, 0.06)),
    ("paper", "soil"): ParameterRanges("soil", (1e3, 5 * _DEGREE, 0.01, 0.005), (20e3, 25 * _DEGREE, 0.10, 0.06)),
}
RANGE_NAMES: Final[tuple[RangeName, ...]] = ("wide", "paper")


def parameter_ranges(name: str, mode: str) -> ParameterRanges:
    """Return the ``wide`` or ``paper`` ranges of a mode.

    Raises
    ------
    ConfigurationError
        If the name or the mode is unknown.
    """
    checked = interface(mode).mode
    if (name, checked) not in _RANGES:
        raise unknown_name("parameter range", name, RANGE_NAMES)
    return _RANGES[name, checked]
