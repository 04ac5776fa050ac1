"""The driven runs: belt commands over time, held for a control period each, and their playback on a host."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from grouser.envs import BeltCommand, VehicleState
from grouser.terrain import FloatArray, TrackedVehicle

from .hosts import Host, body_of

#: In s, a multiple of every tick of the study: the commands are the same step function at each of them.
CONTROL_PERIOD: Final = 0.1
#: In s, where runs of different ticks are compared.
COMPARISON_PERIOD: Final = 0.01


@dataclass(frozen=True)
class Run:
    """A belt-speed command over time.

    Parameters
    ----------
    name : str
        For tables.
    start : float
        Speed at which the vehicle rolls at first, as a fraction of half the training speed.
    profile : callable
        Mean and half difference (right minus left) of the belt commands at a time in s, in the same fractions.
    duration : float
        In s.
    """

    name: str
    start: float
    profile: Callable[[float], tuple[float, float]]
    duration: float = 6.0

    def initial_state(self, vehicle: TrackedVehicle) -> VehicleState:
        """Return the state it starts from."""
        return VehicleState.rolling(self.start * vehicle.training_speed / 2)

    def commands(self, vehicle: TrackedVehicle) -> list[BeltCommand]:
        """Return the command of every control period."""
        unit = vehicle.training_speed / 2
        pairs = [self.profile(index * CONTROL_PERIOD) for index in range(round(self.duration / CONTROL_PERIOD))]
        return [BeltCommand(unit * (mean - half), unit * (mean + half)) for mean, half in pairs]


def _ramp(time: float, begin: float, end: float) -> float:
    return min(1.0, max(0.0, (time - begin) / (end - begin)))


def _steps(time: float) -> tuple[float, float]:
    return _LEVELS[min(int(time), len(_LEVELS) - 1)]


# Mean and half difference, a second each: as abrupt as a training run's pseudo-random levels.
_LEVELS: Final = ((0.6, 0.0), (0.6, 0.2), (0.9, -0.2), (0.3, 0.1), (-0.2, 0.2), (0.7, 0.0))
#: Seven maneuvers, none of them random, from standstill to half the training speed and through standstill.
RUNS: Final = (
    Run("straight acceleration", 0.2, lambda t: (0.2 + 0.8 * _ramp(t, 0.0, 4.0), 0.0)),
    Run("steady turn", 0.6, lambda t: (0.6, 0.15 * _ramp(t, 0.0, 2.0))),
    Run("pivot", 0.0, lambda t: (0.0, 0.2 * _ramp(t, 0.0, 1.0))),
    Run("sine steering", 0.8, lambda t: (0.8, 0.15 * math.sin(2 * math.pi * t / 3))),
    Run("reversal of belts", 0.5, lambda t: (0.5 - _ramp(t, 2.0, 4.0), 0.05)),
    Run("steps of both belts", 0.3, _steps),
    Run("braking to rest", 0.6, lambda t: (0.6 if t < 0.95 else 0.0, 0.0)),
)
#: Without a stop and fast enough for explicit methods at 10 ms: where every method may show its order.
ORDER_RUN: Final = Run("fast sine steering", 1.2, lambda t: (1.2, 0.1 * math.sin(2 * math.pi * t / 2)), duration=2.0)


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A drive, tick by tick.

    Parameters
    ----------
    tick : float
        T_s in s.
    bodies : ndarray, shape (n + 1, 3)
        (Vx, Vy, ω) before the first tick and after each.
    forces : ndarray, shape (n, 3)
        [Qx, Qy, Mz] of each tick.
    """

    tick: float
    bodies: FloatArray
    forces: FloatArray

    def compared(self) -> FloatArray:
        """Return the bodies at every comparison instant."""
        return self.bodies[:: round(COMPARISON_PERIOD / self.tick)]


def play(host: Host, commands: list[BeltCommand], tick: float) -> Trajectory:
    """Play the commands back, each for a control period."""
    bodies, forces = [body_of(host.get_state())], []
    for command in commands:
        for _ in range(round(CONTROL_PERIOD / tick)):
            moved = host.step(command)
            bodies.append(body_of(moved.state))
            forces.append(moved.forces)
    return Trajectory(tick, np.array(bodies), np.array(forces))


def root_mean_square(values: FloatArray) -> FloatArray:
    """Return the root mean square over the first axis."""
    result: FloatArray = np.sqrt(np.mean(values**2, axis=0))
    return result


def velocity_error(vehicle: TrackedVehicle, difference: FloatArray) -> float:
    """Return one figure for an error of (Vx, Vy, ω), in m/s: ω counts at the track's centre, B/2 from the CG."""
    arms = np.array([1.0, 1.0, vehicle.tread / 2])
    return float(np.linalg.norm(root_mean_square(difference * arms)))


def observed_order(ticks: tuple[float, ...], errors: list[float]) -> float:
    """Return the slope of log error over log T_s by least squares."""
    return float(np.polyfit(np.log(ticks), np.log(errors), 1)[0])
