"""What a dataset is made of: the recipe of its runs, and a record of each."""

from __future__ import annotations

import hashlib
import json
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
        Name of the maneuver, or ``"visited"`` for a drive that was ingested.
    terrain : dict
        Terrain parameters by name, SI units.
    excitation : dict
        Scalars of the maneuver; of a visited run, where it comes from.
    samples : int
        Logged ticks.
    divided_ticks : int
        Ticks that were solved in parts.
    """

    run: int
    maneuver: str
    terrain: Mapping[str, float]
    excitation: Mapping[str, float | str]
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

    @property
    def recipe_hash(self) -> str:
        """SHA-256 of what :meth:`same_recipe` compares: names the dataset that a run's file belongs to."""
        content = asdict(self) | {"content_hash": ""}
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def parse_manifest(content: Mapping[str, Any]) -> Manifest:
    """Build a manifest from JSON.

    Raises
    ------
    TypeError, ValueError
        If it is not one.
    """
    manifest = Manifest(**content)
    _check_types(manifest, _MANIFEST_TYPES)
    interface(manifest.mode)
    if manifest.runs < 1 or manifest.samples_per_run < 1 or manifest.seed < 0:
        raise ValueError("runs and samples_per_run are at least 1, and seed is not negative")
    if not 0 <= manifest.transient <= 1e6 or not 0 < manifest.tick <= 1:
        raise ValueError("transient lies in [0, 1e6] s and tick in (0, 1] s")
    return manifest


def parse_record(content: Mapping[str, Any]) -> RunRecord:
    """Build a run record from JSON.

    Raises
    ------
    TypeError, ValueError
        If it is not one.
    """
    record = RunRecord(**content)
    _check_types(record, _RECORD_TYPES)
    if min(record.run, record.samples, record.divided_ticks) < 0:
        raise ValueError("run, samples and divided_ticks are not negative")
    for key, parameter in record.terrain.items():
        _check_type(f"terrain {key}", parameter, float)
    for key, value in record.excitation.items():
        _check_type(f"excitation {key}", value, str if isinstance(value, str) else float)
    return record


_MANIFEST_TYPES: Final[Mapping[str, type]] = {
    "mode": str,
    "vehicle": Mapping,
    "ranges": str,
    "backend": Mapping,
    "integrator": str,
    "tick": float,
    "transient": float,
    "samples_per_run": int,
    "runs": int,
    "seed": int,
    "content_hash": str,
}
_RECORD_TYPES: Final[Mapping[str, type]] = {
    "run": int,
    "maneuver": str,
    "terrain": Mapping,
    "excitation": Mapping,
    "samples": int,
    "divided_ticks": int,
}


def _check_types(content: Manifest | RunRecord, types: Mapping[str, type]) -> None:
    for name, kind in types.items():
        _check_type(name, getattr(content, name), kind)


def _check_type(name: str, value: Any, kind: type) -> None:
    # JSON writes a whole float without its point in other hands, and True is an int to Python.
    fits = isinstance(value, int | float if kind is float else kind) and not isinstance(value, bool)
    if not fits:
        raise TypeError(f"{name} must be {_KIND_NAMES[kind]}, got {value!r}")


_KIND_NAMES: Final[Mapping[type, str]] = {str: "text", Mapping: "a mapping", float: "a number", int: "a whole number"}
