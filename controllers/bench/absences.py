"""What could not be measured, and why."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ...terrain import GrouserError


class Absences(dict[str, str]):
    """Why something is not in the figures, by its name."""

    @contextmanager
    def noting(self, name: str) -> Iterator[None]:
        """Note an expected error instead of passing it on."""
        try:
            yield
        except GrouserError as error:
            self[name] = str(error)
