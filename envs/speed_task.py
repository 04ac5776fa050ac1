"""The speed-tracking task: which motion it commands, what it shows of it and what keeping it earns."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final

import numpy as np

from ..native import Speed
from ..terrain import GRAVITY, FloatArray, Ground, InvalidInputError, TrackedVehicle
from ..terrain.parameters import require_in
from .grip import grip
from .motion_profile import MotionProfile
from .observation import LOOK_AHEAD_TIMES
from .speed_config import SpeedConfig, SpeedResetOptions
from .state import VehicleState
from .surroundings import Surroundings
from .task import Start, Task
from .task_config import changed_config, check_options

# Steepest part of u²(3 − 2u) over its mean slope.
_STEEPEST: Final = 1.5


@dataclass
class SpeedEpisode:
    """What a speed-tracking episode remembers.

    Parameters
    ----------
    profile : MotionProfile
        What is commanded.
    periods : int
        Control periods since it began.
    """

    profile: MotionProfile
    periods: int = 0


class SpeedTask(Task[SpeedConfig, SpeedEpisode]):
    """Keep a commanded speed and yaw rate; see :class:`~grouser.envs.SpeedTrackingEnv`.

    Parameters
    ----------
    vehicle, terrain, config
        As of :class:`Task`.
    """

    terms: ClassVar = ("speed", "yaw_rate")
    measures: ClassVar = ("speed_error", "yaw_rate_error")

    def __init__(
        self,
        vehicle: str | os.PathLike[str] | TrackedVehicle,
        terrain: str | os.PathLike[str] | Ground,
        config: SpeedConfig,
    ) -> None:
        super().__init__(vehicle, terrain, config)
        self.speeds = self._speed_range(config)
        self.speed_tolerance: Final = config.speed_tolerance or 0.05 * self.vehicle.training_speed
        self.yaw_rate_tolerance: Final = config.yaw_rate_tolerance or 0.1 * config.yaw_rate_scale
        #: Of a profile that lasts an episode.
        self.knots: Final = 1 + math.ceil(config.time_limit / config.segment_time)

    def _speed_range(self, config: SpeedConfig) -> tuple[float, float]:
        """Return the speeds in m/s that commands are drawn between."""
        top = self.vehicle.training_speed
        highest = 0.7 * top if config.highest_speed is None else config.highest_speed
        for name, value in (("lowest_speed", config.lowest_speed), ("highest_speed", highest)):
            require_in(name, value, -top, top)
        if highest < config.lowest_speed:
            raise InvalidInputError(
                f"lowest_speed must not lie above highest_speed = {highest:g} m/s, got {config.lowest_speed:g}"
            )
        return config.lowest_speed, highest

    def reconfigure(self, **settings: Any) -> None:
        """Change settings of starts, commands and randomization, as :meth:`Task.reconfigure` does."""
        speeds = self._speed_range(changed_config(self.config, settings))
        super().reconfigure(**settings)
        self.speeds = speeds

    @property
    def reference_speed(self) -> float:
        """Half the training speed, in m/s."""
        return self.vehicle.training_speed / 2

    @property
    def memory_size(self) -> int:
        """Speed and yaw rate of every knot."""
        return 2 * self.knots

    @property
    def broken_off_reward(self) -> float:
        """What perfect tracking would have earned, lost."""
        return -self.config.speed_weight - self.config.yaw_rate_weight

    def start(self, generator: np.random.Generator, options: Mapping[str, Any]) -> Start[SpeedEpisode]:
        """Draw a profile and a start on it; ``options`` as in :class:`SpeedResetOptions`."""
        chosen = check_options(SpeedResetOptions, options, {"profile": MotionProfile})
        fastest = self.vehicle.maximum_speed
        require_in("reset option speed", chosen.get("speed", 0.0), -fastest, fastest)
        share, heading = generator.uniform(-1.0, 1.0, size=2)
        draws = generator.uniform(-1.0, 1.0, size=(self.knots, 2))
        surroundings = self.surroundings(generator, chosen)
        first = self.speeds[0] + (self.speeds[1] - self.speeds[0]) * (draws[0, 0] + 1) / 2
        lowest = self.config.lowest_start_speed
        speed = float(chosen.get("speed", first * (lowest + (1 - lowest) * (share + 1) / 2)))
        drawn = VehicleState.rolling(speed, heading=math.pi * heading)
        state = replace(chosen["state"], time=0.0) if "state" in chosen else drawn
        start = self.begin(state, surroundings, SpeedEpisode(self._profile(draws, surroundings, state)))
        if "profile" in chosen:
            start.episode.profile = self._fitting(chosen["profile"])
        return start

    def _profile(self, draws: FloatArray, surroundings: Surroundings, state: VehicleState) -> MotionProfile:
        """Return a profile that asks for ``effort`` of what the belts, the drive and the ground at the start allow."""
        config, (ground, vehicle) = self.config, surroundings
        steepness = math.hypot(*ground.gradient_at(state.x, state.y))
        held = GRAVITY * max(0.0, float(grip(vehicle, ground.mode, ground.parameters_at(state.x, state.y))) - steepness)
        ramp = config.effort * config.ramp_time / _STEEPEST
        largest_rise = ramp * min(vehicle.belt_acceleration, held)
        largest_turn = ramp * 2 * vehicle.belt_acceleration / vehicle.tread
        low, high = self.speeds
        speeds, yaw_rates = np.empty(self.knots), np.zeros(self.knots)
        speeds[0] = low + (high - low) * (draws[0, 0] + 1) / 2
        for knot in range(1, self.knots):
            wanted = low + (high - low) * (draws[knot, 0] + 1) / 2
            rise = min(max(wanted - speeds[knot - 1], -largest_rise), largest_rise)
            speed = speeds[knot] = speeds[knot - 1] + rise
            belts = 2 * (vehicle.training_speed - abs(speed)) / vehicle.tread
            sliding = held / max(abs(speed), 1e-3)
            limit = config.effort * min(config.yaw_rate_scale, belts, sliding)
            turn = min(max(limit * draws[knot, 1] - yaw_rates[knot - 1], -largest_turn), largest_turn)
            yaw_rates[knot] = yaw_rates[knot - 1] + turn
        return MotionProfile(speeds, yaw_rates, config.segment_time, config.ramp_time)

    def _fitting(self, profile: MotionProfile) -> MotionProfile:
        """Return a given profile, its last knot repeated up to the task's number of them."""
        config, missing = self.config, self.knots - len(profile.speed)
        if missing < 0 or (profile.segment_time, profile.ramp_time) != (config.segment_time, config.ramp_time):
            raise InvalidInputError(
                f"the reset option profile takes up to {self.knots} knots every {config.segment_time:g} s with ramps "
                f"of {config.ramp_time:g} s, got {len(profile.speed)} every {profile.segment_time:g} s with ramps of "
                f"{profile.ramp_time:g} s"
            )
        speed, yaw_rate = (np.pad(values, (0, missing), mode="edge") for values in (profile.speed, profile.yaw_rate))
        return MotionProfile(speed, yaw_rate, profile.segment_time, profile.ramp_time)

    def follow(self, episode: SpeedEpisode, state: VehicleState) -> None:
        """Count the control period."""
        episode.periods += 1

    def assess(self, episode: SpeedEpisode, state: VehicleState) -> tuple[tuple[float, float], bool]:
        """Return the terms of speed and yaw rate; no motion ends an episode."""
        self.follow(episode, state)
        speed_error, yaw_rate_error = self.measure(episode, state)
        terms = (
            _earned(self.config.speed_weight, speed_error / self.speed_tolerance),
            _earned(self.config.yaw_rate_weight, yaw_rate_error / self.yaw_rate_tolerance),
        )
        return terms, False

    def show(self, episode: SpeedEpisode, state: VehicleState) -> FloatArray:
        """Return errors and the commanded motion ahead."""
        speed_scale, yaw_rate_scale = self.vehicle.training_speed, self.config.yaw_rate_scale
        speed_error, yaw_rate_error = self.measure(episode, state)
        shown = [speed_error / speed_scale, yaw_rate_error / yaw_rate_scale]
        for ahead in LOOK_AHEAD_TIMES:
            speed, yaw_rate = episode.profile.at(self._time(episode) + ahead)
            shown += [speed / speed_scale, yaw_rate / yaw_rate_scale]
        return np.array(shown)

    def rules(self) -> Speed:
        """Return the profile's times, the tolerances and the weights."""
        config = self.config
        return Speed(
            knots=self.knots,
            segment_time=config.segment_time,
            ramp_time=config.ramp_time,
            speed_weight=config.speed_weight,
            yaw_rate_weight=config.yaw_rate_weight,
            speed_tolerance=self.speed_tolerance,
            yaw_rate_tolerance=self.yaw_rate_tolerance,
            look_ahead=np.array(LOOK_AHEAD_TIMES),
        )

    def remember(self, episode: SpeedEpisode) -> FloatArray:
        """Return speed and yaw rate of every knot, shape (2 knots,)."""
        return episode.profile.knots().ravel()

    def measure(self, episode: SpeedEpisode, state: VehicleState) -> tuple[float, float]:
        """Return the errors of speed in m/s and yaw rate in rad/s: actual less commanded."""
        speed, yaw_rate = episode.profile.at(self._time(episode))
        return state.vx - speed, state.yaw_rate - yaw_rate

    def commanded(self, state: VehicleState, measures: Sequence[float]) -> tuple[float, float]:
        """Return the commanded speed and yaw rate."""
        speed_error, yaw_rate_error = measures
        return state.vx - speed_error, state.yaw_rate - yaw_rate_error

    def _time(self, episode: SpeedEpisode) -> float:
        return episode.periods * self.config.control_period


def _earned(weight: float, ratio: float) -> float:
    return weight / (1.0 + ratio * ratio)
