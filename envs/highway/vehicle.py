"""A tracked vehicle as a vehicle of highway-env: its roads, lanes, collisions and pictures, our motion."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...terrain import (
    FloatArray,
    Ground,
    GrouserError,
    InvalidInputError,
    TrackedVehicle,
)
from ..state import BeltCommand, VehicleState
from .collision import Box, certainly_apart
from .commands import Command, as_command, bicycle_belts, cruising_belts
from .dependency import import_highway_env
from .footprint import footprint_of
from .kinematics import Kinematics
from .motion import Motion
from .motion_model import MotionModel, standard_model
from .prediction import predict

_Vehicle: Any = import_highway_env("vehicle.kinematics").Vehicle
_utils = import_highway_env("utils")

# Fractions of a tick that rounding may take from a step.
_WHOLE = 1e-9


class TrackedHighwayVehicle(_Vehicle):  # type: ignore[misc]
    """A tracked vehicle on a highway-env road.

    Its motion is that of :class:`~grouser.envs.Simulator`: slip, side-slip, belts, acceleration memory and guard
    included. ``position`` is the CG, ``speed`` the forward speed Vx, ``velocity`` the CG's with its side-slip; the
    footprint lies about the middle of the contact length. The plane is ours, y to the left of x, which highway-env
    draws downwards: its pictures are mirrored, and what is left here appears on the right there.

    ``step(dt)`` is simulated in equal ticks of at most the model's, none of them cut off: 1/15 s in 7 ticks of 9.5 ms.

    A command is a :class:`~grouser.envs.BeltCommand`, or highway-env's dict of ``acceleration`` a and ``steering`` δ.
    The dict asks for the motion of highway-env's bicycle of the same length: a mean belt speed V that changes at a, and
    the yaw rate ω = V sin β/(length/2) with tan β = ½ tan δ, so that the belts are commanded to V ∓ ω B/2. Slip, the
    drive's lag and its limits then make of it what they do. ``None`` holds the last command. A vehicle that has crashed
    brakes as highway-env's do.

    Whoever writes ``position``, ``heading`` or ``speed`` moves the vehicle; belts keep their slip.

    Parameters
    ----------
    road : highway_env.road.road.Road or None
        The road.
    position : array_like, shape (2,)
        Of the CG in m.
    heading : float
        In rad.
    speed : float or None
        At which it rolls straight ahead, in m/s, cut to what the drive can reach; None is 0.
    predition_type : {"constant_steering", "zero_steering"}
        What :meth:`predict_trajectory_constant_speed` holds; spelt as highway-env spells it.
    model : MotionModel, optional
        How it moves; by default the class's own, see :func:`~grouser.envs.tracked_vehicle_class`.
    size : tuple of float, optional
        Length and width in m, if not the class's own.
    """

    LENGTH, WIDTH = footprint_of(TrackedVehicle.preset("m113"))
    impact: Any

    def __init__(
        self,
        road: Any,
        position: ArrayLike,
        heading: float = 0.0,
        speed: float | None = 0.0,
        predition_type: str = "constant_steering",
        *,
        model: MotionModel | None = None,
        size: tuple[float, float] | None = None,
    ) -> None:
        if model is not None or size is not None:
            model = model or self.default_model()
            self.LENGTH, self.WIDTH = footprint_of(model.vehicle, size)
        self._model = model = model or self.default_model()
        limit = model.vehicle.maximum_speed
        self.MIN_SPEED, self.MAX_SPEED = -limit, limit
        self._index: Any = None
        self._lane: Any = None
        x, y = np.asarray(position, dtype=np.float64).tolist()
        rolling = min(limit, max(-limit, float(speed or 0.0)))
        super().__init__(road, position, float(heading), rolling, predition_type)
        self._belts: BeltCommand | None = None
        self._motion = Motion(model, VehicleState.rolling(rolling, x=x, y=y, heading=float(heading)))
        self._written = (x, y, self.heading, self.speed)

    @classmethod
    def default_model(cls) -> MotionModel:
        """Return how vehicles of this class move unless their constructor says otherwise."""
        return standard_model()

    @classmethod
    def create_from(cls, vehicle: Any) -> TrackedHighwayVehicle:
        """Return a new vehicle in another's state, with its model where it is tracked as well."""
        if not isinstance(vehicle, TrackedHighwayVehicle):
            made = cls(vehicle.road, vehicle.position, vehicle.heading, vehicle.speed)
        else:
            state = vehicle.state
            made = cls(
                vehicle.road,
                vehicle.position,
                vehicle.heading,
                vehicle.speed,
                vehicle.prediction_type,
                model=vehicle.model,
                size=(vehicle.LENGTH, vehicle.WIDTH),
            )
            made.state = state
        if hasattr(vehicle, "color"):
            made.color = vehicle.color
        return made

    @property
    def model(self) -> MotionModel:
        """How the vehicle moves."""
        return self._model

    @property
    def state(self) -> VehicleState:
        """The whole state; setting it places the vehicle."""
        self._take_what_was_written()
        return self._motion.state

    @state.setter
    def state(self, state: VehicleState) -> None:
        self._motion.state = state
        self._write(state.x, state.y, state.heading, state.vx)

    @property
    def motion(self) -> Motion:
        """What moves it."""
        return self._motion

    def kinematics(self) -> Kinematics:
        """Return pose, motion and belts."""
        self._take_what_was_written()
        return self._motion.kinematics()

    def set_ground(self, ground: Ground) -> None:
        """Put the vehicle on another ground.

        Raises
        ------
        ConfigurationError
            If its mode is another.
        """
        self._motion.ground = ground
        self._model = replace(self._model, ground=ground)

    @property
    def lane_index(self) -> Any:
        """Index of the closest lane, looked up when it is asked for: highway-env searches every lane at every step."""
        if self._index is None and self.road:
            self._index = self.road.network.get_closest_lane_index(self.position, self.heading)
        return self._index

    @lane_index.setter
    def lane_index(self, index: Any) -> None:
        self._index = index

    @property
    def lane(self) -> Any:
        """The closest lane."""
        if self._lane is None and self.road:
            self._lane = self.road.network.get_lane(self.lane_index)
        return self._lane

    @lane.setter
    def lane(self, lane: Any) -> None:
        self._lane = lane

    def act(self, action: Command | None = None) -> None:
        """Store a command, to be held until another comes.

        Raises
        ------
        InvalidInputError
            If it is none of those that the class takes, or not finite.
        """
        if action is None:
            return
        command = as_command(action)
        if isinstance(command, BeltCommand):
            self._belts = command
        else:
            self._belts, self.action = None, dict(command)

    def randomize_behavior(self) -> None:
        """Do nothing: a tracked vehicle among the others keeps its speed and has no behaviour to draw."""

    def clip_actions(self) -> None:
        """Let a crashed vehicle brake, and keep the acceleration from leading beyond the speed limits."""
        if self.crashed:
            self._belts = None
        super().clip_actions()

    def step(self, dt: float) -> None:
        """Advance by ``dt`` s.

        Raises
        ------
        InvalidInputError
            If the belts are commanded beyond the drive's reach.
        OffMapError, SimulationDivergedError
            If a tick cannot be solved; the vehicle stays where the last one left it.
        """
        self._take_what_was_written()
        self.clip_actions()
        motion, longest = self._motion, self._model.tick
        ticks = max(1, math.ceil(dt / longest - _WHOLE))
        motion.tick = longest if abs(dt - ticks * longest) <= _WHOLE * dt else dt / ticks
        try:
            motion.advance(self._belts or self._bicycle_belts(dt), ticks)
        except GrouserError:
            x, y, heading, vx, *_ = motion.kinematics()
            self._write(x, y, heading, vx)
            raise
        x, y, heading, vx, *_ = motion.kinematics()
        if self.impact is not None:
            x, y = x + float(self.impact[0]), y + float(self.impact[1])
            motion.state = replace(motion.state, x=x, y=y)
            self.crashed = True
            self.impact = None
        self._write(x, y, heading, vx)
        self.on_state_update()

    def on_state_update(self) -> None:
        """Forget the lane, and remember the state where the road records history."""
        self._index = self._lane = None
        if self.road and self.road.record_history:
            self.history.appendleft(self.create_from(self))

    def predict_trajectory_constant_speed(self, times: ArrayLike) -> tuple[list[FloatArray], list[float]]:
        """Return positions and headings at times in s from now, to the nearest tick.

        The belts hold the command, or at ``prediction_type="zero_steering"`` their mean speed.
        """
        if self.prediction_type not in ("constant_steering", "zero_steering"):
            raise InvalidInputError(f"unknown prediction type {self.prediction_type!r}")
        self._take_what_was_written()
        steered = self.prediction_type == "constant_steering"
        if steered and self._belts is not None:
            return predict(self._motion, self._belts, times)
        steering = float(self.action["steering"]) if steered else 0.0
        vehicle, state = self._model.vehicle, self._motion.kinematics()
        belts = cruising_belts(state, steering, vehicle=vehicle, length=self.LENGTH)
        return predict(self._motion, belts, times)

    @property
    def velocity(self) -> FloatArray:
        """Of the CG in m/s, side-slip included."""
        self._take_what_was_written()
        _, _, heading, vx, vy, *_ = self._motion.kinematics()
        cosine, sine = math.cos(heading), math.sin(heading)
        return np.array([cosine * vx - sine * vy, sine * vx + cosine * vy])

    @property
    def side_slip(self) -> float:
        """Angle from the body x axis to the velocity, in rad; 0 at rest."""
        _, _, _, vx, vy, *_ = self._motion.kinematics()
        return math.atan2(vy, vx)

    def to_dict(self, origin_vehicle: Any = None, observe_intentions: bool = True) -> dict[str, Any]:
        """Return highway-env's features, and ``yaw_rate``, ``side_slip``, ``v_left`` and ``v_right``."""
        state = self.state
        features: dict[str, Any] = super().to_dict(origin_vehicle, observe_intentions)
        return features | {
            "yaw_rate": state.yaw_rate,
            "side_slip": self.side_slip,
            "v_left": state.v_left,
            "v_right": state.v_right,
        }

    def box(self) -> Box:
        """Return the rectangle that it covers."""
        ahead = self.model.vehicle.contact_center
        x, y = self.position.tolist()
        cosine, sine = math.cos(self.heading), math.sin(self.heading)
        return Box(x + ahead * cosine, y + ahead * sine, self.heading, self.LENGTH, self.WIDTH)

    def polygon(self) -> FloatArray:
        """Return its corners, the first one repeated at the end, shape (5, 2)."""
        corners: FloatArray = super().polygon()
        ahead = self.model.vehicle.contact_center
        return corners + ahead * self.direction if ahead else corners

    def _is_colliding(self, other: Any, dt: float) -> tuple[bool, bool, Any]:
        if isinstance(other, TrackedHighwayVehicle):
            theirs, speed = other.box(), other._ground_speed
        else:
            x, y = other.position.tolist()
            theirs = Box(x, y, float(other.heading), float(other.LENGTH), float(other.WIDTH))
            speed = abs(float(other.speed or 0.0))
        if certainly_apart(self.box(), theirs, (self._ground_speed + speed) * dt):
            return False, False, np.zeros(2)
        meeting: tuple[bool, bool, Any] = _utils.are_polygons_intersecting(
            self.polygon(), other.polygon(), self.velocity * dt, other.velocity * dt
        )
        return meeting

    @property
    def _ground_speed(self) -> float:
        _, _, _, vx, vy, *_ = self._motion.kinematics()
        return math.hypot(vx, vy)

    def _bicycle_belts(self, dt: float) -> BeltCommand:
        speeds = self.MIN_SPEED, self.MAX_SPEED
        vehicle, state = self._model.vehicle, self._motion.kinematics()
        return bicycle_belts(state, self.action, dt, vehicle=vehicle, length=self.LENGTH, speeds=speeds)

    def _write(self, x: float, y: float, heading: float, speed: float) -> None:
        self.position = np.array([x, y])
        self.heading, self.speed = heading, speed
        self._written = (x, y, heading, speed)

    def _take_what_was_written(self) -> None:
        """Move the vehicle to where somebody put its public attributes."""
        x, y = self.position.tolist()
        now = (x, y, float(self.heading), float(self.speed))
        if now == self._written:
            return
        state, gain = self._motion.state, now[3] - self._written[3]
        self._motion.state = replace(
            state,
            x=x,
            y=y,
            heading=now[2],
            vx=now[3] if gain else state.vx,
            v_left=state.v_left + gain,
            v_right=state.v_right + gain,
        )
        self._written = now
