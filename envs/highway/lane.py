"""A smooth lane of highway-env along one of our paths."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...terrain import FloatArray, InvalidInputError
from ...terrain.parameters import require_in
from ..path import Path
from .dependency import import_highway_env

_lanes = import_highway_env("road.lane")
_AbstractLane: Any = _lanes.AbstractLane
_PATH_FIELDS = ("name", "x", "y", "arc_length", "heading", "curvature", "closed")


class SplineLane(_AbstractLane):  # type: ignore[misc]
    """A lane along a :class:`~grouser.envs.Path`: the one that the MPC and pure pursuit follow.

    Longitudinal is the path's arc length, lateral the distance to its left. Position, heading and curvature are
    continuous, and :meth:`local_coordinates` is the inverse of :meth:`position` up to the centre of curvature.

    Parameters
    ----------
    path : Path or mapping
        The centreline; or its fields, as :meth:`to_config` writes them.
    width : float
        In m.
    line_types : sequence of int, optional
        highway-env's line types at the two sides; continuous by default.
    forbidden : bool
        Whether changing to this lane is forbidden.
    speed_limit : float or None
        In m/s.
    priority : int
        For who has right of way.

    Raises
    ------
    InvalidInputError
        If a number is impossible, or the fields are none of a path.
    """

    def __init__(
        self,
        path: Path | Mapping[str, Any],
        width: float = 4.0,
        line_types: Sequence[int] | None = None,
        forbidden: bool = False,
        speed_limit: float | None = 20.0,
        priority: int = 0,
    ) -> None:
        require_in("lane width", width, 0.0, 1e3, low_open=True)
        self.path = path if isinstance(path, Path) else _path_of(path)
        self.width = float(width)
        self.length = self.path.length
        self.line_types = list(line_types) if line_types else [_lanes.LineType.CONTINUOUS] * 2
        self.forbidden = forbidden
        self.speed_limit = speed_limit
        self.priority = priority

    def position(self, longitudinal: float, lateral: float) -> FloatArray:
        """Return (x, y) in m at lane coordinates in m."""
        x, y = self.path.point_at(longitudinal)
        heading = self.path.heading_at(longitudinal)
        return np.array([x - lateral * math.sin(heading), y + lateral * math.cos(heading)])

    def local_coordinates(self, position: ArrayLike) -> tuple[float, float]:
        """Return lane coordinates of the nearest point of the lane, in m."""
        x, y = np.asarray(position, dtype=np.float64).tolist()
        foot = self.path.project(x, y)
        return foot.arc_length, foot.cross_track

    def heading_at(self, longitudinal: float) -> float:
        """Return the heading in rad, unwrapped."""
        return self.path.heading_at(longitudinal)

    def curvature_at(self, longitudinal: float) -> float:
        """Return the curvature in 1/m, positive where the heading grows."""
        return self.path.curvature_at(longitudinal)

    def width_at(self, longitudinal: float) -> float:
        """Return the width in m."""
        return self.width

    @classmethod
    def from_config(cls, config: Mapping[str, Any]) -> SplineLane:
        """Return the lane of a ``"config"`` that :meth:`to_config` wrote."""
        return cls(**config)

    def to_config(self) -> dict[str, Any]:
        """Return the lane as JSON can hold it; read back it is the same to the bit."""
        values = {name: getattr(self.path, name) for name in _PATH_FIELDS}
        return {
            "class_path": f"{type(self).__module__}.{type(self).__qualname__}",
            "config": {
                "path": {
                    name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in values.items()
                },
                "width": self.width,
                "line_types": list(self.line_types),
                "forbidden": self.forbidden,
                "speed_limit": self.speed_limit,
                "priority": self.priority,
            },
        }


def _path_of(fields: Mapping[str, Any]) -> Path:
    if set(fields) != set(_PATH_FIELDS):
        raise InvalidInputError(f"a path is written as {', '.join(_PATH_FIELDS)}, got {', '.join(map(str, fields))}")
    return Path(**fields)
