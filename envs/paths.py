"""The paths of the testbed, each starting at the origin, and how to get one by name or from a file."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from itertools import pairwise
from typing import Final

import numpy as np

from ..terrain import FloatArray, TrackedVehicle, unknown_name
from ..terrain.parameters import require_in
from .corridor import Corridor, Lane
from .path import Path
from .path_file import path_from_csv

_STEP: Final = 0.1


def straight(length: float = 120.0) -> Path:
    """Return a straight path along the x axis, ``length`` in m.

    Raises
    ------
    InvalidInputError
        If the length does not lie in (0, 10 000].
    """
    require_in("length", length, 0.0, 1e4, low_open=True)
    return Path.from_points("straight", [[0.0, 0.0], [length / 2, 0.0], [length, 0.0]])


def circle(radius: float = 15.0) -> Path:
    """Return a closed circle to the left that starts along the x axis, ``radius`` in m.

    Raises
    ------
    InvalidInputError
        If the radius does not lie in [1, 1000].
    """
    require_in("radius", radius, 1.0, 1e3)
    angle = _closed_parameter(2 * math.pi * radius)
    return Path.from_points("circle", radius * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)]), closed=True)


def sine(amplitude: float = 3.0, wavelength: float = 40.0, length: float = 160.0) -> Path:
    """Return y = amplitude · sin(2π x / wavelength), all in m.

    Parameters
    ----------
    amplitude : float
        In [0, 100].
    wavelength : float
        In [1, 1000].
    length : float
        Extent along x; a whole number of half waves ends the path where its curvature is zero.

    Raises
    ------
    InvalidInputError
        If a number is out of range.
    """
    require_in("amplitude", amplitude, 0.0, 100.0)
    require_in("wavelength", wavelength, 1.0, 1e3)
    require_in("length", length, 0.0, 1e4, low_open=True)
    x = np.linspace(0.0, length, max(3, math.ceil(length / min(_STEP, wavelength / 100)) + 1))
    return Path.from_points("sine", np.column_stack([x, amplitude * np.sin(2 * math.pi * x / wavelength)]))


def figure_eight(radius: float = 15.0) -> Path:
    """Return a closed figure eight that starts at its crossing, along the x axis, with the lobe to the left first.

    It is the lemniscate of Bernoulli, whose curvature changes smoothly from 0 at the crossing to 1/radius at the
    far ends of the lobes: a vehicle can follow it exactly, which the jump between two tangent circles forbids.

    Parameters
    ----------
    radius : float
        Smallest radius of curvature in m, in [1, 1000]. The path is 15.73 radii long.

    Raises
    ------
    InvalidInputError
        If the radius is out of range.
    """
    require_in("radius", radius, 1.0, 1e3)
    # Half-width a: the curvature of the lemniscate is 3 r/a², at most 3/a.
    half_width = 3.0 * radius
    angle = _closed_parameter(5.25 * half_width) - math.pi / 2
    reach = half_width * np.cos(angle) / (1.0 + np.sin(angle) ** 2)
    lobe_x, lobe_y = reach, reach * np.sin(angle)
    # The branch leaves the crossing at −45°: turned by +45°, it starts along x and curves to the left.
    return Path.from_points(
        "figure-eight", np.column_stack([lobe_x - lobe_y, lobe_x + lobe_y]) / math.sqrt(2.0), closed=True
    )


def iso_3888_1(overall_width: float, *, run_in: float = 10.0, run_out: float = 10.0) -> Path:
    """Return the double lane change of ISO 3888-1, to the left and back, with its lanes as the corridor.

    ISO 3888-1:2018, "Passenger cars — Test track for a severe lane-change manoeuvre — Part 1: Double
    lane-change", Table 1, with w the overall width of the vehicle:

    ======= ====== ============ ======================================================
    section length lane width   lane
    ======= ====== ============ ======================================================
    1       15 m   1.1 w + 0.25 right boundary at y₀
    2       30 m                transition
    3       25 m   1.2 w + 0.25 right boundary at y₀ + 3.5 m (the lane offset)
    4       25 m                transition
    5       15 m   1.3 w + 0.25 right boundary at y₀
    6       15 m   1.3 w + 0.25 right boundary at y₀
    ======= ====== ============ ======================================================

    The lane offset is read as the distance between the right-hand boundaries. As the widths differ, so do the
    centrelines: from lane 1, lane 3 lies 3.5 + 0.05 w to the left, lanes 5 and 6 lie 0.1 w to the left.

    The standard fixes lanes, no line in them. The reference here runs along the lane centres and crosses each
    transition by a quintic smoothstep, whose curvature starts and ends at zero. The origin is its start, y = 0 the
    centreline of lane 1, and section 1 begins at x = ``run_in``.

    Parameters
    ----------
    overall_width : float
        w in m, in (0, 10].
    run_in, run_out : float
        Straight line before section 1 and behind section 6 in m, in [0, 1000].

    Raises
    ------
    InvalidInputError
        If a number is out of range.
    """
    require_in("overall_width", overall_width, 0.0, 10.0, low_open=True)
    require_in("run_in", run_in, 0.0, 1e3)
    require_in("run_out", run_out, 0.0, 1e3)
    right = -(1.1 * overall_width + 0.25) / 2

    def lane(start: float, length: float, factor: float, offset: float) -> Lane:
        edge = right + offset
        return Lane(run_in + start, run_in + start + length, edge, edge + factor * overall_width + 0.25)

    lanes = (lane(0, 15, 1.1, 0), lane(45, 25, 1.2, 3.5), lane(95, 15, 1.3, 0), lane(110, 15, 1.3, 0))
    end = run_in + 125.0 + run_out
    x = np.linspace(0.0, end, math.ceil(end / _STEP) + 1)
    y = np.full_like(x, lanes[0].center)
    for before, after in pairwise(lanes):
        if after.start > before.end:
            y += (after.center - before.center) * _smoothstep((x - before.end) / (after.start - before.end))
    return Path.from_points("iso-3888-1", np.column_stack([x, y]), corridor=Corridor(lanes))


def _smoothstep(u: FloatArray) -> FloatArray:
    """From 0 to 1 over [0, 1], with first and second derivative zero at both ends."""
    v = np.clip(u, 0.0, 1.0)
    step: FloatArray = v**3 * (10.0 + v * (6.0 * v - 15.0))
    return step


def _closed_parameter(length: float) -> FloatArray:
    """[0, 2π) in steps that are about ``_STEP`` of a curve of that length in m."""
    count = max(100, math.ceil(length / _STEP))
    return np.linspace(0.0, 2 * math.pi, count, endpoint=False, dtype=np.float64)


_PATHS: Final[dict[str, Callable[[TrackedVehicle], Path]]] = {
    "straight": lambda vehicle: straight(),
    "circle": lambda vehicle: circle(),
    "sine": lambda vehicle: sine(),
    "figure-eight": lambda vehicle: figure_eight(),
    "iso-3888-1": lambda vehicle: iso_3888_1(vehicle.overall_width),
}


def path_names() -> tuple[str, ...]:
    """Names that :func:`make_path` knows, sorted."""
    return tuple(sorted(_PATHS))


def make_path(name_or_file: str | os.PathLike[str], vehicle: TrackedVehicle) -> Path:
    """Return a path by name or from a CSV file.

    Parameters
    ----------
    name_or_file : str or path-like
        One of :func:`path_names`, or a file: a string that ends in ``.csv``, or any path-like object.
    vehicle : TrackedVehicle
        Sets the lane widths of ``iso-3888-1``.

    Raises
    ------
    ConfigurationError
        If the name is unknown.
    InvalidInputError
        If the file does not hold a path.

    Examples
    --------
    >>> round(make_path("iso-3888-1", TrackedVehicle.preset("m113")).corridor.lanes[0].width, 4)
    3.0429
    """
    if isinstance(name_or_file, os.PathLike) or str(name_or_file).lower().endswith(".csv"):
        return path_from_csv(name_or_file)
    if name_or_file not in _PATHS:
        raise unknown_name("path", name_or_file, _PATHS)
    return _PATHS[name_or_file](vehicle)
