"""What a simulated vehicle carries from tick to tick, and who commands it."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Final, NamedTuple, Protocol

from ..terrain import GuardState, InvalidInputError


class BeltCommand(NamedTuple):
    """Commanded belt speeds in m/s, positive drives forward."""

    left: float
    right: float


_FRESH_GUARD: Final = GuardState()


@dataclass(frozen=True)
class VehicleState:
    """Pose, motion, belts, acceleration memory and guard memory.

    Parameters
    ----------
    x, y : float
        Position of the CG in the plane, in m.
    heading : float
        Direction of the body x axis in rad, counter-clockwise from the plane's x axis; not wrapped.
    vx, vy : float
        Velocity of the CG in body axes, in m/s.
    yaw_rate : float
        In rad/s.
    v_left, v_right : float
        Belt speeds in m/s.
    ax, ay : float
        Memory: Qx/m and Qy/m of the previous tick, in m/s².
    time : float
        In s.
    guard : GuardState
        Memory of a guarded backend; unused by the others.

    Raises
    ------
    InvalidInputError
        If a number is not finite.
    """

    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0
    vx: float = 0.0
    vy: float = 0.0
    yaw_rate: float = 0.0
    v_left: float = 0.0
    v_right: float = 0.0
    ax: float = 0.0
    ay: float = 0.0
    time: float = 0.0
    guard: GuardState = _FRESH_GUARD

    def __post_init__(self) -> None:
        # One sum, since a state is made every tick: it is finite only where every number is.
        motion = self.x + self.y + self.heading + self.vx + self.vy + self.yaw_rate
        if not math.isfinite(motion + self.v_left + self.v_right + self.ax + self.ay + self.time):
            numbers = {field.name: getattr(self, field.name) for field in fields(self) if field.name != "guard"}
            bad = ", ".join(f"{name} = {value!r}" for name, value in numbers.items() if not math.isfinite(value))
            raise InvalidInputError(f"the numbers of a vehicle state must be finite: {bad or numbers}")

    @classmethod
    def rolling(cls, speed: float, *, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> VehicleState:
        """Return a vehicle that rolls straight ahead, belts at its speed in m/s."""
        return cls(x=x, y=y, heading=heading, vx=speed, v_left=speed, v_right=speed)


class Driver(Protocol):
    """Who drives: a controller, a maneuver, a policy. Called once a control period."""

    def reset(self) -> None:
        """Forget the last drive."""

    def command(self, state: VehicleState) -> BeltCommand:
        """Return the belt-speed command for the state."""
