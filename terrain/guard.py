"""The guard: a primary backend, a fallback, a detector between them, and the switching policy with its memory."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, ClassVar, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from .backend import ForceBackend
from .errors import ConfigurationError, InvalidInputError
from .interface import FloatArray
from .parameters import require_in, require_whole


@dataclass(frozen=True)
class Detection:
    """What a detector says of one interface row.

    Parameters
    ----------
    score : float
        Distance from the training data over its threshold: above 1 is out of distribution.
    reason : {"none", "finite", "box", "distance"}
        The level that raised the score above 1.
    worst_column : str
        The column that contributes most to it.
    """

    score: float
    reason: str
    worst_column: str

    @property
    def out_of_distribution(self) -> bool:
        """Whether the row lies outside."""
        return not self.score <= 1.0


class Detector(Protocol):
    """Anything that scores interface rows: above 1, or NaN, is out of distribution."""

    def score(self, x: FloatArray) -> FloatArray:
        """Return scores of shape (n,) for rows of shape (n, d); rows need not be finite."""

    def detect(self, row: FloatArray) -> Detection:
        """Score one row of shape (d,), with the reason."""


class GuardMode(StrEnum):
    """Which backend answers."""

    PRIMARY = "primary"
    FALLBACK = "fallback"


@dataclass(frozen=True)
class GuardState:
    """The guard's memory, carried by each simulated vehicle.

    Parameters
    ----------
    mode : GuardMode
        Which backend answers.
    dwell : float
        Time in this mode in s.
    calm : float
        Time since the score was last at or above the exit level, in s.
    flags : tuple of bool
        Whether the latest samples exceeded the distance threshold, newest first.
    fallback_weight : float
        Share of the fallback in the blended output.
    """

    mode: GuardMode = GuardMode.PRIMARY
    dwell: float = math.inf
    calm: float = math.inf
    flags: tuple[bool, ...] = ()
    fallback_weight: float = 0.0


@dataclass(frozen=True)
class SwitchingPolicy:
    """When to change over, and how softly.

    Entry is immediate where a row is not finite or leaves the declared box, and on ``entry_votes`` of the last
    ``entry_window`` samples beyond the distance threshold. Exit needs the score below ``exit_score`` for
    ``exit_time``, after at least ``minimum_dwell`` on the fallback. Outputs blend over ``blend_samples`` ticks, save
    that a row that the primary must not see goes to the fallback whole.

    Raises
    ------
    InvalidInputError
        If a value is impossible.
    """

    entry_votes: int = 2
    entry_window: int = 3
    exit_score: float = 0.8
    exit_time: float = 0.3
    minimum_dwell: float = 0.2
    blend_samples: int = 4

    def __post_init__(self) -> None:
        for name in ("entry_votes", "entry_window", "blend_samples"):
            require_whole(name, getattr(self, name), 1)
        if not self.entry_votes <= self.entry_window:
            raise InvalidInputError(
                f"entry_votes must lie in [1, entry_window = {self.entry_window}], got {self.entry_votes}"
            )
        if not 0 < self.exit_score <= 1:
            raise InvalidInputError(f"exit_score must lie in (0, 1], got {self.exit_score}")
        for name in ("exit_time", "minimum_dwell"):
            require_in(name, getattr(self, name), 0.0, 3600.0)

    def advance(self, state: GuardState, detection: Detection, elapsed: float) -> GuardState:
        """Return the guard's state for a tick of ``elapsed`` s whose input was scored as ``detection``."""
        calm = state.calm + elapsed if detection.score < self.exit_score else 0.0
        flags = (detection.out_of_distribution, *state.flags)[: self.entry_window]
        forced = detection.reason in ("finite", "box")
        mode, dwell = state.mode, state.dwell + elapsed
        if mode is GuardMode.PRIMARY and (forced or sum(flags) >= self.entry_votes):
            mode, dwell = GuardMode.FALLBACK, 0.0
        elif mode is GuardMode.FALLBACK and calm >= self.exit_time and dwell >= self.minimum_dwell:
            mode, dwell = GuardMode.PRIMARY, 0.0
        step = 1.0 / self.blend_samples
        if mode is GuardMode.FALLBACK:
            weight = 1.0 if forced else min(1.0, state.fallback_weight + step)
        else:
            weight = max(0.0, state.fallback_weight - step)
        return GuardState(mode, dwell, calm, flags, weight)


_Evaluation = Callable[[ForceBackend, FloatArray], tuple[FloatArray, ...]]


