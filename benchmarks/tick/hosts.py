"""Who advances the vehicle by one tick: the simulator with its integrators, and a classical Runge-Kutta beside it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Literal, Protocol

import numpy as np

from grouser.envs import BeltCommand, Simulator, VehicleState, advance_belts
from grouser.terrain import FloatArray, ForceBackend, PhysicsBackend, Terrain, TrackedVehicle

Method = Literal[
    "implicit", "sdirk2", "euler", "rk4", "implicit, belts at the tick's end", "sdirk2, mean force remembered"
]
#: Variants that the simulator does not offer, beside the methods.
BELTS_AT_END: Final = "implicit, belts at the tick's end"
MEAN_FORCE: Final = "sdirk2, mean force remembered"
VARIANTS: Final[tuple[Method, ...]] = (BELTS_AT_END, MEAN_FORCE)
METHODS: Final[tuple[Method, ...]] = ("implicit", "sdirk2", "euler", "rk4")
#: Global order that each method promises on a smooth right-hand side.
PROMISED_ORDER: Final[dict[Method, int]] = {"implicit": 1, "sdirk2": 2, "euler": 1, "rk4": 4}
TICKS: Final = (0.010, 0.005, 0.002, 0.001)
#: Two explicit methods, since only they have a stability limit here.
EXPLICIT: Final[tuple[Method, ...]] = ("euler", "rk4")


@dataclass(frozen=True, eq=False)
class Case:
    """A vehicle on a ground that is alike everywhere, and who answers for it.

    Parameters
    ----------
    name : str
        For tables.
    vehicle : TrackedVehicle
        The vehicle.
    ground : Terrain
        The ground.
    backend : ForceBackend
        The force block.
    """

    name: str
    vehicle: TrackedVehicle
    ground: Terrain
    backend: ForceBackend

    @classmethod
    def physics(cls, name: str, vehicle: TrackedVehicle, ground: Terrain, soft_speed: float | None = None) -> Case:
        """Return a case on the compiled physics, with V_ε in m/s or the vehicle's own."""
        return cls(name, vehicle, ground, PhysicsBackend(vehicle, ground.mode, soft_speed=soft_speed))

    def row(self, body: FloatArray, memory: FloatArray, belts: tuple[float, float]) -> FloatArray:
        """Return the interface row of (Vx, Vy, ω), (ax, ay) and both belt speeds."""
        return np.array([*body, *memory, *belts, *self.ground.parameters])

    def rates(self, body: FloatArray, forces: FloatArray) -> FloatArray:
        """Return (V̇x, V̇y, ω̇) under [Qx, Qy, Mz]."""
        vx, vy, yaw_rate = body
        mass, inertia = self.vehicle.mass, self.vehicle.yaw_inertia
        return np.array([forces[0] / mass + yaw_rate * vy, forces[1] / mass - yaw_rate * vx, forces[2] / inertia])

    def rates_jacobian(self, body: FloatArray, jacobian: FloatArray) -> FloatArray:
        """Return ∂(V̇x, V̇y, ω̇)/∂(Vx, Vy, ω) from ∂Q/∂(Vx, Vy, ω), shape (3, 3)."""
        vx, vy, yaw_rate = body
        turning = np.array([[0.0, yaw_rate, vy], [-yaw_rate, 0.0, -vx], [0.0, 0.0, 0.0]])
        scale = np.array([self.vehicle.mass, self.vehicle.mass, self.vehicle.yaw_inertia])
        total: FloatArray = jacobian / scale[:, None] + turning
        return total


class Moved(Protocol):
    """What one tick did."""

    @property
    def forces(self) -> FloatArray:
        """[Qx, Qy, Mz] of the tick."""

    @property
    def state(self) -> VehicleState:
        """State after it."""


class Host(Protocol):
    """Advances a vehicle tick by tick."""

    def get_state(self) -> VehicleState:
        """Return the state."""

    def set_state(self, state: VehicleState) -> None:
        """Replace the state."""

    def step(self, command: BeltCommand) -> Moved:
        """Advance by one tick."""


@dataclass(frozen=True)
class RungeKuttaTick:
    """A tick of :class:`RungeKuttaHost`."""

    forces: FloatArray
    state: VehicleState


