"""The motion of one vehicle in a scene."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ...terrain import Ground
from ..engine import check_mode
from ..simulator import TickRecord
from ..state import BeltCommand, VehicleState
from .kinematics import Kinematics
from .motion_engine import MotionEngine, make_engine
from .motion_model import MotionModel


class Motion:
    """One vehicle that can be advanced by any number of ticks, replaced and copied.

    Parameters
    ----------
    model : MotionModel
        How it is moved.
    state : VehicleState
        Initial state.

    Attributes
    ----------
    watched : bool
        Whether :meth:`last_tick` will be asked for; what moves the vehicle then stops before each last tick.
    """

    def __init__(self, model: MotionModel, state: VehicleState = VehicleState()) -> None:  # noqa: B008 - frozen
        self._model = model
        self._state: VehicleState | None = state
        self._engine: MotionEngine | None = None
        self.watched = False

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
        engine.advance(command, ticks, self.watched)

    def kinematics(self) -> Kinematics:
        """Return pose, motion and belts."""
        return self._running.kinematics() if self._state is None else Kinematics.of(self._state)

    def last_tick(self) -> TickRecord:
        """Return what the last tick did.

        Raises
        ------
        ConfigurationError
            If there was none yet, or nobody watched it.
        """
        return self._running.record()

    def copy(self) -> Motion:
        """Return another motion on the same backend and ground, in the same state."""
        copied = Motion(self._model, self.state)
        copied.watched = self.watched
        return copied

    def __deepcopy__(self, memo: dict[int, Any]) -> Motion:
        return self.copy()

    @property
    def _running(self) -> MotionEngine:
        if self._engine is None:
            self._engine = make_engine(self._model, self.state)
        return self._engine

    def _rebuild(self, model: MotionModel) -> None:
        self._state = self.state
        self._model, self._engine = model, None
