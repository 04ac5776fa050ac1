"""Kinematic skid-steer with slip: a few numbers that say how belt speeds become motion, and their identification."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np

from ..envs.simulator import Simulator
from ..envs.state import BeltCommand, VehicleState
from ..terrain import FloatArray, ForceBackend, Ground, InvalidInputError, TrackedVehicle, resolve_vehicle
from ..terrain.parameters import require_in

_TICK: Final = 0.01
_SETTLE: Final = 4.0
_MEASURE: Final = 1.0
# Below this lag the yaw rate is, over a step of a horizon, the steady one to the last digit that matters.
_SHORTEST_LAG: Final = 1e-3


@dataclass(frozen=True)
class SlipParameters:
    """How belt speeds become motion: gains, the instantaneous centre of rotation, and the lag of the yaw rate.

    In steady motion, with V_L, V_R the belt speeds and B the tread::

        vx = longitudinal_gain · (V_L + V_R)/2
        ω  = yaw_gain · (V_R − V_L)/B
        vy = −icr_offset · ω

    The yaw rate approaches its steady value by a first-order lag. The defaults are a vehicle that does not slip.

    Parameters
    ----------
    longitudinal_gain : float
        α_v, in (0, 1.5].
    yaw_gain : float
        α_ω, in (0, 1.5]; below 1 where skidding eats part of the turn.
    icr_offset : float
        Where the instantaneous centre of rotation lies ahead of the CG (negative: behind), in m, in [−20, 20]. The
        body point there does not move sideways: vy + icr_offset · ω = 0. Ahead means that the tail swings out.
    yaw_lag : float
        T_ω in s, in [0, 5]: by how much the yaw rate lags behind the belts.

    Raises
    ------
    InvalidInputError
        If a number is out of range.
    """

    longitudinal_gain: float = 1.0
    yaw_gain: float = 1.0
    icr_offset: float = 0.0
    yaw_lag: float = 0.0

    def __post_init__(self) -> None:
        require_in("longitudinal_gain", self.longitudinal_gain, 0.0, 1.5, low_open=True)
        require_in("yaw_gain", self.yaw_gain, 0.0, 1.5, low_open=True)
        require_in("icr_offset", self.icr_offset, -20.0, 20.0)
        require_in("yaw_lag", self.yaw_lag, 0.0, 5.0)

    def twist(self, v_left: Any, v_right: Any, tread: float) -> tuple[Any, Any, Any]:
        """Return steady vx, vy in m/s and yaw rate in rad/s for belt speeds in m/s; numbers, arrays or symbols."""
        yaw_rate = self.yaw_gain * (v_right - v_left) / tread
        return self.longitudinal_gain * (v_left + v_right) / 2, -self.icr_offset * yaw_rate, yaw_rate

    def belts(self, speed: float, yaw_rate: float, tread: float) -> BeltCommand:
        """Return the belt speeds in m/s that give forward speed in m/s and yaw rate in rad/s: inverse of twist."""
        mean = speed / self.longitudinal_gain
        half = yaw_rate * tread / (2 * self.yaw_gain)
        return BeltCommand(mean - half, mean + half)


class PredictionModel:
    """Kinematic skid-steer with slip over one step, belts and yaw rate following by first-order lags.

    The state is (x, y, ψ, ω, V_L, V_R), the command (u_L, u_R) is held. Heading, yaw rate and belts are linear and
    stepped exactly, by the matrix exponential, so that no lag is too short for the step; the position is Simpson's
    rule over the step, of the order of a fourth-order Runge-Kutta step.

    Parameters
    ----------
    vehicle : TrackedVehicle
        Tread and belt lag.
    slip : SlipParameters
        How belt speeds become motion.
    period : float
        Length of the step in s.
    """

    def __init__(self, vehicle: TrackedVehicle, slip: SlipParameters, period: float) -> None:
        self.slip: Final = slip
        self.tread: Final = vehicle.tread
        self.period: Final = period
        lag, belt = max(slip.yaw_lag, _SHORTEST_LAG), vehicle.belt_time_constant
        gain = slip.yaw_gain / (vehicle.tread * lag)
        rates = np.zeros((6, 6))
        rates[0, 1] = 1.0
        rates[1, 1:4] = -1 / lag, -gain, gain
        rates[2, 2], rates[2, 4] = -1 / belt, 1 / belt
        rates[3, 3], rates[3, 5] = -1 / belt, 1 / belt
        self._half: Final = _exponential(rates * period / 2)[:4].tolist()
        self._whole: Final = _exponential(rates * period)[:4].tolist()

    def step(self, state: Sequence[Any], command: Sequence[Any], functions: Any = np) -> list[Any]:
        """Return the state one step on.

        Parameters
        ----------
        state : sequence of 6
            (x, y, ψ, ω, V_L, V_R): numbers, arrays or symbols.
        command : sequence of 2
            (u_L, u_R) in m/s.
        functions : module
            Where ``cos`` and ``sin`` come from: ``numpy`` or ``casadi``.
        """
        start = list(state[2:6])
        middle, end = (
            [sum(c * value for c, value in zip(row, [*start, *command], strict=True) if c != 0.0) for row in matrix]
            for matrix in (self._half, self._whole)
        )
        x, y = state[0], state[1]
        for weight, (heading, yaw_rate, left, right) in ((1, start), (4, middle), (1, end)):
            forward = self.slip.longitudinal_gain * (left + right) / 2
            sideways = -self.slip.icr_offset * yaw_rate
            cosine, sine = functions.cos(heading), functions.sin(heading)
            x = x + weight * self.period / 6 * (cosine * forward - sine * sideways)
            y = y + weight * self.period / 6 * (sine * forward + cosine * sideways)
        return [x, y, *end]


def _exponential(a: FloatArray) -> FloatArray:
    """Return the matrix exponential, by scaling, Taylor series and squaring."""
    halvings = max(0, int(np.ceil(np.log2(max(np.abs(a).sum(axis=1).max(), 1e-300)))) + 1)
    scaled = a / 2.0**halvings
    term = total = np.eye(len(a))
    for order in range(1, 19):
        term = term @ scaled / order
        total = total + term
    for _ in range(halvings):
        total = total @ total
    return total


class _Turn(NamedTuple):
    """One steady turn: means over its last second, and the time integral of the yaw that the lag has cost."""

    mean_belt: float
    belt_difference: float
    vx: float
    vy: float
    yaw_rate: float
    belt_turn: float
    body_turn: float


def identify_slip(
    vehicle: str | os.PathLike[str] | TrackedVehicle,
    ground: Ground,
    backend: str | ForceBackend = "physics",
    speed: float = 5.0,
    *,
    differences: Sequence[float] = (0.04, 0.08, 0.12),
) -> SlipParameters:
    """Fit the slip parameters to steady turns at a working speed, without any random draw.

    The vehicle rolls straight at the speed, then holds V_R − V_L for five seconds: once for each difference to either
    side, and once straight. Gains and offset are least squares over the means of the last second. The lag is the area
    between the yaw that the belts ask for and the yaw that the body has made, over the steady yaw rate.

    Parameters
    ----------
    vehicle : str or TrackedVehicle
        Preset name or vehicle.
    ground : Ground
        What it drives on, from the origin along x.
    backend : str or ForceBackend
        Who gives the forces.
    speed : float
        Mean belt speed in m/s, positive; with half a difference on top, within the vehicle's maximum speed.
    differences : sequence of float
        V_R − V_L over the speed. The default suits gentle curves; on a surface as slippery as ice a wider one asks
        for more lateral force than there is.

    Returns
    -------
    SlipParameters

    Raises
    ------
    InvalidInputError
        If speed or differences are impossible, or the vehicle does not move as the model can say.
    SimulationDivergedError
        If a tick was not solved.

    Examples
    --------
    >>> from grouser.terrain import RigidTerrain
    >>> slip = identify_slip("m113", RigidTerrain(mu=0.8))
    >>> 0.6 < slip.yaw_gain < 0.8
    True
    """
    vehicle = resolve_vehicle(vehicle)
    require_in("speed", speed, 0.0, vehicle.maximum_speed, low_open=True)
    if not differences or not all(0 < value <= 1 for value in differences):
        raise InvalidInputError(f"differences must be shares of the speed in (0, 1], got {tuple(differences)!r}")
    signed = [0.0, *(sign * value * speed for value in differences for sign in (1, -1))]
    turns = [_drive(Simulator(vehicle, backend, ground, tick=_TICK), speed, value) for value in signed]
    mean, vx, vy, yaw_rate, difference = (
        np.array([getattr(turn, name) for turn in turns])
        for name in ("mean_belt", "vx", "vy", "yaw_rate", "belt_difference")
    )
    asked = difference / vehicle.tread
    yaw_gain = float(yaw_rate @ asked / (asked @ asked))
    lags = [(yaw_gain * turn.belt_turn / vehicle.tread - turn.body_turn) / turn.yaw_rate for turn in turns[1:]]
    try:
        return SlipParameters(
            longitudinal_gain=float(vx @ mean / (mean @ mean)),
            yaw_gain=yaw_gain,
            icr_offset=-float(vy @ yaw_rate / (yaw_rate @ yaw_rate)),
            yaw_lag=max(float(np.median(lags)), 0.0),
        )
    except InvalidInputError as error:
        raise InvalidInputError(
            f"the kinematic slip model does not describe {vehicle.name} at {speed:g} m/s on this ground: {error}; "
            "identify at a lower speed or with smaller differences"
        ) from error


def _drive(simulator: Simulator, speed: float, difference: float) -> _Turn:
    command = BeltCommand(speed - difference / 2, speed + difference / 2)
    simulator.set_state(VehicleState.rolling(speed))
    states = [simulator.step(command).state for _ in range(round((_SETTLE + _MEASURE) / _TICK))]
    steady = states[round(_SETTLE / _TICK) :]

    def mean(name: str) -> float:
        return float(np.mean([getattr(state, name) for state in steady]))

    return _Turn(
        mean_belt=(mean("v_left") + mean("v_right")) / 2,
        belt_difference=mean("v_right") - mean("v_left"),
        vx=mean("vx"),
        vy=mean("vy"),
        yaw_rate=mean("yaw_rate"),
        belt_turn=_TICK * sum(state.v_right - state.v_left for state in states),
        body_turn=states[-1].heading,
    )
