"""One rollout for every driver: data generation, baselines, MPC, policies and comparisons all come through here."""

from __future__ import annotations

import math
from collections.abc import Callable

from ..terrain import ConfigurationError, InvalidInputError, SimulationDivergedError
from .log import InterfaceLog, LogRecorder
from .simulator import Simulator
from .state import Driver, VehicleState


def whole_ratio(larger: float, smaller: float, names: str) -> int:
    """Return ``larger / smaller`` where it is a whole number of at least 1.

    Parameters
    ----------
    larger, smaller : float
        Two periods in s.
    names : str
        What they are, for the error.

    Raises
    ------
    InvalidInputError
        If it is not.
    """
    usable = 0 < smaller < math.inf and 0 < larger < math.inf
    ratio = round(larger / smaller) if usable else 0
    if ratio < 1 or abs(larger - ratio * smaller) > 1e-9 * smaller:
        raise InvalidInputError(f"{names} must divide without remainder, got {larger:g} s and {smaller:g} s")
    return ratio


def rollout(
    simulator: Simulator,
    driver: Driver,
    duration: float,
    *,
    control_period: float = 0.1,
    until: Callable[[VehicleState], bool] | None = None,
) -> InterfaceLog:
    """Let a driver drive a simulator and log the interface.

    Parameters
    ----------
    simulator : Simulator
        Starts from the state it has.
    driver : Driver
        Reset first, then asked for a command once a control period. One that names its ``period`` is held to it.
    duration : float
        In s, a multiple of the tick.
    control_period : float
        In s, a multiple of the tick.
    until : callable, optional
        Ends the drive early once it holds of the state at a control instant.

    Returns
    -------
    InterfaceLog

    Raises
    ------
    InvalidInputError
        If the periods do not divide.
    ConfigurationError
        If the driver's period is another.
    SimulationDivergedError
        If a tick was not solved; its ``log`` holds the drive up to there.
    """
    ticks = whole_ratio(duration, simulator.tick, "duration and tick")
    hold = whole_ratio(control_period, simulator.tick, "control period and tick")
    period = getattr(driver, "period", None)
    if period is not None and abs(period - control_period) > 1e-9:
        raise ConfigurationError(
            f"this driver moves on by {period:g} s a command, got {control_period:g} s: use the same control period"
        )
    recorder = LogRecorder(simulator)
    driver.reset()
    for index in range(ticks):
        if index % hold == 0:
            state = simulator.get_state()
            if until is not None and until(state):
                break
            command = driver.command(state)
        try:
            record = simulator.step(command)
        except SimulationDivergedError as error:
            error.log = recorder.finish()
            raise
        recorder.append(command, record)
    return recorder.finish()
