"""What a dataset is made of: the recipe of its runs, and a record of each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Final

from ...terrain import Mode, interface

FORMAT_VERSION: Final = 1


@dataclass(frozen=True)
class RunRecord:
    """One row of the run table.

    Parameters
    ----------
    run : int
        Index of the run.
    maneuver : str
        Name of the maneuver.
    terrain : dict
        Terrain parameters by name, SI units.
    excitation : dict
        Scalars of the maneuver.
    samples : int
        Logged ticks.
    divided_ticks : int
        Ticks that were solved in parts.
    """

    run: int
    maneuver: str
    terrain: Mapping[str, float]
    excitation: Mapping[str, float]
    samples: int
    divided_ticks: int


@dataclass(frozen=True)
class Manifest:
    """What a dataset is made of.

    Parameters
    ----------
    mode : {"rigid", "soil"}
        Terrain mode.
    vehicle : dict
        :meth:`TrackedVehicle.to_dict`.
    ranges : str
        Name of the terrain ranges.
    backend : dict
        The teacher, as it describes itself.
    integrator : str
        Of the simulator.
    tick : float
        T_s in s.
    transient : float
        Discarded start of each run, in s.
    samples_per_run : int
        Logged ticks a run.
    runs : int
        Number of runs.
    seed : int
        Of every draw.
    content_hash : str
        SHA-256 over runs and samples; empty while the dataset is being made.
    """

    mode: Mode
    vehicle: Mapping[str, Any]
    ranges: str
    backend: Mapping[str, Any]
    integrator: str
    tick: float
    transient: float
    samples_per_run: int
    runs: int
    seed: int
    content_hash: str = ""
    format_version: int = field(default=FORMAT_VERSION)

    def same_recipe(self, other: Manifest) -> bool:
        """Whether both describe the same runs, hashes aside."""
        return asdict(self) | {"content_hash": ""} == asdict(other) | {"content_hash": ""}


def parse_manifest(content: Mapping[str, Any]) -> Manifest:
    """Build a manifest from JSON.

    Raises
    ------
    TypeError, ValueError
        If it is not one.
    """
    manifest = Manifest(**content)
    interface(manifest.mode)
    return manifest
