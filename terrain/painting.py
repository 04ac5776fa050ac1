"""Paint a terrain field: patches of other ground, smooth noise, hills, all rasterised into one regular grid."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from .errors import ConfigurationError, InvalidInputError, unknown_name
from .field import Outside, TerrainField, grid_shape
from .interface import FloatArray, interface
from .parameters import Terrain, require_in, require_whole

_WAVES: Final = 64


class Shape(Protocol):
    """A part of the plane."""

    def covers(self, x: FloatArray, y: FloatArray) -> NDArray[np.bool_]:
        """Return whether each position in m lies in the shape."""


@dataclass(frozen=True)
class Rectangle:
    """Axis-parallel; a side at ±∞ makes it a strip or a half plane.

    Parameters
    ----------
    x_min, x_max, y_min, y_max : float
        In m.
    """

    x_min: float = -math.inf
    x_max: float = math.inf
    y_min: float = -math.inf
    y_max: float = math.inf

    def __post_init__(self) -> None:
        if not (self.x_min < self.x_max and self.y_min < self.y_max):
            raise InvalidInputError(f"a rectangle needs x_min < x_max and y_min < y_max, got {self}")

    def covers(self, x: FloatArray, y: FloatArray) -> NDArray[np.bool_]:
        """Return whether each position lies in the rectangle."""
        inside: NDArray[np.bool_] = (x >= self.x_min) & (x < self.x_max) & (y >= self.y_min) & (y < self.y_max)
        return inside


@dataclass(frozen=True)
class Disc:
    """A disc.

    Parameters
    ----------
    x, y : float
        Centre in m.
    radius : float
        In m.
    """

    x: float
    y: float
    radius: float

    def __post_init__(self) -> None:
        for name in ("x", "y"):
            require_in(name, getattr(self, name), -1e9, 1e9)
        require_in("radius", self.radius, 0.0, 1e9, low_open=True)

    def covers(self, x: FloatArray, y: FloatArray) -> NDArray[np.bool_]:
        """Return whether each position lies in the disc."""
        inside: NDArray[np.bool_] = np.hypot(x - self.x, y - self.y) <= self.radius
        return inside


@dataclass(frozen=True)
class Patch:
    """Another ground in a part of the plane.

    Parameters
    ----------
    terrain : Terrain
        What it consists of.
    shape : Shape
        Where it lies.
    """

    terrain: Terrain
    shape: Shape


@dataclass(frozen=True)
class Noise:
    """Smooth random change of the parameters, or of a height: a Gaussian field of unit variance.

    A sum of 64 plane waves with normally distributed wave vectors, so that its correlation at distance r is
    exp(−r²/2ℓ²). It is a function of position and seed alone, whatever the grid that it is sampled on.

    Parameters
    ----------
    correlation_length : float
        ℓ in m.
    seed : int
        Of the waves.
    """

    correlation_length: float
    seed: int = 0

    def __post_init__(self) -> None:
        require_in("correlation_length", self.correlation_length, 0.0, 1e9, low_open=True)
        require_whole("seed", self.seed, 0)

    def __call__(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the noise at each position."""
        generator = np.random.default_rng(self.seed)
        waves = generator.normal(0.0, 1.0 / self.correlation_length, (_WAVES, 2))
        phases = generator.uniform(0.0, 2 * math.pi, _WAVES)
        total = np.zeros(np.broadcast(x, y).shape)
        for (along, aside), phase in zip(waves, phases, strict=True):
            total += np.cos(along * x + aside * y + phase)
        return math.sqrt(2.0 / _WAVES) * total


def paint_field(
    base: Terrain,
    extent: tuple[float, float, float, float],
    *,
    spacing: float = 0.5,
    patches: Sequence[Patch] = (),
    noise: Noise | None = None,
    noise_amplitude: Mapping[str, float] | None = None,
    elevation: Callable[[FloatArray, FloatArray], Any] | None = None,
    outside: Outside = "refuse",
) -> TerrainField:
    """Rasterise a ground into one field.

    Parameters
    ----------
    base : Terrain
        Ground where no patch lies.
    extent : tuple of float
        (x_min, x_max, y_min, y_max) in m.
    spacing : float
        Edge of a cell in m; a border between grounds is two cells wide.
    patches : sequence of Patch
        Of the same mode; later ones lie on top of earlier ones.
    noise : Noise, optional
        Multiplies each parameter by exp(amplitude · noise), all of them by the same noise.
    noise_amplitude : mapping of str to float
        Amplitude by parameter name, such as ``{"mu": 0.1}``; parameters that are not named stay as they are.
    elevation : callable, optional
        Height z in m of positions x, y in m (arrays), such as ``lambda x, y: 0.5 * Noise(10.0)(x, y)``.
    outside : {"refuse", "extend"}
        Rule for positions beyond the map; see :class:`~grouser.terrain.TerrainField`.

    Raises
    ------
    ConfigurationError
        If the modes differ, or a parameter's name is unknown.
    InvalidInputError
        If the extent is empty, or noise leads to parameters that no terrain has.
    """
    names = interface(base.mode).parameter_names
    rows, columns = grid_shape(extent, spacing)
    x_min, _, y_min, _ = extent
    x, y = np.meshgrid(x_min + (np.arange(columns) + 0.5) * spacing, y_min + (np.arange(rows) + 0.5) * spacing)
    parameters = np.broadcast_to(base.parameters, (rows, columns, len(names))).copy()
    for patch in patches:
        if patch.terrain.mode != base.mode:
            raise ConfigurationError(
                f"a field has one mode, got {base.mode} ground with a {patch.terrain.mode} patch; "
                "a hard patch in soil is c = 0, phi = atan(mu)"
            )
        parameters[patch.shape.covers(x, y)] = patch.terrain.parameters
    if bool(noise_amplitude) != (noise is not None):
        raise ConfigurationError("noise and noise_amplitude go together: give both or neither")
    for name, amplitude in (noise_amplitude or {}).items():
        if name not in names:
            raise unknown_name(f"{base.mode} terrain parameter", name, names)
        require_in(f"noise amplitude of {name}", amplitude, 0.0, 2.0)
        if noise is not None:
            parameters[..., names.index(name)] *= np.exp(amplitude * noise(x, y))
    heights = None if elevation is None else np.broadcast_to(elevation(x, y), x.shape)
    return TerrainField(base.mode, (x_min, y_min), spacing, parameters, heights, outside)
