"""One row of a verification: what was measured, and whether that is within its limit."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

from ...terrain import GrouserError

_LISTED: Final = 4


@dataclass(frozen=True)
class Finding:
    """A property that a dataset or an artifact must have, and what was found.

    Parameters
    ----------
    check : str
        What is checked.
    subject : str
        On what: a file, columns, a backend, an output.
    measured : float
        An error or a count; NaN where it could not be measured.
    limit : float or None
        Largest value that passes; None where the figure is told and not judged.
    unit : str
        Of both.
    detail : str
        What the reader should know beside, such as the runs that fail.
    """

    check: str
    subject: str
    measured: float
    limit: float | None
    unit: str
    detail: str = ""

    @property
    def passed(self) -> bool:
        """Whether the measured value is within the limit. NaN is not."""
        return self.limit is None or self.measured <= self.limit

    def to_dict(self) -> dict[str, Any]:
        """Return the fields and the verdict, as JSON can hold them."""
        measured = self.measured if math.isfinite(self.measured) else None
        return asdict(self) | {"measured": measured, "passed": self.passed}


def counted(check: str, subject: str, failing: Sequence[object], unit: str) -> Finding:
    """Return a finding that allows no failing item, and names the first ones."""
    listed = ", ".join(str(item) for item in failing[:_LISTED])
    more = f" and {len(failing) - _LISTED} more" if len(failing) > _LISTED else ""
    return Finding(check, subject, float(len(failing)), 0.0, unit, listed + more)


def attempted(check: str, subject: str, limit: float, unit: str, measure: Callable[[], float]) -> Finding:
    """Return a finding of what ``measure`` returns; where it is refused, a failed one that says why."""
    try:
        return Finding(check, subject, measure(), limit, unit)
    except GrouserError as error:
        return refused(check, subject, error, limit=limit, unit=unit)


def refused(check: str, subject: str, error: GrouserError, *, limit: float | None = 0.0, unit: str = "1") -> Finding:
    """Return the finding of something that could not be measured."""
    return Finding(check, subject, math.nan, limit, unit, " ".join(str(error).split()))
