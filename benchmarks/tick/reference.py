"""What the ticks are measured against: SciPy's Radau within each tick, and Radau in continuous time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.integrate import solve_ivp

from grouser.envs import BeltCommand, VehicleState, advance_belts
from grouser.terrain import FloatArray

from .hosts import Case, body_of
from .runs import COMPARISON_PERIOD, CONTROL_PERIOD, Trajectory

TICK_TOLERANCE: Final = (1e-10, 1e-13)
LIVE_TOLERANCE: Final = (1e-8, 1e-10)
_MEMORY_TOLERANCE: Final = 1e-12
_NEWTON_LIMIT: Final = 50


@dataclass(frozen=True, eq=False)
class TickReference:
    """A drive whose ticks are solved by Radau, memory and V_mid held in each.

    Parameters
    ----------
    trajectory : Trajectory
        Bodies and end-of-tick forces.
    memories : ndarray, shape (n, 2)
        (ax, ay) that each tick held.
    belts : ndarray, shape (n, 2)
        V_mid that each tick held.
    """

    trajectory: Trajectory
    memories: FloatArray
    belts: FloatArray


def solve_ticks(case: Case, state: VehicleState, commands: list[BeltCommand], tick: float) -> TickReference:
    """Drive with every tick's body solved by Radau to 1e-10, on the block's own Jacobian."""
    relative, absolute = TICK_TOLERANCE
    body, memory, belts = body_of(state), np.array([state.ax, state.ay]), (state.v_left, state.v_right)
    bodies, forces, memories, middles = [body], [], [], []
    for command in commands:
        for _ in range(round(CONTROL_PERIOD / tick)):
            middle = advance_belts(case.vehicle, belts, command, tick / 2)
            row = case.row(body, memory, middle)

            def rates(_: float, y: FloatArray, row: FloatArray = row) -> FloatArray:
                row[:3] = y
                return case.rates(y, case.backend.forces(row))

            def jacobian(_: float, y: FloatArray, row: FloatArray = row) -> FloatArray:
                row[:3] = y
                return case.rates_jacobian(y, case.backend.forces_and_jacobian(row)[1][:, :3])

            solution = solve_ivp(
                rates,
                (0.0, tick),
                body,
                method="Radau",
                rtol=relative,
                atol=absolute,
                jac=jacobian,
                first_step=tick / 4,
            )
            memories.append(memory)
            middles.append(middle)
            body = solution.y[:, -1]
            row[:3] = body
            force = case.backend.forces(row)
            memory = force[:2] / case.vehicle.mass
            belts = advance_belts(case.vehicle, belts, command, tick)
            bodies.append(body)
            forces.append(force)
    return TickReference(Trajectory(tick, np.array(bodies), np.array(forces)), np.array(memories), np.array(middles))


class LiveDynamics:
    """The body in continuous time: belts on their lag, ax and ay those of the same instant.

    It is the limit T_s → 0 of the tick, in which the memory is no delay any more: a = Q(y, a)/m, solved by Newton.
    """

    def __init__(self, case: Case) -> None:
        self._case = case
        self._memory = np.zeros(2)
        #: Largest spectral radius of ∂Q/∂a/m seen. Below 1, the memory of the ticks converges to the solution.
        self.memory_gain = 0.0

    def rates(self, body: FloatArray, belts: tuple[float, float]) -> FloatArray:
        """Return (V̇x, V̇y, ω̇)."""
        return self._case.rates(body, self.solve(body, belts)[0])

    def jacobian(self, body: FloatArray, belts: tuple[float, float]) -> FloatArray:
        """Return ∂(V̇x, V̇y, ω̇)/∂(Vx, Vy, ω), with a following: ∂a/∂y = (m − ∂Q/∂a)⁻¹ ∂Q/∂y."""
        _, jacobian = self.solve(body, belts)
        gain = jacobian[:2, 3:5] / self._case.vehicle.mass
        self.memory_gain = max(self.memory_gain, float(np.max(np.abs(np.linalg.eigvals(gain)))))
        follows = np.linalg.solve(np.eye(2) - gain, jacobian[:2, :3] / self._case.vehicle.mass)
        return self._case.rates_jacobian(body, jacobian[:, :3] + jacobian[:, 3:5] @ follows)

    def solve(self, body: FloatArray, belts: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
        """Return forces and Jacobian at the accelerations that the forces themselves give."""
        mass, memory = self._case.vehicle.mass, self._memory
        row = self._case.row(body, memory, belts)
        for _ in range(_NEWTON_LIMIT):
            row[3:5] = memory
            forces, jacobian = self._case.backend.forces_and_jacobian(row)
            residual = memory - forces[:2] / mass
            if float(np.max(np.abs(residual))) <= _MEMORY_TOLERANCE * (1.0 + float(np.max(np.abs(memory)))):
                self._memory = memory
                return forces, jacobian
            memory = memory - np.linalg.solve(np.eye(2) - jacobian[:2, 3:5] / mass, residual)
        raise ArithmeticError(f"a = Q(y, a)/m was not solved at {row!r}")


@dataclass(frozen=True, eq=False)
class LiveReference:
    """A drive in continuous time.

    Parameters
    ----------
    bodies : ndarray, shape (n + 1, 3)
        (Vx, Vy, ω) at every comparison instant.
    memory_gain : float
        Largest spectral radius of ∂Q/∂a/m on the way.
    """

    bodies: FloatArray
    memory_gain: float


def solve_live(
    case: Case, state: VehicleState, commands: list[BeltCommand], tolerance: tuple[float, float] = LIVE_TOLERANCE
) -> LiveReference:
    """Drive in continuous time by Radau, one command after the other."""
    dynamics = LiveDynamics(case)
    count = round(CONTROL_PERIOD / COMPARISON_PERIOD)
    instants = np.linspace(0.0, CONTROL_PERIOD, count + 1)
    body, belts = body_of(state), (state.v_left, state.v_right)
    bodies = [body]
    for command in commands:

        def belts_at(
            elapsed: float, belts: tuple[float, float] = belts, command: BeltCommand = command
        ) -> tuple[float, float]:
            return advance_belts(case.vehicle, belts, command, elapsed)

        solution = solve_ivp(
            lambda t, y, belts_at=belts_at: dynamics.rates(y, belts_at(t)),
            (0.0, CONTROL_PERIOD),
            body,
            method="Radau",
            t_eval=instants,
            rtol=tolerance[0],
            atol=tolerance[1],
            jac=lambda t, y, belts_at=belts_at: dynamics.jacobian(y, belts_at(t)),
        )
        body, belts = solution.y[:, -1], belts_at(CONTROL_PERIOD)
        bodies.extend(solution.y[:, 1:].T)
    return LiveReference(np.array(bodies), dynamics.memory_gain)
