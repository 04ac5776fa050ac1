"""Pure pursuit for a skid-steer: aim at a point ahead on the path, and keep the speed by a PI loop."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from typing import Final

from ..envs.path import Path
from ..envs.state import BeltCommand, VehicleState
from ..terrain import TrackedVehicle, resolve_vehicle
from ..terrain.parameters import require_in
from .slip_model import SlipParameters
from .speed_profile import SpeedProfile

_NO_SLIP: Final = SlipParameters()


@dataclass(frozen=True)
class PurePursuitConfig:
    """Settings of :class:`PurePursuit`.

    Parameters
    ----------
    lookahead_time, lookahead_minimum : float
        The aim lies lookahead_time · speed ahead, in s, and at least lookahead_minimum, in m.
    proportional, integral : float
        Gains of the speed loop, in 1 and 1/s.
    lateral_acceleration : float
        Limit on speed² · curvature in m/s²; by default none.
    stop_at_end : bool
        Whether to come to rest at the end of an open path.
    period : float
        Control period in s, over which the integral advances.

    Raises
    ------
    InvalidInputError
        If a number is out of range.
    """

    lookahead_time: float = 0.8
    lookahead_minimum: float = 1.5
    proportional: float = 0.5
    integral: float = 0.5
    lateral_acceleration: float = math.inf
    stop_at_end: bool = False
    period: float = 0.1

    def __post_init__(self) -> None:
        require_in("lookahead_time", self.lookahead_time, 0.0, 60.0)
        require_in("lookahead_minimum", self.lookahead_minimum, 0.0, 1e3, low_open=True)
        require_in("proportional", self.proportional, 0.0, 100.0)
        require_in("integral", self.integral, 0.0, 100.0)
        require_in("lateral_acceleration", self.lateral_acceleration, 0.0, math.inf, low_open=True)
        require_in("period", self.period, 0.0, 10.0, low_open=True)


class PurePursuit:
    """Drives along a path.

    The arc from the CG to the aim, tangent to the body x axis, has curvature κ = 2 y/d², with y the aim's lateral
    position and d its distance. The belts are those that the slip model asks for at speed v and yaw rate κ v: without
    slip, v ∓ κ v B/2. Where both do not fit within the training speed, the turn keeps its belt difference and the
    speed gives way.

    Parameters
    ----------
    path : Path
        The path.
    vehicle : str or TrackedVehicle
        Preset name or vehicle.
    speed : float
        Target speed in m/s, in (0, training speed].
    slip : SlipParameters
        Losses to make up for; none by default.
    config : PurePursuitConfig
        Settings.

    Raises
    ------
    InvalidInputError
        If the speed is out of range.
    """

    def __init__(
        self,
        path: Path,
        vehicle: str | os.PathLike[str] | TrackedVehicle,
        speed: float = 5.0,
        *,
        slip: SlipParameters = _NO_SLIP,
        config: PurePursuitConfig = PurePursuitConfig(),
    ) -> None:
        self.path: Final = path
        self.vehicle: Final = resolve_vehicle(vehicle)
        require_in("speed", speed, 0.0, self.vehicle.training_speed, low_open=True)
        self.slip: Final = slip
        self.config: Final = config
        self.profile: Final = SpeedProfile.along(
            path, speed, lateral_acceleration=config.lateral_acceleration, stop_at_end=config.stop_at_end
        )
        self.reset()

    @property
    def period(self) -> float:
        """The control period in s, which the speed loop integrates over."""
        return self.config.period

    def reset(self) -> None:
        """Forget where on the path the vehicle is, and the speed loop's integral."""
        self._arc_length: float | None = None
        self._integral = 0.0

    def command(self, state: VehicleState) -> BeltCommand:
        """Return the belt-speed command for the state."""
        foot = self.path.project(state.x, state.y, self._arc_length, heading=state.heading)
        self._arc_length = foot.arc_length
        yaw_rate = self._curvature(state, foot.arc_length) * state.vx
        half = self.slip.belts(0.0, yaw_rate, self.vehicle.tread).right
        limit = self.vehicle.training_speed
        half = min(max(half, -limit), limit)
        mean = self._mean_belt(state, float(self.profile.at(foot.arc_length)), limit - abs(half))
        return BeltCommand(mean - half, mean + half)

    def _curvature(self, state: VehicleState, arc_length: float) -> float:
        reach = max(self.config.lookahead_minimum, self.config.lookahead_time * abs(state.vx))
        x, y = self.path.point_at(arc_length + reach)
        dx, dy = x - state.x, y - state.y
        lateral = math.cos(state.heading) * dy - math.sin(state.heading) * dx
        # Far off the path the aim is no nearer than the look-ahead; right at it, the arc must stay finite.
        return 2 * lateral / max(dx * dx + dy * dy, reach * reach / 4)

    def _mean_belt(self, state: VehicleState, reference: float, limit: float) -> float:
        """Return the mean belt speed within ±limit; the integral stands still while the drive cannot follow it."""
        error = reference - state.vx
        forward = reference / self.slip.longitudinal_gain + self.config.proportional * error
        advanced = self._integral + self.config.integral * self.config.period * error
        wanted = forward + advanced
        mean = min(max(wanted, -limit), limit)
        # Beyond a·T_d from its speed a belt ramps at its greatest acceleration, whatever the command.
        ramp = self.vehicle.belt_acceleration * self.vehicle.belt_time_constant
        belt = (state.v_left + state.v_right) / 2
        followed = min(max(mean, belt - ramp), belt + ramp)
        if wanted == followed or (wanted - followed) * error < 0:
            self._integral = advanced
        return mean
