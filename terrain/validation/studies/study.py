"""What a study is: figures computed by the block, a plot of them, and what is seen on it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from ...vehicle import TrackedVehicle

Data = Mapping[str, Any]


@dataclass(frozen=True)
class Study:
    """One study of the block.

    Parameters
    ----------
    name : str
        Of its files.
    title : str
        Its heading.
    compute : callable
        ``compute(vehicle, quick)`` returns the data, as JSON can hold them, from nothing but its arguments.
    draw : callable
        ``draw(data)`` returns a matplotlib figure.
    remark : callable
        ``remark(data)`` returns what is seen, in one to three sentences.
    """

    name: str
    title: str
    compute: Callable[[TrackedVehicle, bool], dict[str, Any]]
    draw: Callable[[Data], Any]
    remark: Callable[[Data], str]
