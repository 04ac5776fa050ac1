"""Where an explicit host stays stable: the body linearised about straight running without slip.

Without rolling resistance, (V, 0, 0) with both belts at V is an equilibrium, and the memory has no say in its
linearisation: at zero slip a load shifted between elements changes no force. Eigenvalues come from the block's own
Jacobian; the formula |λ| = μ g L/(2K √(V² + V_ε²)) stands beside as a check.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from grouser.envs import BeltCommand, VehicleState
from grouser.terrain import GRAVITY, FloatArray, RigidTerrain, TrackedVehicle

from .hosts import EXPLICIT, Case, Method, body_of, make_host

FRICTION: Final = 0.8
SHEAR_MODULI: Final = (0.005, 0.025, 0.06)
HOST_TICK: Final = 0.001
#: |hλ| at which each method leaves its stability region along the negative real axis.
REAL_LIMIT: Final[dict[Method, float]] = {"euler": 2.0, "rk4": 2.785293563}
# K, V_ε, V: either side of standing still, the default V_ε, and a fast run.
PROBES: Final = (
    (0.005, 0.1, 0.0),
    (0.005, 0.1, 3.0),
    (0.005, 0.01, 0.5),
    (0.025, 0.1, 0.0),
    (0.025, 0.1, 0.2),
    (0.025, 0.5, 1.0),
    (0.025, 0.03, 6.0),
    (0.06, 0.02, 0.05),
)
# In m/s and rad/s. The block bends with |slip|: what is larger grows visibly slower than its linearisation.
_DISTURBANCE: Final = 1e-9


@dataclass(frozen=True, eq=False)
class StabilityMap:
    """Largest stable ticks of one ground.

    Parameters
    ----------
    shear_modulus : float
        K in m.
    soft_speeds, speeds : ndarray, shape (n,) and (k,)
        V_ε and V in m/s.
    eigenvalues : ndarray of complex, shape (n, k, 3)
        In 1/s.
    """

    shear_modulus: float
    soft_speeds: FloatArray
    speeds: FloatArray
    eigenvalues: np.ndarray

    @property
    def stiffness(self) -> FloatArray:
        """Largest |λ| in 1/s, shape (n, k)."""
        largest: FloatArray = np.max(np.abs(self.eigenvalues), axis=-1)
        return largest

    def largest_tick(self, method: Method) -> FloatArray:
        """Return the largest stable T_s in s, z/|λ| with z = 2 (Euler) or 2.785 (RK4), shape (n, k)."""
        return REAL_LIMIT[method] / self.stiffness


def eigenvalues(vehicle: TrackedVehicle, ground: RigidTerrain, soft_speed: float, speeds: FloatArray) -> np.ndarray:
    """Return the eigenvalues of the body's linearised dynamics in 1/s, shape (k, 3)."""
    case = Case.physics("map", vehicle, ground, soft_speed)
    rows = np.array([case.row(np.array([v, 0.0, 0.0]), np.zeros(2), (v, v)) for v in speeds.tolist()])
    jacobians = case.backend.forces_and_jacobian(rows)[1][:, :, :3]
    matrices = [case.rates_jacobian(row[:3], jacobian) for row, jacobian in zip(rows, jacobians, strict=True)]
    return np.linalg.eigvals(np.array(matrices)).astype(np.complex128)


def formula(vehicle: TrackedVehicle, ground: RigidTerrain, soft_speed: float, speed: float) -> float:
    """Return μ g L/(2K √(V² + V_ε²)) in 1/s."""
    return ground.mu * GRAVITY * vehicle.contact_length / (2 * ground.k * float(np.hypot(speed, soft_speed)))


def map_stability(
    vehicle: TrackedVehicle, shear_modulus: float, soft_speeds: FloatArray, speeds: FloatArray
) -> StabilityMap:
    """Compute one map."""
    ground = RigidTerrain(FRICTION, 0.0, shear_modulus)
    values = np.array([eigenvalues(vehicle, ground, soft_speed, speeds) for soft_speed in soft_speeds.tolist()])
    return StabilityMap(shear_modulus, soft_speeds, speeds, values)


