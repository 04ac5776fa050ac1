"""What of a vehicle's state is asked for at every step."""

from __future__ import annotations

from typing import NamedTuple

from ..state import VehicleState


class Kinematics(NamedTuple):
    """Pose, motion and belts: what of a state is asked for at every step, without the rest.

    Parameters
    ----------
    x, y, heading, vx, vy, yaw_rate, v_left, v_right : float
        As of :class:`~grouser.envs.VehicleState`.
    """

    x: float
    y: float
    heading: float
    vx: float
    vy: float
    yaw_rate: float
    v_left: float
    v_right: float

    @classmethod
    def of(cls, state: VehicleState) -> Kinematics:
        """Return that of a state."""
        motion = state.vx, state.vy, state.yaw_rate
        return cls(state.x, state.y, state.heading, *motion, state.v_left, state.v_right)
