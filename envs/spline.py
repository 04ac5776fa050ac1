"""A smooth curve through points, and uniform samples of it: what every path is made from."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from ..terrain import FloatArray, InvalidInputError

COINCIDENT: Final = 1e-6
"""Points closer than this, in m, are one point."""

MOST_SAMPLES: Final = 1_000_000

# On a curve that never turns back, the speed along the chord-length parameter stays near 1.
_LEAST_SPEED: Final = 0.2
_SUBSTEPS: Final = 4
_GAUSS_NODES: Final = np.array([0.5 - np.sqrt(0.15), 0.5, 0.5 + np.sqrt(0.15)])
_GAUSS_WEIGHTS: Final = np.array([5.0, 8.0, 5.0]) / 18.0


class Samples(NamedTuple):
    """Samples of a curve at equal steps of arc length, each of shape (n,); a closed curve repeats its first point."""

    x: FloatArray
    y: FloatArray
    arc_length: FloatArray
    heading: FloatArray
    curvature: FloatArray


def smooth_samples(points: FloatArray, *, closed: bool, spacing: float) -> Samples:
    """Pass a cubic spline through points and sample it at equal steps of arc length.

    The spline is parametrised by chord length, so heading and curvature are continuous. An open curve ends
    straight (the natural end condition); a closed one closes with continuous curvature.

    Parameters
    ----------
    points : ndarray
        Shape (n, 2) in m, finite, no two neighbours coincident; a closed curve does not repeat its first point.
    closed : bool
        Whether the last point joins the first.
    spacing : float
        Step in m; shortened so that a whole number of steps fits.

    Returns
    -------
    Samples
        Position in m, arc length in m, heading in rad (unwrapped), curvature in 1/m.

    Raises
    ------
    InvalidInputError
        If the curve turns back on itself, or needs more than a million samples.
    """
    knots = np.vstack([points, points[:1]]) if closed else points
    steps = np.hypot(*np.diff(knots, axis=0).T)
    if steps.sum() / spacing > MOST_SAMPLES:
        raise InvalidInputError(
            f"a path of {steps.sum():.4g} m needs more than {MOST_SAMPLES} samples at {spacing:g} m: "
            f"give its points in m, or a larger spacing"
        )
    bends = _second_derivatives(knots, steps, closed=closed)

    parts = np.maximum(1, np.ceil(_SUBSTEPS * steps / spacing)).astype(np.intp)
    segment = np.repeat(np.arange(len(steps)), parts)
    width = 1.0 / parts[segment]
    left = (np.arange(len(segment)) - np.repeat(np.cumsum(parts) - parts, parts)) * width
    inner = left[:, None] + width[:, None] * _GAUSS_NODES
    _, slope, _ = _evaluate(knots, steps, bends, segment[:, None], inner)
    speed = np.hypot(slope[..., 0], slope[..., 1])
    if speed.min() < _LEAST_SPEED:
        x, y = knots[segment[speed.min(axis=1).argmin()] + 1]
        raise InvalidInputError(f"a path must not turn back on itself, as this one does near ({x:g}, {y:g})")
    travelled = np.concatenate([[0.0], np.cumsum((speed @ _GAUSS_WEIGHTS) * width * steps[segment])])

    count = max(2, round(travelled[-1] / spacing))
    arc_length = np.linspace(0.0, travelled[-1], count + 1)
    parameter = np.interp(arc_length, travelled, np.append(segment + left, len(steps)))
    index = np.minimum(parameter.astype(np.intp), len(steps) - 1)
    position, slope, second = _evaluate(knots, steps, bends, index, parameter - index)
    heading = np.unwrap(np.arctan2(slope[:, 1], slope[:, 0]))
    cross = slope[:, 0] * second[:, 1] - slope[:, 1] * second[:, 0]
    curvature = cross / np.hypot(slope[:, 0], slope[:, 1]) ** 3
    return Samples(position[:, 0].copy(), position[:, 1].copy(), arc_length, heading, curvature)


def _evaluate(
    knots: FloatArray, steps: FloatArray, bends: FloatArray, index: np.ndarray, fraction: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Position and first two derivatives at ``fraction`` of segment ``index``, each with a last axis (x, y)."""
    h, b = steps[index][..., None], fraction[..., None]
    a = 1.0 - b
    start, end, bend_start, bend_end = knots[index], knots[index + 1], bends[index], bends[index + 1]
    position = a * start + b * end + h**2 / 6 * ((a**3 - a) * bend_start + (b**3 - b) * bend_end)
    slope = (end - start) / h + h / 6 * ((3 * b**2 - 1) * bend_end - (3 * a**2 - 1) * bend_start)
    return position, slope, a * bend_start + b * bend_end


def _second_derivatives(knots: FloatArray, steps: FloatArray, *, closed: bool) -> FloatArray:
    """Second derivatives of the spline at its knots, shape (n, 2)."""
    chords = np.diff(knots, axis=0) / steps[:, None]
    if not closed:
        inner = _solve_tridiagonal(steps[:-1], 2 * (steps[:-1] + steps[1:]), steps[1:], 6 * np.diff(chords, axis=0))
        return np.vstack([np.zeros(2), inner, np.zeros(2)])
    before = np.roll(steps, 1)
    diagonal = 2 * (before + steps)
    right = 6 * (chords - np.roll(chords, 1, axis=0))
    # Sherman-Morrison: the two corner entries of the cyclic matrix are one rank-one term away from tridiagonal.
    corner, pivot = before[0], -diagonal[0]
    diagonal[0] -= pivot
    diagonal[-1] -= corner**2 / pivot
    column = np.zeros((len(steps), 1))
    column[0], column[-1] = pivot, corner
    solved = _solve_tridiagonal(before, diagonal, steps, np.hstack([right, column]))
    plain, extra = solved[:, :2], solved[:, 2:]
    share = (plain[0] + plain[-1] * corner / pivot) / (1.0 + extra[0] + extra[-1] * corner / pivot)
    bends: FloatArray = plain - extra * share
    return np.vstack([bends, bends[:1]])


def _solve_tridiagonal(lower: FloatArray, diagonal: FloatArray, upper: FloatArray, right: FloatArray) -> FloatArray:
    """Solve for every column of ``right``, (n, m); ``lower[0]`` and ``upper[-1]`` lie outside the matrix, unread."""
    solution = right.copy()
    pivot = diagonal.copy()
    for i in range(1, len(pivot)):
        factor = lower[i] / pivot[i - 1]
        pivot[i] -= factor * upper[i - 1]
        solution[i] -= factor * solution[i - 1]
    solution[-1] /= pivot[-1]
    for i in range(len(pivot) - 2, -1, -1):
        solution[i] = (solution[i] - upper[i] * solution[i + 1]) / pivot[i]
    return solution
