"""The six maneuvers that excite the block, each drawn from a generator and played back as a driver."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from ...envs.state import BeltCommand, VehicleState
from ...terrain import TrackedVehicle, unknown_name

ManeuverName = Literal["straight", "turn", "skid_reversal", "pivot", "reversal", "prbs"]
MANEUVERS: Final[tuple[ManeuverName, ...]] = ("straight", "turn", "skid_reversal", "pivot", "reversal", "prbs")

#: Mean of both belts and half their difference, right minus left, as fractions of the training speed, at a time in s.
_Profile = Callable[[float], tuple[float, float]]


@dataclass(frozen=True)
class Maneuver:
    """A belt-speed command over time; a driver that does not look at the state.

    Parameters
    ----------
    name : str
        One of :data:`MANEUVERS`.
    excitation : dict
        The scalars that were drawn, in fractions of the training speed and s.
    profile : callable
        Mean and half difference of the belts at a time, in fractions of the training speed.
    speed : float
        Training speed in m/s. Belts saturate there.
    """

    name: ManeuverName
    excitation: dict[str, float]
    profile: _Profile
    speed: float

    def reset(self) -> None:
        """Do nothing: a maneuver has no memory."""

    def command(self, state: VehicleState) -> BeltCommand:
        """Return the command at the state's time."""
        mean, half_difference = self.profile(state.time)
        left, right = (min(1.0, max(-1.0, value)) for value in (mean - half_difference, mean + half_difference))
        return BeltCommand(self.speed * left, self.speed * right)


def draw_maneuver(name: str, vehicle: TrackedVehicle, generator: np.random.Generator, duration: float) -> Maneuver:
    """Draw the excitation of one maneuver.

    Parameters
    ----------
    name : str
        One of :data:`MANEUVERS`:

        ``straight``
            Equal belts, a speed that swings about its mean, forward or backward.
        ``turn``
            A mean speed with a differential that grows in and swings, to one side.
        ``skid_reversal``
            A mean speed with a differential that changes sides.
        ``pivot``
            Counter-rotating belts, with a differential that swings and changes sides.
        ``reversal``
            A mean speed that changes sign, with a steady differential.
        ``prbs``
            Pseudo-random levels of mean and differential, each held for .2 to 2 s.
    vehicle : TrackedVehicle
        Gives the training speed.
    generator : numpy.random.Generator
        Source of every draw.
    duration : float
        Length of the run in s.

    Raises
    ------
    ConfigurationError
        If the name is unknown.
    """
    if name not in _DRAWS:
        raise unknown_name("maneuver", name, MANEUVERS)
    excitation, profile = _DRAWS[name](generator, duration)
    known: ManeuverName = MANEUVERS[MANEUVERS.index(name)]
    return Maneuver(known, excitation, profile, vehicle.training_speed)


def _side(generator: np.random.Generator) -> float:
    return 1.0 if generator.random() < 0.5 else -1.0


def _swing(time: float, period: float, phase: float) -> float:
    return math.sin(2 * math.pi * time / period + phase)


def _square(time: float, period: float) -> float:
    """Return ±1, half a period each, with edges that take a tenth of the period."""
    return max(-1.0, min(1.0, 10 / math.pi * math.sin(2 * math.pi * time / period)))


def _straight(generator: np.random.Generator, duration: float) -> tuple[dict[str, float], _Profile]:
    speed = _side(generator) * generator.uniform(0.05, 0.95)
    swing, period = generator.uniform(0.0, 0.5), generator.uniform(2.0, 12.0)
    phase = generator.uniform(0.0, 2 * math.pi)
    excitation = {"speed": speed, "swing": swing, "period": period, "phase": phase}
    return excitation, lambda t: (speed * (1 + swing * _swing(t, period, phase)), 0.0)


def _turn(generator: np.random.Generator, duration: float) -> tuple[dict[str, float], _Profile]:
    speed = _side(generator) * generator.uniform(0.05, 0.9)
    differential = _side(generator) * generator.uniform(0.01, 0.4)
    swing, period = generator.uniform(0.0, 0.8), generator.uniform(2.0, 12.0)
    rise = generator.uniform(0.5, 4.0)
    excitation = {"speed": speed, "differential": differential, "swing": swing, "period": period, "rise": rise}

    def profile(t: float) -> tuple[float, float]:
        return speed, differential * min(1.0, t / rise) * (1 + swing * _swing(t, period, 0.0))

    return excitation, profile


def _skid_reversal(generator: np.random.Generator, duration: float) -> tuple[dict[str, float], _Profile]:
    speed = _side(generator) * generator.uniform(0.05, 0.8)
    differential = _side(generator) * generator.uniform(0.05, 0.4)
    period = generator.uniform(2.0, 8.0)
    excitation = {"speed": speed, "differential": differential, "period": period}
    return excitation, lambda t: (speed, differential * _square(t, period))


def _pivot(generator: np.random.Generator, duration: float) -> tuple[dict[str, float], _Profile]:
    differential = _side(generator) * generator.uniform(0.03, 0.5)
    creep = 0.2 * differential * generator.uniform(-1.0, 1.0)
    period, swing_period = generator.uniform(4.0, 16.0), generator.uniform(1.5, 6.0)
    swing = generator.uniform(0.0, 0.5)
    excitation = {
        "differential": differential,
        "creep": creep,
        "period": period,
        "swing": swing,
        "swing_period": swing_period,
    }

    def profile(t: float) -> tuple[float, float]:
        return creep, differential * _square(t, period) * (1 + swing * _swing(t, swing_period, 0.0))

    return excitation, profile


def _reversal(generator: np.random.Generator, duration: float) -> tuple[dict[str, float], _Profile]:
    speed = _side(generator) * generator.uniform(0.1, 0.9)
    differential = _side(generator) * generator.uniform(0.0, 0.3)
    period = generator.uniform(4.0, 14.0)
    excitation = {"speed": speed, "differential": differential, "period": period}
    return excitation, lambda t: (speed * _square(t, period), differential)


def _prbs(generator: np.random.Generator, duration: float) -> tuple[dict[str, float], _Profile]:
    bias = generator.uniform(-0.4, 0.4)
    speed, differential = generator.uniform(0.1, 0.6), generator.uniform(0.05, 0.4)
    shortest, longest = 0.2, 2.0
    count = int(duration / shortest) + 2
    edges = np.cumsum(generator.uniform(shortest, longest, size=count))
    levels = generator.choice((-1.0, 0.0, 1.0), size=(count, 2), p=(0.4, 0.2, 0.4))
    excitation = {"bias": bias, "speed": speed, "differential": differential}

    def profile(t: float) -> tuple[float, float]:
        mean, half_difference = levels[min(int(np.searchsorted(edges, t, side="right")), count - 1)]
        return bias + speed * float(mean), differential * float(half_difference)

    return excitation, profile


_DRAWS: Final[dict[str, Callable[[np.random.Generator, float], tuple[dict[str, float], _Profile]]]] = {
    "straight": _straight,
    "turn": _turn,
    "skid_reversal": _skid_reversal,
    "pivot": _pivot,
    "reversal": _reversal,
    "prbs": _prbs,
}
