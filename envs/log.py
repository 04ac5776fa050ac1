"""The interface log: what the block received and returned, tick by tick, with the state around it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ..terrain import (
    GRAVITY,
    MOTION_SIZE,
    FloatArray,
    ForceBackend,
    Interface,
    Mode,
    assemble,
    interface,
    level_equivalent,
    unknown_name,
)
from .simulator import Simulator, TickRecord
from .state import BeltCommand, VehicleState

#: Columns of :attr:`InterfaceLog.states`, in order.
STATE_NAMES: Final = ("x", "y", "heading", "vx", "vy", "yaw_rate", "v_left", "v_right", "ax", "ay", "time")


@dataclass(frozen=True, eq=False)
class InterfaceLog:
    """One drive, logged at the interface of the force block.

    Parameters
    ----------
    mode : {"rigid", "soil"}
        Terrain mode.
    inputs : ndarray, shape (n, d)
        What the block received in the accepted evaluation of each tick; columns as in the interface table. On a slope
        they go through :func:`~grouser.terrain.level_equivalent` to the backend; :meth:`recomputed` does the same.
    forces : ndarray, shape (n, 3)
        What it returned: [Qx, Qy, Mz] that moved the vehicle.
    states : ndarray, shape (n + 1, 11)
        State before the first tick and after each; columns :data:`STATE_NAMES`.
    commands : ndarray, shape (n, 2)
        Belt-speed commands in m/s.
    right_theta : ndarray, shape (n, p)
        Terrain parameters that the right track received; those in ``inputs`` are the left one's, and the same unless
        the ground is sampled at each track.
    gravity : ndarray, shape (n, 3)
        Gravity along the body axes x and y, and what presses the vehicle on the ground, in m/s²; (0, 0, 9.81) where
        it is level. The forces are those under the load m g_z.
    divisions : ndarray of int, shape (n,)
        Parts that each tick was solved in; ``inputs`` and ``forces`` are those of the last part.
    ood_score : ndarray, shape (n,)
        Detector's score at the tick's start; NaN without a guard.
    fallback_weight : ndarray, shape (n,)
        Share of the fallback in the forces; 0 without a guard.
    switches : int
        How often the guard changed over.
    meta : dict
        Vehicle, backend, tick and integrator, as JSON can hold them.
    """

    mode: Mode
    inputs: FloatArray
    forces: FloatArray
    states: FloatArray
    commands: FloatArray
    right_theta: FloatArray
    gravity: FloatArray
    divisions: NDArray[np.int64]
    ood_score: FloatArray
    fallback_weight: FloatArray
    switches: int
    meta: dict[str, Any]

    @property
    def interface(self) -> Interface:
        """The interface that the inputs follow."""
        return interface(self.mode)

    def __len__(self) -> int:
        return len(self.inputs)

    def state(self, name: str) -> FloatArray:
        """Return one column of the states, shape (n + 1,).

        Raises
        ------
        ConfigurationError
            If there is no such column.
        """
        if name not in STATE_NAMES:
            raise unknown_name("state column", name, STATE_NAMES)
        return self.states[:, STATE_NAMES.index(name)]

    def recomputed(self, backend: ForceBackend) -> FloatArray:
        """Return the [Qx, Qy, Mz] that a backend gives for the logged rows, on their ground and slope, shape (n, 3)."""
        ratio = self.gravity[:, 2] / GRAVITY
        left = level_equivalent(self.interface, self.inputs, ratio)
        if np.array_equal(self.right_theta, self.inputs[:, MOTION_SIZE:]):
            return ratio[:, None] * backend.forces(left)
        right = np.hstack([self.inputs[:, :MOTION_SIZE], self.right_theta])
        tracks = backend.track_forces(left, level_equivalent(self.interface, right, ratio))
        return ratio[:, None] * assemble(tracks)

    @property
    def fallback_rate(self) -> float:
        """Share of ticks in which the fallback had a part in the force."""
        return float(np.mean(self.fallback_weight > 0)) if len(self) else 0.0


class LogRecorder:
    """Collects ticks of one simulator into an :class:`InterfaceLog`."""

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator
        self._initial = simulator.get_state()
        self._records: list[tuple[BeltCommand, TickRecord]] = []

    def append(self, command: BeltCommand, record: TickRecord) -> None:
        """Add one tick."""
        self._records.append((command, record))

    def finish(self) -> InterfaceLog:
        """Return the log of the ticks so far."""
        simulator = self._simulator
        records = [record for _, record in self._records]
        guards = [self._initial.guard.mode, *(record.state.guard.mode for record in records)]
        return InterfaceLog(
            mode=simulator.backend.mode,
            inputs=_stack((record.row for record in records), simulator.backend.interface.size),
            forces=_stack((record.forces for record in records), 3),
            states=_stack((_state_row(s) for s in (self._initial, *(r.state for r in records))), len(STATE_NAMES)),
            commands=_stack((command for command, _ in self._records), 2),
            right_theta=_stack(
                (record.footing.right_theta for record in records), len(simulator.backend.interface.parameter_names)
            ),
            gravity=_stack((record.footing.gravity for record in records), 3),
            divisions=np.array([record.divisions for record in records], dtype=np.int64),
            ood_score=np.array([r.detection.score if r.detection else np.nan for r in records], dtype=np.float64),
            fallback_weight=np.array([record.state.guard.fallback_weight for record in records], dtype=np.float64),
            switches=sum(a is not b for a, b in pairwise(guards)),
            meta={
                "vehicle": simulator.vehicle.to_dict(),
                "backend": simulator.backend.describe(),
                "tick": simulator.tick,
                "integrator": simulator.integrator,
                "ground_sampling": simulator.ground_sampling,
            },
        )


def _state_row(state: VehicleState) -> list[float]:
    return [getattr(state, name) for name in STATE_NAMES]


def _stack(rows: Iterable[Any], width: int) -> FloatArray:
    return np.array(list(rows), dtype=np.float64).reshape(-1, width)
