"""The motion of one vehicle in a scene: the compiled engine wherever it has the backend and the ground, else Python."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final, Protocol

import numpy as np

from ...terrain import (
    ConfigurationError,
    ForceBackend,
    Ground,
    OffMapError,
    SimulationDivergedError,
    TrackedVehicle,
    unknown_name,
)
from ..engine import check_mode
from ..fleet import VehicleFleet
from ..footing import GroundSampling, sample_ground
from ..simulator import Simulator, TickRecord, check_tick
from ..state import BeltCommand, VehicleState
from ..tick import Integrator
from ..tracked_env import ENGINES, Engine


@dataclass(frozen=True, eq=False)
class MotionModel:
    """How a vehicle is moved.

    Parameters
    ----------
    vehicle : TrackedVehicle
        The vehicle.
    backend : ForceBackend
        Of the vehicle, and of the ground's mode.
    ground : Ground
        Under it.
    tick : float
        T_s in s.
    integrator : {"implicit", "sdirk2", "euler"}
        As the simulator's.
    ground_sampling : {"vehicle", "tracks"}
        As the simulator's.
    engine : {"compiled", "python"}, optional
        What computes the ticks; the compiled engine by default, wherever it has the backend and the ground.

    Raises
    ------
    ConfigurationError
        If a name is unknown, or the parts do not fit together.
    InvalidInputError
        If the tick is not in (0, 1] s.
    """

    vehicle: TrackedVehicle
    backend: ForceBackend
    ground: Ground
    tick: float = 0.01
    integrator: Integrator = "implicit"
    ground_sampling: GroundSampling = "vehicle"
    engine: Engine | None = None

    def __post_init__(self) -> None:
        if self.engine is not None and self.engine not in ENGINES:
            raise unknown_name("engine", self.engine, ENGINES)
        check_tick(self.backend, self.tick, self.integrator, self.ground_sampling)

    def __deepcopy__(self, memo: dict[int, Any]) -> MotionModel:
        # Nothing of it ever changes, and a copied backend would compile its kernel anew.
        return self


class Motion:
    """One vehicle that can be advanced by any number of ticks, replaced and copied.

    Parameters
    ----------
    model : MotionModel
        How it is moved.
    state : VehicleState
        Initial state.
    """

    def __init__(self, model: MotionModel, state: VehicleState = VehicleState()) -> None:  # noqa: B008 - frozen
        self._model = model
        self._state: VehicleState | None = state
        self._engine: _Engine | None = None

    @property
    def model(self) -> MotionModel:
        """How the vehicle is moved."""
        return self._model

    @property
    def state(self) -> VehicleState:
        """The whole state, the guard's memory included."""
        if self._state is None:
            self._state = self._running.state()
        return self._state

    @state.setter
    def state(self, state: VehicleState) -> None:
        self._state = state
        if self._engine is not None:
            self._engine.set_state(state)

    @property
    def tick(self) -> float:
        """T_s in s."""
        return self._model.tick

    @tick.setter
    def tick(self, tick: float) -> None:
        if tick != self._model.tick:
            self._rebuild(replace(self._model, tick=tick))

    @property
    def ground(self) -> Ground:
        """The ground under the vehicle."""
        return self._model.ground

    @ground.setter
    def ground(self, ground: Ground) -> None:
        if ground is self._model.ground:
            return
        model = replace(self._model, ground=check_mode(ground, self._model.backend.mode))
        if self._engine is not None and self._engine.takes(ground):
            self._model = model
        else:
            self._rebuild(model)

    def advance(self, command: BeltCommand, ticks: int) -> None:
        """Hold a command for a number of ticks.

        Raises
        ------
        InvalidInputError
            If the command is not finite or out of the drive's reach.
        OffMapError, SimulationDivergedError
            If a tick cannot be solved; the vehicle stays where the last one left it.
        """
        engine = self._running
        self._state = None
        engine.advance(command, ticks)

    def pose_and_motion(self) -> tuple[float, float, float, float, float, float]:
        """Return x, y, heading, vx, vy and yaw rate, without the rest of the state."""
        if self._state is None:
            return self._running.pose_and_motion()
        state = self._state
        return state.x, state.y, state.heading, state.vx, state.vy, state.yaw_rate

    def last_tick(self) -> TickRecord:
        """Return what the last tick did.

        Raises
        ------
        ConfigurationError
            If there was none yet.
        """
        return self._running.record()

    def copy(self) -> Motion:
        """Return another motion on the same backend and ground, in the same state."""
        return Motion(self._model, self.state)

    def __deepcopy__(self, memo: dict[int, Any]) -> Motion:
        return self.copy()

    @property
    def _running(self) -> _Engine:
        if self._engine is None:
            self._engine = _make_engine(self._model, self.state)
        return self._engine

    def _rebuild(self, model: MotionModel) -> None:
        self._state = self.state
        self._model, self._engine = model, None


class _Engine(Protocol):
    def advance(self, command: BeltCommand, ticks: int) -> None: ...

    def state(self) -> VehicleState: ...

    def set_state(self, state: VehicleState) -> None: ...

    def takes(self, ground: Ground) -> bool:
        """Put the vehicle on another ground, or say that the engine does not have it."""

    def pose_and_motion(self) -> tuple[float, float, float, float, float, float]: ...

    def record(self) -> TickRecord: ...


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

    def advance(self, command: BeltCommand, ticks: int) -> None:
        fleet = self._fleet
        self._command[0] = command
        # What the last tick did is told from the pose at which it began.
        if ticks > 1:
            fleet.advance(self._command, ticks - 1)
        x, y, heading = fleet.numbers[:3, 0].tolist()
        self._pose = x, y, heading
        fleet.advance(self._command, 1)
        if fleet.off_map[0]:
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

    def pose_and_motion(self) -> tuple[float, float, float, float, float, float]:
        x, y, heading, vx, vy, yaw_rate = self._fleet.numbers[:6, 0].tolist()
        return x, y, heading, vx, vy, yaw_rate

    def record(self) -> TickRecord:
        if self._pose is None:
            raise ConfigurationError("no tick was simulated yet")
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

    def advance(self, command: BeltCommand, ticks: int) -> None:
        for _ in range(ticks):
            self._record = self._simulator.step(command)

    def state(self) -> VehicleState:
        return self._simulator.get_state()

    def set_state(self, state: VehicleState) -> None:
        self._simulator.set_state(state)

    def takes(self, ground: Ground) -> bool:
        self._simulator.set_ground(ground)
        return True

    def pose_and_motion(self) -> tuple[float, float, float, float, float, float]:
        state = self._simulator.get_state()
        return state.x, state.y, state.heading, state.vx, state.vy, state.yaw_rate

    def record(self) -> TickRecord:
        if self._record is None:
            raise ConfigurationError("no tick was simulated yet")
        return self._record


def _make_engine(model: MotionModel, state: VehicleState) -> _Engine:
    if model.engine != "python":
        try:
            return _Compiled(model, state)
        except ConfigurationError:
            if model.engine == "compiled":
                raise
    return _Reference(model, state)