def amplification(method: Method, z: np.ndarray) -> FloatArray:
    """Return |R(hλ)| of an explicit method."""
    value = 1 + z if method == "euler" else 1 + z * (1 + z / 2 * (1 + z / 3 * (1 + z / 4)))
    size: FloatArray = np.abs(value)
    return size


def exact_largest_tick(method: Method, values: np.ndarray) -> FloatArray:
    """Return the largest T_s in s at which |R(hλ)| ≤ 1 for every eigenvalue, by bisection; shape of all but the last."""
    low, high = np.zeros(values.shape[:-1]), 2 * REAL_LIMIT[method] / np.max(np.abs(values), axis=-1)
    for _ in range(60):
        middle = (low + high) / 2
        stable = np.all(amplification(method, middle[..., None] * values) <= 1.0, axis=-1)
        low, high = np.where(stable, middle, low), np.where(stable, high, middle)
    return low


def lowest_stable_speed(
    vehicle: TrackedVehicle, shear_modulus: float, soft_speed: float, method: Method, tick: float = HOST_TICK
) -> float:
    """Return the lowest speed in m/s from which on an explicit host is stable; 0 if it is at rest, too."""
    ground = RigidTerrain(FRICTION, 0.0, shear_modulus)
    speeds = np.concatenate([[0.0], np.geomspace(1e-3, 60.0, 2001)])
    stiffness = np.max(np.abs(eigenvalues(vehicle, ground, soft_speed, speeds)), axis=-1)
    unstable = np.flatnonzero(stiffness * tick > REAL_LIMIT[method])
    if not len(unstable):
        return 0.0
    last = int(unstable[-1])
    # |λ| is almost a power of the speed between two grid points.
    share = np.log(stiffness[last] * tick / REAL_LIMIT[method]) / np.log(stiffness[last] / stiffness[last + 1])
    return float(speeds[last] + share * (speeds[last + 1] - speeds[last]))


@dataclass(frozen=True)
class Probe:
    """A simulated check of the boundary.

    Parameters
    ----------
    shear_modulus, soft_speed, speed : float
        K in m, V_ε and V in m/s.
    method : str
        Explicit method.
    share : float
        T_s over the largest stable one.
    tick : float
        T_s in s.
    predicted, growth : float
        Factor by which a small disturbance grows a tick: largest |R(hλ)|, and as simulated.
    """

    shear_modulus: float
    soft_speed: float
    speed: float
    method: Method
    share: float
    tick: float
    predicted: float
    growth: float

    @property
    def agrees(self) -> bool:
        """Whether the simulation grows where the eigenvalues say so, and only there."""
        return (self.growth > 1.0) == (self.predicted > 1.0) == (self.share > 1.0)


def probe_boundary(vehicle: TrackedVehicle) -> list[Probe]:
    """Simulate every probe a twentieth below and above its largest stable tick."""
    probes = []
    for shear_modulus, soft_speed, speed in PROBES:
        ground = RigidTerrain(FRICTION, 0.0, shear_modulus)
        values = eigenvalues(vehicle, ground, soft_speed, np.array([speed]))[0]
        case = Case.physics("probe", vehicle, ground, soft_speed)
        for method in EXPLICIT:
            limit = REAL_LIMIT[method] / float(np.max(np.abs(values)))
            for share in (0.95, 1.05):
                tick = share * limit
                predicted = float(np.max(amplification(method, tick * values)))
                growth = _growth(case, method, tick, speed)
                probes.append(Probe(shear_modulus, soft_speed, speed, method, share, tick, predicted, growth))
    return probes


def _growth(case: Case, method: Method, tick: float, speed: float) -> float:
    """Return the factor a tick, over the second half of 400 ticks or of what stays small and above rounding."""
    rest = np.array([speed, 0.0, 0.0])
    start = VehicleState(vx=speed + _DISTURBANCE, vy=_DISTURBANCE, yaw_rate=_DISTURBANCE, v_left=speed, v_right=speed)
    host = make_host(case, method, tick, start)
    sizes = []
    for _ in range(400):
        size = float(np.linalg.norm(body_of(host.step(BeltCommand(speed, speed)).state) - rest))
        if not 1e-12 < size < 1e-7:
            break
        sizes.append(size)
    half = len(sizes) // 2
    return float((sizes[-1] / sizes[half]) ** (1 / (len(sizes) - 1 - half)))
