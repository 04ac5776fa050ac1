"""The vehicle simulator: belts, body, pose, acceleration memory and guard, one tick at a time."""

from __future__ import annotations

import math
import os
from typing import Final, NamedTuple

import numpy as np

from ..terrain import (
    BlendedForces,
    ConfigurationError,
    Detection,
    FloatArray,
    ForceBackend,
    ForceFunction,
    Ground,
    GuardedBackend,
    GuardState,
    SimulationDivergedError,
    TrackedVehicle,
    level_equivalent,
    make_backend,
    resolve_ground,
    resolve_vehicle,
    unknown_name,
)
from ..terrain.parameters import require_in
from .driveline import advance_belts, check_command
from .engine import check_mode
from .footing import GROUND_SAMPLINGS, Footing, GroundSampling, forces_on, sample_ground
from .state import BeltCommand, VehicleState
from .tick import INTEGRATORS, BodyStep, Dynamics, Integrator, explicit_step, implicit_step, tolerance


class TickRecord(NamedTuple):
    """What one tick did.

    Parameters
    ----------
    row : ndarray, shape (d,)
        What the block received in the accepted evaluation.
    forces : ndarray, shape (3,)
        What it returned: the force that moved the vehicle.
    state : VehicleState
        After the tick.
    iterations, divisions : int
        Broyden's or Newton's steps, and parts that the tick was solved in.
    detection : Detection or None
        What the guard's detector said of the row at the tick's start; None without a guard.
    footing : Footing
        θ under each track and gravity. The forces are those under the load m g_z; see
        :func:`~grouser.terrain.level_equivalent`.
    """

    row: FloatArray
    forces: FloatArray
    state: VehicleState
    iterations: int
    divisions: int
    detection: Detection | None
    footing: Footing


