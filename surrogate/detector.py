"""Whether an input looks like the training data: finite, inside the declared box, near in Mahalanobis distance.

The threshold on the distance is conformal per run, because the samples of a run are not exchangeable.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..native import Detector as CompiledDetector
from ..terrain import (
    MOTION_SIZE,
    Detection,
    FloatArray,
    InvalidInputError,
    Mode,
    ParameterRanges,
    TrackedVehicle,
    interface,
)
from .conformal import conformal_threshold, run_scores
from .normalizer import Normalizer, frozen_array

#: Declared bound of vx over the largest belt speed in training.
SPEED_MARGIN: Final = 1.1
#: Declared bound of vy, yaw rate, ax, ay over their largest magnitude in training.
ENVELOPE_MARGIN: Final = 1.5
#: Variance, in normalized units, that is added to every motion column before the covariance is inverted.
RIDGE: Final = 1e-3
#: Share of a column's width by which a row may pass the box: rounding to float32 is no excursion.
EDGE_TOLERANCE: Final = 1e-6


@dataclass(frozen=True, eq=False)
class BoxMahalanobisDetector:
    """Finite, box, distance: the three cheap levels of the guard.

    The score is distance/threshold. Outside the box it is raised to at least 1 + (excess of the worst column over
    half its width); a row that is not finite scores infinity. At most 1 is in distribution.

    Parameters
    ----------
    mode : {"rigid", "soil"}
        Terrain mode.
    low, high : ndarray, shape (d,)
        Declared box in interface units, bounds included.
    center : ndarray, shape (d,)
        Where the distance is 0.
    whitening : ndarray, shape (d, d)
        Lower triangular W; the distance is ‖W (x − center)‖.
    threshold : float
        Distance that scores 1.
    alpha : float
        Share of runs allowed to have more than 1 % of their samples flagged.
    calibration_runs : int
        Number of runs that the threshold was taken from; 0 if it was set by hand.
    rank_attained : bool
        Whether there were enough runs for the rank that alpha asks for. If not, the threshold is the largest run
        score and the promise is weaker than alpha.

    Raises
    ------
    InvalidInputError
        If a shape is wrong, a value is not finite, or the box or the threshold is empty.
    """

    mode: Mode
    low: FloatArray
    high: FloatArray
    center: FloatArray
    whitening: FloatArray
    threshold: float
    alpha: float = 0.05
    calibration_runs: int = 0
    rank_attained: bool = False
    _reach: FloatArray = field(init=False, repr=False)
    _slack: FloatArray = field(init=False, repr=False)
    _bounds: list[list[float]] = field(init=False, repr=False)
    _names: tuple[str, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        table = interface(self.mode)
        for name in ("low", "high", "center", "whitening"):
            array = frozen_array(getattr(self, name), np.float64)
            shape = (table.size, table.size) if name == "whitening" else (table.size,)
            if array.shape != shape or not np.isfinite(array).all():
                raise InvalidInputError(
                    f"a {self.mode} detector's {name} is finite, of shape {shape}; got {array.shape}"
                )
            object.__setattr__(self, name, array)
        if not (self.low <= self.high).all():
            raise InvalidInputError("a detector's low must nowhere exceed its high")
        if not 0.0 < self.threshold < math.inf:
            raise InvalidInputError(f"a detector's threshold must be positive and finite, got {self.threshold!r}")
        reach = np.maximum((self.high - self.low) / 2, EDGE_TOLERANCE * np.maximum(abs(self.low), abs(self.high)))
        reach = np.where(reach > 0, reach, 1.0)
        slack = 2 * EDGE_TOLERANCE * reach
        object.__setattr__(self, "_reach", reach)
        object.__setattr__(self, "_slack", slack)
        object.__setattr__(self, "_bounds", np.stack([self.low - slack, self.high + slack], axis=1).tolist())
        object.__setattr__(self, "_names", table.names)

    @classmethod
    def fit(
        cls,
        x: FloatArray,
        run_index: ArrayLike,
        normalizer: Normalizer,
        ranges: ParameterRanges,
        vehicle: TrackedVehicle,
        alpha: float = 0.05,
        *,
        calibration: tuple[FloatArray, ArrayLike] | None = None,
    ) -> BoxMahalanobisDetector:
        """Declare the box, fit the distance and calibrate its threshold.

        Box: terrain as in ``ranges``; belts at most the vehicle's training speed, vx 1.1 times that; vy, yaw rate, ax
        and ay 1.5 times their largest training magnitude. Distance: mean and covariance of the normalized motion
        columns, taken together with their mirror image, plus a ridge. Terrain is constant in a run, so few runs say
        little about its covariance: it enters with what is declared, the middle of its range, the spread of a
        uniform draw and no correlation.

        Parameters
        ----------
        x : ndarray, shape (n, d)
            Interface rows of training runs.
        run_index : array_like, shape (n,)
            Run of each row.
        normalizer : Normalizer
            Of the interface columns, from training rows alone.
        ranges : ParameterRanges
            Terrain of the training runs.
        vehicle : TrackedVehicle
            The vehicle.
        alpha : float
            Allowed share of runs with more than 1 % flagged, in (0, 1).
        calibration : tuple of ndarray, optional
            Rows and run index of other runs. By default every other run of ``x`` is kept from the fit for this.

        Raises
        ------
        InvalidInputError
            If shapes do not fit, a value is not finite, or there are too few runs.
        """
        table = ranges.interface
        rows, runs = _checked_runs(ranges.mode, x, run_index)
        if normalizer.size != table.size:
            raise InvalidInputError(f"the normalizer has {normalizer.size} columns, the interface {table.size}")
        if calibration is None:
            held_out = np.isin(runs, np.unique(runs)[1::2])
            if not held_out.any():
                raise InvalidInputError("a detector needs at least 2 runs, one to fit and one to calibrate; got 1")
            calibration = rows[held_out], runs[held_out]
            rows = rows[~held_out]

        bound = ENVELOPE_MARGIN * abs(rows[:, :MOTION_SIZE]).max(axis=0)
        bound[table.index("vx")] = SPEED_MARGIN * vehicle.training_speed
        bound[[table.index("v_left"), table.index("v_right")]] = vehicle.training_speed

        # One scale for both belts, so that the score cannot tell left from right.
        variance = normalizer.scale**2
        scale = np.sqrt((variance + variance[table.mirror_permutation]) / 2)[:MOTION_SIZE]
        z = np.concatenate([rows, table.mirror(rows)])[:, :MOTION_SIZE] / scale
        covariance = np.cov(z, rowvar=False, bias=True) + RIDGE * np.eye(MOTION_SIZE)
        terrain_low, terrain_high = np.array(ranges.low), np.array(ranges.high)
        spread = (terrain_high - terrain_low) / math.sqrt(12.0)
        whitening = np.diag(np.concatenate([np.zeros(MOTION_SIZE), 1 / np.where(spread > 0, spread, 1.0)]))
        whitening[:MOTION_SIZE, :MOTION_SIZE] = np.tril(np.linalg.inv(np.linalg.cholesky(covariance))) / scale
        return cls(
            mode=ranges.mode,
            low=np.concatenate([-bound, terrain_low]),
            high=np.concatenate([bound, terrain_high]),
            center=np.concatenate([scale * z.mean(axis=0), (terrain_low + terrain_high) / 2]),
            whitening=whitening,
            threshold=1.0,
        ).calibrated(calibration[0], calibration[1], alpha)

    def calibrated(self, x: FloatArray, run_index: ArrayLike, alpha: float = 0.05) -> BoxMahalanobisDetector:
        """Return the detector with the threshold that ``x``, rows of runs that it was not fitted to, calls for.

        A run scores the 99th percentile of its distances; see :func:`conformal_threshold`. A fresh run then has more
        than 1 % of its samples beyond the threshold with probability at most alpha.

        Raises
        ------
        InvalidInputError
            If shapes do not fit or a value is not finite.
        """
        rows, runs = _checked_runs(self.mode, x, run_index)
        scores = run_scores(self.distance(rows), runs)
        threshold, attained = conformal_threshold(scores, alpha)
        return replace(self, threshold=threshold, alpha=alpha, calibration_runs=len(scores), rank_attained=attained)

    def distance(self, x: FloatArray) -> FloatArray:
        """Return the Mahalanobis distance of rows (n, d) from the training data, shape (n,); or of one row (d,)."""
        white = (x - self.center) @ self.whitening.T
        distance: FloatArray = np.sqrt(np.sum(white * white, axis=-1))
        return distance

    def score(self, x: FloatArray) -> FloatArray:
        """Return scores of shape (n,) for rows of shape (n, d); rows need not be finite.

        Raises
        ------
        InvalidInputError
            If the rows have another number of columns.
        """
        x = np.atleast_2d(np.asarray(x, dtype=np.float64))
        if x.ndim != 2 or x.shape[1] != len(self._names):
            raise InvalidInputError(f"a {self.mode} detector scores rows of {len(self._names)} columns, got {x.shape}")
        outside = ~((x >= self.low - self._slack) & (x <= self.high + self._slack))
        with np.errstate(over="ignore", invalid="ignore"):
            score = self.distance(x) / self.threshold
            excess = np.where(outside, 1.0 + np.maximum(self.low - x, x - self.high) / self._reach, 0.0)
        # fmax passes over a distance that overflowed to NaN.
        score = np.where(outside.any(axis=1), np.fmax(score, excess.max(axis=1)), score)
        score[~np.isfinite(x).all(axis=1)] = np.inf
        return score

    def detect(self, row: FloatArray) -> Detection:
        """Score one row of shape (d,), with the reason.

        Raises
        ------
        InvalidInputError
            If the row has another shape.
        """
        row = np.asarray(row, dtype=np.float64)
        if row.shape != self.center.shape:
            raise InvalidInputError(f"a {self.mode} detector takes a row of shape {self.center.shape}, got {row.shape}")
        for value, (low, high) in zip(row.tolist(), self._bounds, strict=True):
            if not low <= value <= high:
                return self._outside(row)
        offset = row - self.center
        white = np.dot(self.whitening, offset)
        score = math.sqrt(np.dot(white, white)) / self.threshold
        worst = (offset * np.dot(white, self.whitening)).argmax()
        return Detection(score, "none" if score <= 1.0 else "distance", self._names[worst])

    def _outside(self, row: FloatArray) -> Detection:
        finite = np.isfinite(row)
        if not finite.all():
            return Detection(math.inf, "finite", self._names[int(finite.argmin())])
        with np.errstate(over="ignore", invalid="ignore"):
            excess = np.maximum(self.low - row, row - self.high) / self._reach
            worst = int(excess.argmax())
            # In this order max passes over a distance that overflowed to NaN.
            score = max(1.0 + float(excess[worst]), float(self.distance(row)) / self.threshold)
        return Detection(score, "box", self._names[worst])

    def compiled(self) -> CompiledDetector:
        """Return the compiled detector, which scores a row alike."""
        return CompiledDetector(
            columns=len(self._names),
            low=self.low,
            high=self.high,
            center=self.center,
            whitening=self.whitening,
            threshold=self.threshold,
        )

    def summary(self) -> dict[str, Any]:
        """Return threshold and calibration, as JSON can hold them; the arrays are the artifact's tensors."""
        return {name: getattr(self, name) for name in ("threshold", "alpha", "calibration_runs", "rank_attained")}


def _checked_runs(mode: Mode, x: FloatArray, run_index: ArrayLike) -> tuple[FloatArray, NDArray[np.int64]]:
    rows = np.atleast_2d(interface(mode).check(x))
    runs = np.asarray(run_index)
    if runs.shape != (len(rows),) or len(rows) == 0:
        raise InvalidInputError(f"expected a run index for each of at least one row, got {runs.shape} for {len(rows)}")
    return rows, runs
