"""A path read from a CSV file of points."""

from __future__ import annotations

import csv
import math
import os
from pathlib import Path as FilePath

import numpy as np

from ..terrain import InvalidInputError
from .path import Path
from .spline import COINCIDENT


def path_from_csv(file: str | os.PathLike[str], *, spacing: float = 0.1) -> Path:
    """Read points and pass a smooth curve through them.

    Parameters
    ----------
    file : str or path-like
        Comma-separated, exactly two columns, x and y in m, with or without one header line. Where the last point
        repeats the first, the path is closed.
    spacing : float
        Step of the samples in m.

    Returns
    -------
    Path
        Named after the file.

    Raises
    ------
    InvalidInputError
        If the file cannot be read, or a line of it does not hold such a point; the message names file and line.
    """
    points, lines = _read(FilePath(file))
    closed = math.dist(points[0], points[-1]) < COINCIDENT
    if closed:
        points, lines = points[:-1], lines[:-1]
    if len(points) < 3:
        repeated = " apart from the repeated first one" if closed else ""
        raise InvalidInputError(
            f"{file}, line {lines[-1]}: expected at least 3 points, but the file ends here with {len(points)}{repeated}"
        )
    try:
        return Path.from_points(FilePath(file).stem, np.array(points), closed=closed, spacing=spacing)
    except InvalidInputError as error:
        raise InvalidInputError(f"{file}: {error}") from error


def _read(file: FilePath) -> tuple[list[tuple[float, float]], list[int]]:
    """Return the points and the line that each stands on."""
    points: list[tuple[float, float]] = []
    lines: list[int] = []
    header = True
    try:
        with file.open(encoding="utf-8-sig", newline="") as stream:
            rows = csv.reader(stream)
            for row in rows:
                if not any(cell.strip() for cell in row):
                    continue
                where = f"{file}, line {rows.line_num}"
                if len(row) != 2:
                    raise InvalidInputError(f"{where}: expected two columns, x and y in m, got {len(row)}")
                if header and not any(map(_is_number, row)):
                    header = False
                    continue
                header = False
                point = (_number(row[0], "x", where), _number(row[1], "y", where))
                if points and math.dist(point, points[-1]) < COINCIDENT:
                    raise InvalidInputError(
                        f"{where}: the point {point} coincides with the one on line {lines[-1]}; remove one of them"
                    )
                points.append(point)
                lines.append(rows.line_num)
    except OSError as error:
        raise InvalidInputError(f"cannot read the path file {file}: {error.strerror}") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise InvalidInputError(f"{file} is not a text file of comma-separated values: {error}") from error
    if not points:
        raise InvalidInputError(f"{file}, line 1: expected at least 3 points, but the file holds none")
    return points, lines


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _number(cell: str, column: str, where: str) -> float:
    if not _is_number(cell):
        raise InvalidInputError(f"{where}: {column} must be a number in m, got {cell.strip()!r}")
    value = float(cell)
    if not math.isfinite(value):
        raise InvalidInputError(f"{where}: {column} must be finite, got {cell.strip()!r}")
    return value
