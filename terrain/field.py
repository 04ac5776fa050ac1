"""Ground that changes along the way: terrain parameters, and elevation if there is any, on one regular grid."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final, Literal, NamedTuple

import numpy as np

from .errors import InvalidInputError, OffMapError, unknown_name
from .interface import FloatArray, Mode, interface
from .parameters import PARAMETER_LIMITS, Terrain, require_in, terrain_type

Outside = Literal["refuse", "extend"]
OUTSIDE_RULES: Final[tuple[Outside, ...]] = ("refuse", "extend")


@dataclass(frozen=True, eq=False)
class TerrainField:
    """One terrain mode whose parameters change with the position.

    Each cell of the grid holds the parameters at its centre. Between the centres they follow a quadratic B-spline, a
    weighted mean of the nine cells around a position: smooth across cell borders, never outside the range of those
    nine, and exact where the ground is uniform. A border between two grounds is two cells wide.

    Parameters
    ----------
    mode : {"rigid", "soil"}
        Terrain mode; a hard patch in soil has c = 0, φ = atan μ.
    origin : tuple of float
        (x, y) in m of the map's corner with the lowest coordinates.
    spacing : float
        Edge of a cell in m.
    parameters : ndarray, shape (rows, columns, p)
        θ by cell in interface order; rows along y, columns along x.
    elevation : ndarray, shape (rows, columns), optional
        Height z of the surface in m by cell; level without.
    outside : {"refuse", "extend"}
        What a position beyond the map gets: an error that names it, or the ground of the nearest border.

    Raises
    ------
    InvalidInputError
        If a shape does not fit, a number is not finite or no terrain has such parameters.
    ConfigurationError
        If the mode or the rule is unknown.
    """

    mode: Mode
    origin: tuple[float, float]
    spacing: float
    parameters: FloatArray
    elevation: FloatArray | None = None
    outside: Outside = "refuse"
    _padded: FloatArray = field(init=False, repr=False)
    _heights: FloatArray | None = field(init=False, repr=False)

    def __post_init__(self) -> None:
        names = interface(self.mode).parameter_names
        if self.outside not in OUTSIDE_RULES:
            raise unknown_name("rule for positions outside the map", self.outside, OUTSIDE_RULES)
        if len(self.origin) != 2 or not all(math.isfinite(value) for value in self.origin):
            raise InvalidInputError(f"origin must be a finite pair (x, y) in m, got {self.origin!r}")
        require_in("spacing", self.spacing, 0.0, 1e6, low_open=True)
        object.__setattr__(self, "parameters", _frozen(self.parameters))
        shape = self.parameters.shape
        if len(shape) != 3 or shape[2] != len(names) or 0 in shape:
            raise InvalidInputError(
                f"parameters of a {self.mode} field have shape (rows, columns, {len(names)}): {', '.join(names)}; "
                f"got shape {shape}"
            )
        _check_parameters(self.mode, self.parameters)
        if self.elevation is not None:
            object.__setattr__(self, "elevation", _frozen(self.elevation))
            if self.elevation.shape != shape[:2] or not np.all(np.isfinite(self.elevation)):
                raise InvalidInputError(
                    f"elevation must hold a finite height for each of {shape[0]} x {shape[1]} cells, "
                    f"got shape {self.elevation.shape}"
                )
        object.__setattr__(self, "_padded", _padded(self.parameters))
        object.__setattr__(self, "_heights", None if self.elevation is None else _padded(self.elevation))

    @classmethod
    def uniform(
        cls,
        terrain: Terrain,
        extent: tuple[float, float, float, float],
        *,
        spacing: float = 1.0,
        outside: Outside = "refuse",
    ) -> TerrainField:
        """Return a field of one terrain over (x_min, x_max, y_min, y_max) in m."""
        rows, columns = grid_shape(extent, spacing)
        parameters = np.broadcast_to(terrain.parameters, (rows, columns, len(terrain.parameters)))
        return cls(terrain.mode, (extent[0], extent[2]), spacing, parameters, outside=outside)

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """(x_min, x_max, y_min, y_max) of the map in m."""
        rows, columns = self.parameters.shape[:2]
        x, y = self.origin
        return x, x + columns * self.spacing, y, y + rows * self.spacing

    def covers(self, x: float, y: float) -> bool:
        """Whether (x, y) lies on the map, its border included."""
        x_min, x_max, y_min, y_max = self.extent
        return x_min <= x <= x_max and y_min <= y <= y_max

    def parameters_at(self, x: float, y: float) -> FloatArray:
        """Return θ at (x, y), shape (p,).

        Raises
        ------
        InvalidInputError
            If the position is not finite, or off the map of a field that refuses it.
        """
        row, column, across, along = self._stencil(x, y)
        cells = self._padded[row : row + 3, column : column + 3].reshape(9, -1)
        # Differences from the nearest cell, so that uniform ground is returned to the bit.
        theta: FloatArray = cells[4] + np.outer(across.weights, along.weights).ravel() @ (cells - cells[4])
        return theta

    def elevation_at(self, x: float, y: float) -> float:
        """Return the height z in m at (x, y); 0 for a field without elevation. Raises like :meth:`parameters_at`."""
        row, column, across, along = self._stencil(x, y)
        if self._heights is None:
            return 0.0
        return float(across.weights @ self._heights[row : row + 3, column : column + 3] @ along.weights)

    def gradient_at(self, x: float, y: float) -> tuple[float, float]:
        """Return (∂z/∂x, ∂z/∂y) of the elevation's spline at (x, y). Raises like :meth:`parameters_at`."""
        if self._heights is None:
            self._check_position(x, y)
            return 0.0, 0.0
        row, column, across, along = self._stencil(x, y)
        heights = self._heights[row : row + 3, column : column + 3]
        by_x, by_y = across.weights @ heights @ along.slopes, across.slopes @ heights @ along.weights
        return float(by_x) / self.spacing, float(by_y) / self.spacing

    def _stencil(self, x: float, y: float) -> tuple[int, int, _Spline, _Spline]:
        """Return the first row and column of the nine cells around a position, in the padded grid, and their splines."""
        self._check_position(x, y)
        rows, columns = self.parameters.shape[:2]
        row, across = _spline((y - self.origin[1]) / self.spacing, rows)
        column, along = _spline((x - self.origin[0]) / self.spacing, columns)
        return row, column, across, along

    def _check_position(self, x: float, y: float) -> None:
        if not (math.isfinite(x) and math.isfinite(y)):
            raise InvalidInputError(f"a position on the ground must be finite, got ({x!r}, {y!r})")
        if self.outside == "refuse" and not self.covers(x, y):
            x_min, x_max, y_min, y_max = self.extent
            raise OffMapError(
                f"({x:.3f}, {y:.3f}) m lies off the terrain field's map, x {x_min:g} to {x_max:g} and y {y_min:g} to "
                f"{y_max:g} m; make the map larger, or let its borders go on with outside='extend'"
            )


