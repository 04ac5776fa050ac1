"""Path tracking by model predictive control, every solve of which leaves a record."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Final

import numpy as np

from ..envs.path import Path
from ..envs.state import BeltCommand, VehicleState
from ..terrain import ConfigurationError, FloatArray, TrackedVehicle, resolve_vehicle
from ..terrain.parameters import require_in
from .mpc_config import FailureAction, MPCConfig
from .mpc_problem import Solution, Solver, TrackingProblem
from .slip_model import SlipParameters
from .speed_profile import SpeedProfile


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
        vehicle: str | os.PathLike[str] | TrackedVehicle,
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
        self._applied: BeltCommand | None = None
        self._failures = 0

    @property
    def records(self) -> tuple[SolveRecord, ...]:
        """One record a solve since the last reset, in order."""
        return tuple(self._records)

    @property
    def period(self) -> float:
        """The control period in s, which is the deadline of a solve."""
        return self.config.period

    @property
    def deadline(self) -> float:
        """The control period in s."""
        return self.period

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
        start = np.array([0.0, 0.0, state.heading, state.yaw_rate, state.v_left, state.v_right])
        guess = self._warm_guess(start, state) or self._cold_guess(start)
        solution = self._solver(np.concatenate([start, references.ravel()]), guess)
        solve_time = perf_counter() - began

        action: FailureAction | None = None
        first_move = self._move(solution, 0) if solution.success else None
        if first_move is not None:
            self._plan, self._failures, command = solution, 0, first_move
        else:
            self._failures += 1
            action, command = self._fall_back(state)
        keeps_plan = solution.success or action == "shift"
        self._guess = self.problem.shifted(solution if solution.success else guess) if keeps_plan else None
        self._origin = (state.x, state.y)
        self._applied = command
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

    def _check_period(self, state: VehicleState) -> None:
        if self._records and abs(state.time - self._records[-1].time - self.config.period) > 1e-6:
            raise ConfigurationError(
                f"the plan moves on by {self.config.period:g} s a call, but {state.time - self._records[-1].time:g} s "
                "passed since the last one: use the same control period, and reset() before a new drive"
            )

    def _references(self, state: VehicleState) -> FloatArray:
        """Return the references of the stages, shape (N + 1, 9), positions relative to the vehicle."""
        foot = self.path.project(state.x, state.y, self._arc_length, heading=state.heading)
        self._arc_length = foot.arc_length
        arc_length = [foot.arc_length]
        for _ in range(self.config.horizon):
            arc_length.append(arc_length[-1] + self.config.period * float(self.profile.at(arc_length[-1])))
        x, y, heading, curvature = self.path.sample(arc_length)
        speed = self.profile.at(arc_length)
        right, left = self._room(x, y)
        # The path's heading and the vehicle's are both unwrapped, each from a start of its own.
        turns = 2 * math.pi * round((state.heading - heading[0]) / (2 * math.pi))
        side_slip = np.arcsin(np.clip(self.slip.icr_offset * curvature, -0.5, 0.5))
        return np.column_stack(
            [
                x - state.x,
                y - state.y,
                np.cos(heading),
                np.sin(heading),
                heading + turns + side_slip,
                speed * curvature,
                speed,
                right,
                left,
            ]
        )

    def _room(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return how far the middle of the vehicle's front or rear may go to the right and left of path points."""
        right = np.full(x.shape, self.config.half_width)
        left = right.copy()
        if self.path.corridor is not None:
            for lane in self.path.corridor.lanes:
                reach, half = self.vehicle.contact_length / 2, self.vehicle.overall_width / 2
                within = (lane.start - reach <= x) & (x <= lane.end + reach)
                right = np.where(within, np.minimum(right, y - half - lane.right), right)
                left = np.where(within, np.minimum(left, lane.left - half - y), left)
        return right, left

    def _warm_guess(self, start: FloatArray, state: VehicleState) -> Solution | None:
        if self._guess is None:
            return None
        states = self._guess.states.copy()
        states[:, :2] += np.subtract(self._origin, (state.x, state.y))
        states[0] = start
        return replace(self._guess, states=states)

    def _cold_guess(self, start: FloatArray) -> Solution:
        """Return a guess that holds the belts and so keeps the model."""
        limit = self.vehicle.training_speed
        belts = np.clip(start[4:6], -limit, limit)
        states = [start]
        for _ in range(self.config.horizon):
            states.append(np.array(self.problem.model.step(list(states[-1]), list(belts))))
        return self.problem.cold_guess(np.array(states), np.tile(belts, (self.config.horizon, 1)))

    def _move(self, solution: Solution, stage: int) -> BeltCommand:
        # Interior points may pass a bound by the solver's tolerance, which the drive would refuse.
        limit = self.vehicle.training_speed
        left, right = (min(max(float(value), -limit), limit) for value in solution.inputs[stage, :2])
        return BeltCommand(left, right)

    def _fall_back(self, state: VehicleState) -> tuple[FailureAction, BeltCommand]:
        config = self.config
        if config.on_failure == "shift" and self._plan is not None and self._failures <= config.shift_limit:
            return "shift", self._move(self._plan, self._failures)
        left, right = self._applied or (state.v_left, state.v_right)
        fastest = max(abs(left), abs(right))
        step = config.brake_deceleration * config.period
        share = 1.0 - step / fastest if fastest > step else 0.0
        return "brake", BeltCommand(share * left, share * right)
