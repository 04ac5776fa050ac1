"""One row of the validation table."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any, Literal

#: How measured and expected value are compared: by their difference, by its share of the expected value, or the
#: measured value as an error that stays at or below the tolerance.
Kind = Literal["absolute", "relative", "at most"]


@dataclass(frozen=True)
class Check:
    """A quantity that an implementation must reproduce, and what it gave.

    Parameters
    ----------
    number : int
        Group: 1 golden state, 2 thrust, 3 full-slip moments, 4 steady skid turn, 5 turning resistance, 6 lateral
        saturation, 7 power and loads, 8 symmetry, 9 grid convergence, 10 agreement of the implementations.
    name : str
        What is checked, with its conditions.
    block : str
        Who was asked: ``"compiled"``, ``"NumPy"``, or ``"closed form"``.
    quantity, unit : str
        What is compared, and its SI unit.
    expected, measured : float
        What it should be, and what it is; an error is expected to be 0.
    tolerance : float
        In the quantity's unit, or as a share of the expected value where ``kind`` is ``"relative"``.
    kind : {"absolute", "relative", "at most"}
        How the two are compared.
    source : str
        Where the expected value comes from.
    """

    number: int
    name: str
    block: str
    quantity: str
    unit: str
    expected: float
    measured: float
    tolerance: float
    kind: Kind
    source: str

    @property
    def difference(self) -> float:
        """Measured less expected value, over the expected one where ``kind`` is ``"relative"``."""
        difference = self.measured - self.expected
        return difference / abs(self.expected) if self.kind == "relative" else difference

    @property
    def passed(self) -> bool:
        """Whether the difference stays within the tolerance. NaN does not."""
        within = self.difference if self.kind == "at most" else abs(self.difference)
        return math.isfinite(self.difference) and within <= self.tolerance

    def to_dict(self) -> dict[str, Any]:
        """Return the fields, the difference and the verdict, as JSON can hold them."""
        return asdict(self) | {"difference": self.difference, "passed": self.passed}
