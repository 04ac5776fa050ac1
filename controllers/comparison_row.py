"""What a comparison says of one drive."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from ..envs import InterfaceLog

#: Row fields that hold times; two equal comparisons differ in nothing else.
TIME_FIELDS: Final = ("force_call_ns", "deadline_misses")


@dataclass(frozen=True)
class ComparisonRow:
    """One drive against the same drive on physics.

    Parameters
    ----------
    scenario, terrain, controller, backend : str
        What drove where.
    seed : int
        Of the initial offsets.
    finished : bool
        Whether the vehicle reached the path's end; not so where it lost the path, time ran out or the simulation
        diverged.
    cross_track_rmse_m : float
        Over all ticks.
    corridor_violation_m : float or None
        Largest distance of a corner of the footprint beyond its lane; None without a corridor.
    final_position_difference_m, final_heading_difference_rad : float
        From the drive on physics, at the instant at which the shorter of the two ended.
    force_r2 : list of float or None
        R² of Qx, Qy, Mz against physics at the drive's own logged inputs; None where the physics does not vary.
    first_move_difference_rms : float or None
        Root mean square over control instants of the difference of the belt commands from the drive on physics,
        over the training speed; the difference is the norm over both belts. None where there was no move.
    failed_solves : int
        Of a controller that solves.
    fallback_rate : float
        Share of ticks in which the fallback had a part in the force.
    switches : int
        Of the guard.
    force_call_ns : float or None
        Median time of one force call at logged inputs, from Python; None where nothing was logged.
    deadline_misses : int
        Control instants whose command took longer than the control period.
    """

    scenario: str
    terrain: str
    controller: str
    backend: str
    seed: int
    finished: bool
    cross_track_rmse_m: float
    corridor_violation_m: float | None
    final_position_difference_m: float
    final_heading_difference_rad: float
    force_r2: list[float | None]
    first_move_difference_rms: float | None
    failed_solves: int
    fallback_rate: float
    switches: int
    force_call_ns: float | None
    deadline_misses: int


@dataclass(frozen=True, eq=False)
class Drive:
    """One row with the log behind it."""

    row: ComparisonRow
    log: InterfaceLog