class GuardedBackend(ForceBackend):
    """A surrogate that hands over to another backend where it was not trained.

    Called as a backend it is a pure gate: each row goes to the primary or, out of distribution, to the fallback. A
    simulated vehicle adds the memory: it advances a :class:`GuardState` once a tick and evaluates
    :class:`BlendedForces` at the weight that the policy chose.

    Parameters
    ----------
    primary, fallback : ForceBackend
        Of the same vehicle and mode.
    detector : Detector
        Scores interface rows.
    policy : SwitchingPolicy
        Entry, hysteresis, dwell, blend.

    Raises
    ------
    ConfigurationError
        If primary and fallback differ in vehicle or mode.
    """

    name: ClassVar[str] = "guarded"

    def __init__(
        self,
        primary: ForceBackend,
        fallback: ForceBackend,
        detector: Detector,
        policy: SwitchingPolicy | None = None,
    ) -> None:
        if primary.mode != fallback.mode or not primary.vehicle.same_block(fallback.vehicle):
            raise ConfigurationError(
                f"primary ({primary.vehicle.name}, {primary.mode}) and fallback ({fallback.vehicle.name}, "
                f"{fallback.mode}) must be of one vehicle and mode"
            )
        super().__init__(fallback.vehicle, fallback.mode)
        self.primary: Final = primary
        self.fallback: Final = fallback
        self.detector: Final = detector
        self.policy: Final = policy or SwitchingPolicy()
        self.resolution = max(primary.resolution, fallback.resolution)

    def ood_score(self, x: FloatArray) -> FloatArray:
        """Return the detector's score of each row, shape (n,); above 1 is out of distribution."""
        return self.detector.score(np.atleast_2d(np.asarray(x, dtype=np.float64)))

    def out_of_distribution(self, x: FloatArray) -> NDArray[np.bool_]:
        """Return whether each row is out of distribution, shape (n,); a NaN score is."""
        return ~(self.ood_score(x) <= 1.0)

    def forces(self, x: FloatArray) -> FloatArray:
        """Return the primary's forces where the row is in distribution and they are finite, else the fallback's."""
        return self._gate(self.interface.check(x), lambda backend, rows: (backend.forces(rows),), ((3,),))[0]

    def forces_and_jacobian(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return forces and ∂Q/∂x of the backend that each row goes to."""
        shapes = ((3,), (3, self.interface.size))
        forces, jacobian = self._gate(self.interface.check(x), _forces_and_jacobian, shapes)
        return forces, jacobian

    def _gate(
        self, x: FloatArray, evaluate: _Evaluation, shapes: tuple[tuple[int, ...], ...]
    ) -> tuple[FloatArray, ...]:
        """Evaluate the primary, and the fallback where the detector or a primary that fails calls for it.

        ``shapes`` are those of the evaluation's parts for one row.
        """
        if x.ndim == 1:
            outside = self.detector.detect(x).out_of_distribution
            answer = None if outside else _attempt(evaluate, self.primary, x)
            return answer if answer is not None and _finite(answer) else evaluate(self.fallback, x)
        to_fallback = self.out_of_distribution(x)
        answers = tuple(np.empty((len(x), *shape)) for shape in shapes)
        inside = np.flatnonzero(~to_fallback)
        if len(inside):
            parts = _attempt(evaluate, self.primary, x[inside])
            if parts is None:
                to_fallback[:] = True
            else:
                bad = ~np.all([np.isfinite(part).reshape(len(part), -1).all(axis=1) for part in parts], axis=0)
                to_fallback[inside[bad]] = True
                for answer_part, part in zip(answers, parts, strict=True):
                    answer_part[inside] = part
        if to_fallback.any():
            for answer_part, part in zip(answers, evaluate(self.fallback, x[to_fallback]), strict=True):
                answer_part[to_fallback] = part
        return answers

    def blended_forces_and_jacobian(self, x: FloatArray, fallback_weight: float) -> tuple[FloatArray, FloatArray]:
        """Return (1 − w)·primary + w·fallback; a primary output that is not finite counts for nothing.

        Parameters
        ----------
        x : ndarray, shape (d,)
            One interface row.
        fallback_weight : float
            w in [0, 1].
        """
        return BlendedForces(self, fallback_weight)(x)

    def describe(self) -> dict[str, Any]:
        """Return the guard's own description with those of its parts."""
        return super().describe() | {"primary": self.primary.describe(), "fallback": self.fallback.describe()}


class BlendedForces:
    """Forces and Jacobian of a guarded backend at one weight, and whether its primary failed on the way.

    Parameters
    ----------
    backend : GuardedBackend
        Primary and fallback.
    fallback_weight : float
        w in [0, 1] of (1 − w)·primary + w·fallback.
    """

    def __init__(self, backend: GuardedBackend, fallback_weight: float) -> None:
        self._backend = backend
        self._weight = fallback_weight
        self.primary_failed = False

    def __call__(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Evaluate one interface row; a primary output that is not finite is noted and left out."""
        w, backend = self._weight, self._backend
        if w >= 1.0:
            return backend.fallback.forces_and_jacobian(x)
        primary = _attempt(_forces_and_jacobian, backend.primary, x)
        if primary is None or not _finite(primary):
            self.primary_failed = True
            return backend.fallback.forces_and_jacobian(x)
        if w <= 0.0:
            return primary[0], primary[1]
        fallback = backend.fallback.forces_and_jacobian(x)
        return (1 - w) * primary[0] + w * fallback[0], (1 - w) * primary[1] + w * fallback[1]


def _forces_and_jacobian(backend: ForceBackend, rows: FloatArray) -> tuple[FloatArray, ...]:
    return backend.forces_and_jacobian(rows)


def _attempt(evaluate: _Evaluation, backend: ForceBackend, rows: FloatArray) -> tuple[FloatArray, ...] | None:
    """Evaluate a backend that may refuse what a solver's trial step asks of it."""
    try:
        return evaluate(backend, rows)
    except InvalidInputError:
        return None


def _finite(parts: tuple[FloatArray, ...]) -> bool:
    return all(bool(np.isfinite(part).all()) for part in parts)
