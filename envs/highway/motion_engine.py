"""What computes the ticks of one vehicle: a fleet of one in compiled code, or the simulator, its reference."""

from __future__ import annotations

from typing import Final, Protocol

import numpy as np

from ...terrain import ConfigurationError, Ground, OffMapError, SimulationDivergedError
from ..driveline import check_command
from ..fleet import VehicleFleet
from ..footing import sample_ground
from ..simulator import Simulator, TickRecord
from ..state import BeltCommand, VehicleState
from .kinematics import Kinematics
from .motion_model import MotionModel

# Rows of a fleet's numbers, in the order of STATE_NAMES, that make up the kinematics.
_KINEMATIC_ROWS: Final = 8


class MotionEngine(Protocol):
    """What computes the ticks of one vehicle."""

    def advance(self, command: BeltCommand, ticks: int, watched: bool) -> None:
        """Hold a command for a number of ticks; ``watched`` where :meth:`record` will be asked for."""

    def state(self) -> VehicleState:
        """Return the whole state."""

    def set_state(self, state: VehicleState) -> None:
        """Replace the whole state."""

    def takes(self, ground: Ground) -> bool:
        """Put the vehicle on another ground, or say that the engine does not have it."""

    def kinematics(self) -> Kinematics:
        """Return pose, motion and belts."""

    def record(self) -> TickRecord:
        """Return what the last tick did."""


class _Compiled:
    """A fleet of one."""

    def __init__(self, model: MotionModel, state: VehicleState) -> None:
        self._fleet: Final = VehicleFleet(
            model.vehicle,
            model.backend,
            model.ground,
            1,
            tick=model.tick,
            integrator=model.integrator,
            ground_sampling=model.ground_sampling,
            state=state,
        )
        self._command = np.zeros((1, 2))
        self._pose: tuple[float, float, float] | None = None

    def advance(self, command: BeltCommand, ticks: int, watched: bool) -> None:
        fleet = self._fleet
        # Checked here, for one vehicle, in place of the fleet's own checks, which are made for many.
        self._command[0] = check_command(fleet.vehicle, command)
        self._pose = None
        if watched:
            # What the last tick did is told from the pose at which it began.
            if ticks > 1:
                fleet.compiled.advance(self._command, ticks - 1)
            x, y, heading = fleet.numbers[:3, 0].tolist()
            self._pose, ticks = (x, y, heading), 1
        fleet.compiled.advance(self._command, ticks)
        if fleet.off_map[0]:
            x, y, *_ = self.kinematics()
            raise OffMapError(f"the vehicle left its terrain field's map near ({x:.3f}, {y:.3f}) m")
        if fleet.diverged[0]:
            raise SimulationDivergedError(
                f"no tick of {fleet.tick:g} s was solved (backend {fleet.backend.name})", self.state()
            )

    def state(self) -> VehicleState:
        return self._fleet.get_state(0)

    def set_state(self, state: VehicleState) -> None:
        self._fleet.set_state(0, state)

    def takes(self, ground: Ground) -> bool:
        try:
            self._fleet.set_ground(0, ground)
        except ConfigurationError:
            return False
        return True

    def kinematics(self) -> Kinematics:
        return Kinematics._make(self._fleet.numbers[:_KINEMATIC_ROWS, 0].tolist())

    def record(self) -> TickRecord:
        if self._pose is None:
            raise ConfigurationError("nobody watched the last tick: set watched before the vehicle is moved")
        fleet, record = self._fleet, self._fleet.record
        x, y, heading = self._pose
        return TickRecord(
            record.row[0].copy(),
            record.forces[0].copy(),
            fleet.get_state(0),
            int(record.iterations[0]),
            int(record.divisions[0]),
            fleet.detection(0),
            sample_ground(fleet.ground(0), fleet.vehicle, fleet.ground_sampling, x=x, y=y, heading=heading),
        )


class _Reference:
    """The simulator."""

    def __init__(self, model: MotionModel, state: VehicleState) -> None:
        self._simulator: Final = Simulator(
            model.vehicle,
            model.backend,
            model.ground,
            tick=model.tick,
            integrator=model.integrator,
            ground_sampling=model.ground_sampling,
            state=state,
        )
        self._record: TickRecord | None = None

    def advance(self, command: BeltCommand, ticks: int, watched: bool) -> None:
        for _ in range(ticks):
            self._record = self._simulator.step(command)

    def state(self) -> VehicleState:
        return self._simulator.get_state()

    def set_state(self, state: VehicleState) -> None:
        self._simulator.set_state(state)

    def takes(self, ground: Ground) -> bool:
        self._simulator.set_ground(ground)
        return True

    def kinematics(self) -> Kinematics:
        return Kinematics.of(self._simulator.get_state())

    def record(self) -> TickRecord:
        if self._record is None:
            raise ConfigurationError("no tick was simulated yet")
        return self._record


def make_engine(model: MotionModel, state: VehicleState) -> MotionEngine:
    """Return the compiled engine wherever it has the backend and the ground, else the simulator, unless one is asked for.

    Raises
    ------
    ConfigurationError
        If the compiled engine is asked for and has not.
    """
    if model.engine != "python":
        try:
            return _Compiled(model, state)
        except ConfigurationError:
            if model.engine == "compiled":
                raise
    return _Reference(model, state)