class _Spline(NamedTuple):
    """Weights of three neighbouring cells, and their slopes by the position in cells."""

    weights: FloatArray
    slopes: FloatArray


def _spline(position: float, count: int) -> tuple[int, _Spline]:
    """Return the cell at a position in cells from the map's edge, and the spline over it and its two neighbours.

    Weights ½(½ − u)², ¾ − u², ½(½ + u)² with u ∈ [−½, ½] from the centre of the cell. Beyond the map they stay.
    """
    limited = min(max(position, 0.0), float(count))
    cell = min(int(limited), count - 1)
    u = limited - cell - 0.5
    weights = np.array([0.5 * (0.5 - u) ** 2, 0.75 - u * u, 0.5 * (0.5 + u) ** 2])
    return cell, _Spline(weights, np.array([u - 0.5, -2.0 * u, u + 0.5]) if limited == position else np.zeros(3))


def _padded(values: FloatArray) -> FloatArray:
    """Repeat the outermost cells once around the map."""
    return np.pad(values, [(1, 1), (1, 1)] + [(0, 0)] * (values.ndim - 2), mode="edge")


def grid_shape(extent: tuple[float, float, float, float], spacing: float) -> tuple[int, int]:
    """Return (rows, columns) of the cells that cover (x_min, x_max, y_min, y_max); the last may reach beyond.

    Raises
    ------
    InvalidInputError
        If the extent is empty or not finite, or holds more than 10⁸ cells.
    """
    require_in("spacing", spacing, 0.0, 1e6, low_open=True)
    x_min, x_max, y_min, y_max = extent
    if not (all(map(math.isfinite, extent)) and x_min < x_max and y_min < y_max):
        raise InvalidInputError(f"extent must be (x_min, x_max, y_min, y_max) with min < max, finite, got {extent!r}")
    rows, columns = (math.ceil((high - low) / spacing - 1e-9) for low, high in ((y_min, y_max), (x_min, x_max)))
    if rows * columns > 10**8:
        raise InvalidInputError(f"{rows} x {columns} cells are too many: choose a spacing above {spacing:g} m")
    return rows, columns


def _frozen(values: FloatArray) -> FloatArray:
    given = np.asarray(values)
    if given.dtype.kind not in "fiu":
        raise InvalidInputError(f"a field holds real numbers, got an array of {given.dtype}")
    copy = given.astype(np.float64)
    copy.setflags(write=False)
    return copy


def _check_parameters(mode: Mode, parameters: FloatArray) -> None:
    """Raise for the first cell whose parameters no terrain can have."""
    low, high = np.array(PARAMETER_LIMITS[mode]).T
    strength = parameters[..., :-2].sum(axis=-1)
    good = np.all((parameters >= low) & (parameters <= high), axis=-1) & (strength > 0)
    if not np.all(good):
        row, column = np.argwhere(~good)[0].tolist()
        try:
            terrain_type(mode)(*parameters[row, column].tolist())
        except InvalidInputError as error:
            raise InvalidInputError(f"row {row}, column {column} of the field: {error}") from error
