"""The track-terrain block, equation by equation, over an array namespace.

Evaluated with NumPy in float64 this is the oracle that the compiled block is pinned to; the same lines give CasADi
expressions and differentiable torch. Sources: Wong & Chiang (2001), a general theory for skid steering of tracked
vehicles on firm ground; Janosi & Hanamoto (1961); Wong, Theory of Ground Vehicles.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np

from .errors import InvalidInputError, unknown_name
from .interface import FloatArray, Mode, interface
from .namespace import NUMPY, ArrayNamespace
from .parameters import require_in, require_whole
from .vehicle import CONTACTS, GRAVITY, Contact, TrackedVehicle, check_contact

#: Share of an element's static load below which cohesion fades with the contact.
COHESION_FADE: Final = 0.05
# Below 1e-150 m/s the slip speed is zero; its square is added so that derivatives at zero slip stay finite.
_TINY_SQUARE: Final = 1e-300


ShearPath = Literal["soft", "exact"]
SHEAR_PATHS: Final[tuple[ShearPath, ...]] = ("soft", "exact")


@dataclass(frozen=True)
class ShearGrid:
    """Midpoint cells of every contact element and how shear displacement builds up over them.

    Parameters
    ----------
    along, across : int
        Cells an element along and across the track, nx and ny.
    contact : {"continuous", "per_wheel"}
        Whether the shear builds up along the whole track (Wong & Chiang) or starts afresh under each wheel.
    path : {"soft", "exact"}
        Shear displacement of a cell: the slip velocity of this moment times the contact time, or the path of the belt
        point over the ground with the vehicle's rotation on the way.

    Raises
    ------
    InvalidInputError
        If there is no cell.
    ConfigurationError
        If the contact option or the path is unknown.
    """

    along: int = 16
    across: int = 4
    contact: Contact = "continuous"
    path: ShearPath = "soft"

    def __post_init__(self) -> None:
        for name in ("along", "across"):
            require_whole(f"cells {name}", getattr(self, name), 1, 4096)
        if self.contact not in CONTACTS:
            raise unknown_name("contact option", self.contact, CONTACTS)
        if self.path not in SHEAR_PATHS:
            raise unknown_name("shear path", self.path, SHEAR_PATHS)


def side_loads(xp: ArrayNamespace, vehicle: TrackedVehicle, ay: Any) -> tuple[Any, Any]:
    """Return the normal load of the left and right track in N.

    N_L = W/2 − m ay h/B, N_R = W/2 + m ay h/B, clipped to [0, W].
    """
    weight = vehicle.weight
    transfer = vehicle.mass * vehicle.cg_height / vehicle.tread * ay
    return xp.clip(weight / 2 - transfer, 0.0, weight), xp.clip(weight / 2 + transfer, 0.0, weight)


def element_shares(xp: ArrayNamespace, vehicle: TrackedVehicle, ax: Any) -> list[Any]:
    """Return the share of its track's load that each contact element carries, rearmost first.

    share_i = 1/n + (x_i − x̄)(e − x̄)/Σ(x_k − x̄)², e = −h ax/g; clipped at 0 and rescaled to sum to 1.
    """
    count = vehicle.road_wheels
    arms = vehicle.element_centers - vehicle.contact_center
    spread = float(np.sum(arms**2)) or 1.0
    lean = -vehicle.cg_height / GRAVITY * ax - vehicle.contact_center
    raw = [xp.clip(1 / count + float(arm) / spread * lean, 0.0, np.inf) for arm in arms]
    total = sum(raw[1:], start=raw[0])
    return [share / total for share in raw]


def rolling_direction(xp: ArrayNamespace, vt: Any, soft_speed: float) -> Any:
    """Return the soft rolling direction s = Vt/√(Vt² + V_ε²)."""
    return vt / xp.sqrt(vt * vt + soft_speed**2)


def shear_factor(xp: ArrayNamespace, z: Any) -> Any:
    """Return φ₁(z) = −expm1(−z)/z, 1 at z = 0: the shear stress over its initial slope."""
    regular = z > 1e-12
    safe = xp.where(regular, z, 1.0)
    return xp.where(regular, -xp.expm1(-safe) / safe, 1.0 - z / 2)


def exact_displacement(xp: ArrayNamespace, slip_x: Any, slip_y: Any, yaw_rate: Any, vt: Any, time: Any) -> Any:
    """Return the distance in m that the ground is sheared on the exact path (Wong & Chiang), at most half a turn long.

    A belt point that entered t ago has moved over the ground, in body axes of this moment, by
    j = t ([[S, C], [−C, S]] v_s + Vt (S − cos θ, sin θ − C)), θ = ωt, S = sin θ/θ, C = (1 − cos θ)/θ. This is the
    j_x, j_y of Wong & Chiang with the point's entry x_f = x + Vt t put in; for θ → 0 it is v_s t. A chord shrinks again
    beyond half a turn while the shear does not, so t is at most π/|ω|.

    Parameters
    ----------
    slip_x, slip_y : array
        Slip velocity v_s of the cells in m/s.
    yaw_rate, vt : array
        ω in rad/s and belt speed in m/s.
    time : array
        t in s.
    """
    turn = xp.where(yaw_rate < 0, -yaw_rate, yaw_rate)
    half_turn = np.pi / xp.where(turn > 1e-150, turn, 1e-150)
    time = xp.where(time < half_turn, time, half_turn)
    theta = yaw_rate * time
    turning = theta * theta > 1e-24
    safe = xp.where(turning, theta, 1.0)
    sine, cosine, half_sine = xp.sin(theta), xp.cos(theta), xp.sin(theta / 2)
    s = xp.where(turning, sine / safe, 1.0)
    c = xp.where(turning, 2 * half_sine * half_sine / safe, theta / 2)
    along = s * slip_x + c * slip_y + vt * (s - cosine)
    aside = s * slip_y - c * slip_x + vt * (sine - c)
    return time * xp.sqrt(along * along + aside * aside + _TINY_SQUARE)


def shear_strength(xp: ArrayNamespace, vehicle: TrackedVehicle, mode: Mode, terrain: list[Any], load: Any) -> Any:
    """Return τ_max in Pa under an element that carries ``load`` N.

    μ p (rigid) or c·min(1, N_i/N_c) + p tan φ (soil), p = N_i/(ℓ b), N_c = 5 % of W/(2n).
    """
    pressure = load / (vehicle.element_length * vehicle.track_width)
    if mode == "rigid":
        return terrain[0] * pressure
    full_contact = COHESION_FADE * vehicle.weight / (2 * vehicle.road_wheels)
    return terrain[0] * xp.clip(load / full_contact, 0.0, 1.0) + pressure * xp.tan(terrain[1])


def track_force(
    xp: ArrayNamespace,
    vehicle: TrackedVehicle,
    mode: Mode,
    columns: list[Any],
    *,
    side: Literal["left", "right"],
    grid: ShearGrid,
    soft_speed: float,
) -> list[Any]:
    """Return [Fx, Fy, M] of one track in N, N, N m; M about the CG.

    At each cell v_s = (Vx − ω y − Vt, Vy + ω x), t_c = d/√(Vt² + V_ε²), j = |v_s| t_c on the soft path, z = j/K and
    dF = −τ_max (j/(K |v_s|)) φ₁(z) v_s dA; rolling resistance adds −f_r N s to Fx.

    Parameters
    ----------
    columns : list
        The d interface columns, as ``xp.columns`` gives them.
    side : {"left", "right"}
        Which track.
    grid : ShearGrid
        Cells, contact option and shear path.
    soft_speed : float
        V_ε in m/s.
    """
    vx, vy, yaw_rate, ax, ay = columns[:5]
    terrain = columns[7:]
    rolling_coefficient, shear_modulus = terrain[-2:]
    sign = 1.0 if side == "left" else -1.0
    vt = columns[5] if side == "left" else columns[6]
    side_load = side_loads(xp, vehicle, ay)[0 if side == "left" else 1]
    direction = rolling_direction(xp, vt, soft_speed)
    belt_speed = xp.sqrt(vt * vt + soft_speed**2)

    length, width = vehicle.element_length, vehicle.track_width
    area = length * width / (grid.along * grid.across)
    along = ((np.arange(grid.along) + 0.5) / grid.along - 0.5) * length
    across = ((np.arange(grid.across) + 0.5) / grid.across - 0.5) * width
    offset = xp.constant(np.repeat(along, grid.across))
    y = xp.constant(sign * (vehicle.tread / 2 + np.tile(across, grid.along)))

    resistance = -rolling_coefficient * side_load * direction
    fx, fy, moment = resistance, 0.0, -sign * vehicle.tread / 2 * resistance
    for center, share in zip(vehicle.element_centers, element_shares(xp, vehicle, ax), strict=True):
        x = offset + float(center)
        if grid.contact == "continuous":
            travelled = vehicle.contact_length / 2 - direction * (x - vehicle.contact_center)
        else:
            travelled = length / 2 - direction * offset
        slip_x = vx - yaw_rate * y - vt
        slip_y = vy + yaw_rate * x
        time = travelled / belt_speed
        sliding = xp.sqrt(slip_x * slip_x + slip_y * slip_y + _TINY_SQUARE)
        if grid.path == "soft":
            stretch = time / shear_modulus
            z = sliding * stretch
        else:
            z = exact_displacement(xp, slip_x, slip_y, yaw_rate, vt, time) / shear_modulus
            stretch = z / sliding
        strength = shear_strength(xp, vehicle, mode, terrain, side_load * share) * area
        factor = -strength * stretch * shear_factor(xp, z)
        cell_fx, cell_fy = factor * slip_x, factor * slip_y
        fx = fx + xp.total(cell_fx)
        fy = fy + xp.total(cell_fy)
        moment = moment + xp.total(x * cell_fy - y * cell_fx)
    return [fx, fy, moment]


def block_forces(
    xp: ArrayNamespace,
    vehicle: TrackedVehicle,
    mode: Mode,
    x: Any,
    *,
    grid: ShearGrid | None = None,
    soft_speed: float | None = None,
) -> Any:
    """Return [Qx, Qy, Mz] of the cell-integrated block.

    Parameters
    ----------
    xp : ArrayNamespace
        NumPy, torch or CasADi.
    vehicle : TrackedVehicle
        The vehicle.
    mode : {"rigid", "soil"}
        Terrain mode.
    x : array (n, d) or (d,), or CasADi column (d, 1)
        Interface array.
    grid : ShearGrid, optional
        Cells, contact option and shear path; 16 × 4 cells an element, the vehicle's contact option and the soft path
        by default.
    soft_speed : float, optional
        V_ε in m/s; the vehicle's by default.

    Returns
    -------
    array (n, 3) or (3,), or CasADi column (3, 1)
    """
    grid = grid or ShearGrid(contact=vehicle.contact)
    check_contact(grid.contact, vehicle)
    v_eps = vehicle.soft_speed if soft_speed is None else soft_speed
    columns = xp.columns(x)
    left = track_force(xp, vehicle, mode, columns, side="left", grid=grid, soft_speed=v_eps)
    right = track_force(xp, vehicle, mode, columns, side="right", grid=grid, soft_speed=v_eps)
    return xp.join([a + b for a, b in zip(left, right, strict=True)])


def reference_forces(
    vehicle: TrackedVehicle,
    mode: Mode,
    x: FloatArray,
    *,
    grid: ShearGrid | None = None,
    soft_speed: float | None = None,
) -> FloatArray:
    """Evaluate :func:`block_forces` with NumPy in float64: the oracle of every other implementation.

    Raises
    ------
    InvalidInputError
        If the shape is wrong, a value is not finite, k is not positive, or a belt stands still at V_ε = 0.
    """
    checked = interface(mode).check(x)
    v_eps = vehicle.soft_speed if soft_speed is None else soft_speed
    require_in("soft_speed", v_eps, 0.0, 10.0)
    if not np.all(checked[..., -1] > 0):
        raise InvalidInputError("k must be positive")
    if v_eps == 0 and not np.all(checked[..., 5:7]):
        raise InvalidInputError("with soft_speed 0 every belt must run: the contact time of a stopped one is infinite")
    forces: FloatArray = block_forces(NUMPY, vehicle, mode, checked, grid=grid, soft_speed=soft_speed)
    return forces