class RungeKuttaHost:
    """The classical fourth-order Runge-Kutta method in the simulator's tick; the pose is left out.

    The simulator does not offer it: no row of its log would name the force that moved the vehicle. Here the memory
    takes the force at the tick's end, as that of the implicit tick does, at a fifth force call.
    """

    def __init__(self, case: Case, tick: float, state: VehicleState) -> None:
        self._case, self._tick, self._state = case, tick, state

    def get_state(self) -> VehicleState:
        """Return the state."""
        return self._state

    def set_state(self, state: VehicleState) -> None:
        """Replace the state."""
        self._state = state

    def step(self, command: BeltCommand) -> RungeKuttaTick:
        """Advance by one tick, memory and V_mid held."""
        case, start, tick = self._case, self._state, self._tick
        belts = (start.v_left, start.v_right)
        row = case.row(
            body_of(start), np.array([start.ax, start.ay]), advance_belts(case.vehicle, belts, command, tick / 2)
        )

        def rates(body: FloatArray) -> FloatArray:
            row[:3] = body
            return case.rates(body, case.backend.forces(row))

        body = body_of(start)
        first = rates(body)
        second = rates(body + tick / 2 * first)
        third = rates(body + tick / 2 * second)
        fourth = rates(body + tick * third)
        body = body + tick / 6 * (first + 2 * second + 2 * third + fourth)
        row[:3] = body
        forces = case.backend.forces(row)
        left, right = advance_belts(case.vehicle, belts, command, tick)
        self._state = replace(
            start,
            vx=float(body[0]),
            vy=float(body[1]),
            yaw_rate=float(body[2]),
            v_left=left,
            v_right=right,
            ax=float(forces[0]) / case.vehicle.mass,
            ay=float(forces[1]) / case.vehicle.mass,
            time=start.time + tick,
        )
        return RungeKuttaTick(forces, self._state)


class BeltsAtTheEnd:
    """Backward Euler with the belts held at their speed at the tick's end instead of V_mid."""

    def __init__(self, case: Case, tick: float, state: VehicleState) -> None:
        self._case, self._tick = case, tick
        self._host = make_host(case, "implicit", tick, state)
        self._belts = (state.v_left, state.v_right)

    def get_state(self) -> VehicleState:
        """Return the state."""
        return self._host.get_state()

    def set_state(self, state: VehicleState) -> None:
        """Replace the state."""
        self._host.set_state(state)
        self._belts = (state.v_left, state.v_right)

    def step(self, command: BeltCommand) -> Moved:
        """Advance by one tick."""
        self._belts = advance_belts(self._case.vehicle, self._belts, command, self._tick)
        return step_held(self._host, self._host.get_state(), self._belts)


class MeanForceRemembered:
    """SDIRK2 whose memory takes the tick's mean force over the mass, not that of the last stage."""

    def __init__(self, case: Case, tick: float, state: VehicleState) -> None:
        self._tick = tick
        self._host = make_host(case, "sdirk2", tick, state)

    def get_state(self) -> VehicleState:
        """Return the state."""
        return self._host.get_state()

    def set_state(self, state: VehicleState) -> None:
        """Replace the state."""
        self._host.set_state(state)

    def step(self, command: BeltCommand) -> Moved:
        """Advance by one tick; the mean acceleration is read off the velocities, ω's share by the trapezoid."""
        before = self._host.get_state()
        moved = self._host.step(command)
        after = moved.state
        turning_x = (before.yaw_rate * before.vy + after.yaw_rate * after.vy) / 2
        turning_y = (before.yaw_rate * before.vx + after.yaw_rate * after.vx) / 2
        ax = (after.vx - before.vx) / self._tick - turning_x
        ay = (after.vy - before.vy) / self._tick + turning_y
        self._host.set_state(replace(after, ax=ax, ay=ay))
        return moved


def step_held(host: Host, state: VehicleState, belts: tuple[float, float]) -> Moved:
    """Advance a state by one tick with the belts held: they stand at their command, and the lag has no say."""
    host.set_state(replace(state, v_left=float(belts[0]), v_right=float(belts[1])))
    return host.step(BeltCommand(float(belts[0]), float(belts[1])))


def make_host(case: Case, method: Method, tick: float, state: VehicleState) -> Host:
    """Return a host at T_s = ``tick`` s."""
    if method == "rk4":
        return RungeKuttaHost(case, tick, state)
    if method == BELTS_AT_END:
        return BeltsAtTheEnd(case, tick, state)
    if method == MEAN_FORCE:
        return MeanForceRemembered(case, tick, state)
    return Simulator(case.vehicle, case.backend, case.ground, tick=tick, integrator=method, state=state)


def body_of(state: VehicleState) -> FloatArray:
    """Return (Vx, Vy, ω) in m/s, m/s, rad/s."""
    return np.array([state.vx, state.vy, state.yaw_rate])