class Simulator:
    """One tracked vehicle on one ground, with the force backend as an argument.

    Each tick: the belts follow their commands, V_mid being their speed half a tick on; the body is solved at the
    tick's end with memory and V_mid held; the pose follows by the trapezoid of the velocities; the memory takes Qx/m
    and Qy/m, so that the block sees accelerations one tick late.

    Parameters
    ----------
    vehicle : str or TrackedVehicle
        Preset name or vehicle.
    backend : str or ForceBackend
        Name for :func:`grouser.terrain.make_backend`, or a backend.
    ground : str or Ground
        A ground's name, a file of one, a terrain, or anything that gives θ and a slope at a position; sampled at the
        tick's start. On a slope gravity pulls the body along, and the load is m g_z.
    tick : float
        T_s in s.
    integrator : {"implicit", "sdirk2", "euler"}
        Backward Euler, SDIRK2, or explicit Euler, which chatters near rest.
    ground_sampling : {"vehicle", "tracks"}
        Whether θ is taken at the CG or at the middle of each track, which needs a backend with track forces.
    state : VehicleState
        Initial state.

    Raises
    ------
    ConfigurationError
        If a name is unknown, the backend is for another vehicle or mode, or it does not know the tracks apart and the
        ground is to be sampled at each.
    InvalidInputError
        If the tick is not in (0, 1] s.
    """

    def __init__(
        self,
        vehicle: str | os.PathLike[str] | TrackedVehicle,
        backend: str | ForceBackend,
        ground: str | os.PathLike[str] | Ground,
        *,
        tick: float = 0.01,
        integrator: Integrator = "implicit",
        ground_sampling: GroundSampling = "vehicle",
        state: VehicleState = VehicleState(),  # noqa: B008 - frozen
    ) -> None:
        self.vehicle: Final = resolve_vehicle(vehicle)
        self._ground = resolve_ground(ground)
        self.backend: Final = make_backend(backend, mode=self._ground.mode, vehicle=self.vehicle)
        check_tick(self.backend, tick, integrator, ground_sampling)
        self.ground_sampling: Final[GroundSampling] = ground_sampling
        self.tick: Final = tick
        self.integrator: Final[Integrator] = integrator
        self._tolerance = tolerance(self.backend.resolution)
        self._state = state

    @property
    def ground(self) -> Ground:
        """The ground under the vehicle."""
        return self._ground

    def set_ground(self, ground: Ground) -> None:
        """Replace the ground by another of the same mode.

        Raises
        ------
        ConfigurationError
            If the mode differs.
        """
        self._ground = check_mode(ground, self.backend.mode)

    def get_state(self) -> VehicleState:
        """Return the whole state: the same state and commands give the same ticks."""
        return self._state

    def set_state(self, state: VehicleState) -> None:
        """Replace the whole state."""
        self._state = state

    def step(self, command: BeltCommand) -> TickRecord:
        """Advance by one tick.

        Parameters
        ----------
        command : BeltCommand
            Commanded belt speeds in m/s, within the drive's maximum speed.

        Raises
        ------
        InvalidInputError
            If the command is not finite or out of reach.
        SimulationDivergedError
            If no tick down to a sixteenth was solved; the state stays as it was.
        """
        command = check_command(self.vehicle, command)
        start = self._state
        belts = advance_belts(self.vehicle, (start.v_left, start.v_right), command, self.tick)
        footing = sample_ground(
            self._ground, self.vehicle, self.ground_sampling, x=start.x, y=start.y, heading=start.heading
        )
        row = self._row(start, command, footing.theta)
        level_row = level_equivalent(self.backend.interface, row, footing.gravity.load_ratio)
        guard, detection, evaluate = self._guarded(start.guard, level_row)
        step = self._solve(row, belts, footing, evaluate)
        if isinstance(evaluate, BlendedForces) and evaluate.primary_failed:
            # The mode is frozen within a tick: the whole of it goes to the fallback.
            failure = Detection(math.inf, "finite", "primary output")
            guard, detection, evaluate = self._guarded(start.guard, level_row, failure)
            step = self._solve(row, belts, footing, evaluate)
        if step is None or not all(math.isfinite(value) for value in step.body):
            raise SimulationDivergedError(
                f"no tick from {self.tick:g} s down to a sixteenth was solved at t = {start.time:.3f} s "
                f"(backend {self.backend.name}, integrator {self.integrator})",
                start,
            )
        self._state = self._moved(start, step, belts, guard)
        return TickRecord(step.row, step.forces, self._state, step.iterations, step.divisions, detection, footing)

    def _row(self, start: VehicleState, command: BeltCommand, theta: FloatArray) -> FloatArray:
        """Return the interface row at the tick's start, belts as the integrator takes them."""
        belts = (start.v_left, start.v_right)
        if self.integrator != "euler":
            belts = advance_belts(self.vehicle, belts, command, self.tick / 2)
        return np.array([start.vx, start.vy, start.yaw_rate, start.ax, start.ay, *belts, *theta])

    def _guarded(
        self, guard: GuardState, row: FloatArray, detection: Detection | None = None
    ) -> tuple[GuardState, Detection | None, ForceFunction]:
        """Advance the guard, by a detection that is known or the detector's, and freeze its mode for the tick."""
        backend = self.backend
        if not isinstance(backend, GuardedBackend):
            return guard, None, backend.forces_and_jacobian
        detection = detection or backend.detector.detect(row)
        advanced = backend.policy.advance(guard, detection, self.tick)
        return advanced, detection, BlendedForces(backend, advanced.fallback_weight)

    def _solve(
        self, row: FloatArray, belts: tuple[float, float], footing: Footing, evaluate: ForceFunction
    ) -> BodyStep | None:
        forces = forces_on(footing, self.backend, evaluate)
        # A body on slipping tracks turns by about half of what its belts do: over a tick, by as much as they do
        # in its second half.
        turn = (belts[1] - float(row[6])) - (belts[0] - float(row[5]))
        yaw_acceleration = turn / (self.vehicle.tread * self.tick)
        dynamics = Dynamics(self.vehicle, forces, (footing.gravity.x, footing.gravity.y), yaw_acceleration)
        if self.integrator == "euler":
            return explicit_step(dynamics, row, step=self.tick)
        return implicit_step(dynamics, row, step=self.tick, tolerance=self._tolerance, integrator=self.integrator)

    def _moved(
        self, start: VehicleState, step: BodyStep, belts: tuple[float, float], guard: GuardState
    ) -> VehicleState:
        vx, vy, yaw_rate = step.body
        half = self.tick / 2
        heading = start.heading + half * (start.yaw_rate + yaw_rate)
        c0, s0, c1, s1 = math.cos(start.heading), math.sin(start.heading), math.cos(heading), math.sin(heading)
        return VehicleState(
            x=start.x + half * (c0 * start.vx - s0 * start.vy + c1 * vx - s1 * vy),
            y=start.y + half * (s0 * start.vx + c0 * start.vy + s1 * vx + c1 * vy),
            heading=heading,
            vx=vx,
            vy=vy,
            yaw_rate=yaw_rate,
            v_left=belts[0],
            v_right=belts[1],
            ax=float(step.forces[0]) / self.vehicle.mass,
            ay=float(step.forces[1]) / self.vehicle.mass,
            time=start.time + self.tick,
            guard=guard,
        )


def check_tick(backend: ForceBackend, tick: float, integrator: str, ground_sampling: str) -> None:
    """Raise unless a vehicle on the backend can be moved by such ticks.

    Raises
    ------
    ConfigurationError
        If a name is unknown, or the backend does not know the tracks apart and the ground is to be sampled at each.
    InvalidInputError
        If the tick is not in (0, 1] s.
    """
    if integrator not in INTEGRATORS:
        raise unknown_name("integrator", integrator, INTEGRATORS)
    if ground_sampling not in GROUND_SAMPLINGS:
        raise unknown_name("ground sampling", ground_sampling, GROUND_SAMPLINGS)
    if ground_sampling == "tracks" and not backend.has_track_forces:
        raise ConfigurationError(
            f"the {backend.name!r} backend gives the force of the whole vehicle: use ground_sampling='vehicle', "
            "or a backend with has_track_forces, such as 'physics'"
        )
    require_in("tick", tick, 0.0, 1.0, low_open=True)
