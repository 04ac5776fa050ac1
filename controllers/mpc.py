"""Path tracking by model predictive control, every solve of which leaves a record."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Final

import numpy as np

from ..envs.paths import Path
from ..envs.state import BeltCommand, VehicleState
from ..terrain import ConfigurationError, FloatArray, TrackedVehicle, resolve_vehicle
from ..terrain.parameters import require_in
from .mpc_problem import FailureAction, MPCConfig, Solution, Solver, TrackingProblem
from .slip_model import SlipParameters
from .speed_profile import SpeedProfile

_AT_REST: Final = 0.0


@dataclass(frozen=True)
class SolveRecord:
    """What one solve did, and what was applied.

    Parameters
    ----------
    time : float
        Of the simulation, in s.
    status : str
        The solver's return status.
    success : bool
        Whether the solve converged to a feasible point.
    iterations : int
        Of the solver.
    objective : float
        Cost reached.
    first_move : BeltCommand or None
        Of the plan; None where the solve failed.
    command : BeltCommand
        What was applied.
    fallback_action : {"shift", "brake"} or None
        Which action took the place of the first move; None where the solve succeeded.
    solve_time : float
        Wall time from state to plan in s; left out of comparison, so that equal drives have equal records.
    """

    time: float
    status: str
    success: bool
    iterations: int
    objective: float
    first_move: BeltCommand | None
    command: BeltCommand
    fallback_action: FailureAction | None
    solve_time: float = field(compare=False)


class PathTrackingMPC:
    """Drives along a path by the first move of a plan that is solved anew in every control period.

    The prediction is the kinematic skid-steer with slip of
    :class:`~grouser.controllers.slip_model.PredictionModel`; the problem is
    :class:`~grouser.controllers.mpc_problem.TrackingProblem`. The reference starts at the vehicle's foot on the path
    and moves on at the reference speed. The heading to hold is the path's, turned by the side-slip of a vehicle whose
    centre of rotation is not at its CG. A late solve is recorded; it changes nothing.

    Parameters
    ----------
    path : Path
        The path, and with it the corridor, which holds as a soft constraint on the footprint.
    vehicle : str or TrackedVehicle
        Preset name or vehicle.
    slip : SlipParameters
        How belt speeds become motion, see :func:`~grouser.controllers.identify_slip`.
    config : MPCConfig
        Settings.
    solver : Solver, optional
        Takes the place of CasADi's, for tests and studies: called with the parameters and a guess.

    Raises
    ------
    InvalidInputError
        If the speed exceeds the vehicle's training speed.
    ConfigurationError
        If CasADi is not installed.
    """

    def __init__(
        self,
        path: Path,
        vehicle: str | TrackedVehicle,
        slip: SlipParameters,
        config: MPCConfig = MPCConfig(),  # noqa: B008 - frozen
        *,
        solver: Solver | None = None,
    ) -> None:
        self.path: Final = path
        self.vehicle: Final = resolve_vehicle(vehicle)
        self.slip: Final = slip
        self.config: Final = config
        require_in("speed", config.speed, 0.0, self.vehicle.training_speed, low_open=True)
        self.profile: Final = SpeedProfile.along(
            path, config.speed, lateral_acceleration=config.lateral_acceleration, stop_at_end=config.stop_at_end
        )
        self.problem: Final = TrackingProblem(self.vehicle, slip, config)
        self._solver: Final[Solver] = self.problem if solver is None else solver
        self.reset()

    def reset(self) -> None:
        """Forget the last drive: its plan, its place on the path, and its records."""
        self._records: list[SolveRecord] = []
        self._arc_length: float | None = None
        self._origin = (0.0, 0.0)
        self._plan: Solution | None = None
        self._guess: Solution | None = None
        self._failures = 0

    @property
    def records(self) -> tuple[SolveRecord, ...]:
        """One record a solve since the last reset, in order."""
        return tuple(self._records)

    @property
    def deadline(self) -> float:
        """The control period in s."""
        return self.config.period

    @property
    def deadline_misses(self) -> int:
        """How many solves took longer than the deadline."""
        return sum(record.solve_time > self.deadline for record in self._records)

    def command(self, state: VehicleState) -> BeltCommand:
        """Solve for the state, record it, and return the belt-speed command.

        Raises
        ------
        ConfigurationError
            If the call does not come one control period after the last one.
        """
        self._check_period(state)
        began = perf_counter()
        references = self._references(state)
        parameters = np.concatenate([self._start(state), references.ravel()])
        guess = self._warm(state) if self._guess is not None else self._cold(state, references)
        solution = self._solver(parameters, guess)
        solve_time = perf_counter() - began
        first_move = action = None
        if solution.success:
            self._failures, self._plan = 0, solution
            self._guess = solution
            command = first_move = self._move(solution, 0)
        else:
            self._failures += 1
            self._guess = self.problem.shifted(self._guess) if self._guess is not None else None
            action, command = self._fall_back(state)
        self._records.append(
            SolveRecord(
                time=state.time,
                status=solution.status,
                success=solution.success,
                iterations=solution.iterations,
                objective=solution.objective,
                first_move=first_move,
                command=command,
                fallback_action=action,
                solve_time=solve_time,
            )
        )
        return command
