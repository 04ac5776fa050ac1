"""Many vehicles of one kind at once, moved by the compiled engine."""

from __future__ import annotations

import os
from collections.abc import Iterable, MutableMapping
from operator import attrgetter
from typing import Any, Final, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..native import Field, Fleet
from ..terrain import (
    GRAVITY,
    ConfigurationError,
    Detection,
    FloatArray,
    ForceBackend,
    Ground,
    GuardedBackend,
    GuardMode,
    GuardState,
    InvalidInputError,
    TerrainField,
    TrackedVehicle,
    make_backend,
    resolve_ground,
    resolve_vehicle,
)
from .engine import check_mode, compiled_ground, compiled_guard, compiled_kernel
from .footing import GroundSampling
from .log import STATE_NAMES
from .simulator import check_tick
from .state import VehicleState
from .tick import INTEGRATORS, Integrator, tolerance

# Rows of the engine's arrays, as native/include/grouser/fleet.h has them.
_MODE, _SAMPLES, _FLAGS, _DWELL, _CALM, _WEIGHT, _GUARD_ROWS = range(7)
_ROW_SIZE = 11
_FORCES = slice(_ROW_SIZE, _ROW_SIZE + 3)
_ITERATIONS, _DIVISIONS, _SCORE, _REASON, _WORST, _RECORD_ROWS = range(_ROW_SIZE + 3, _ROW_SIZE + 9)
_DIVERGED, _OFF_MAP = 1, 2
_REASONS = ("none", "finite", "box", "distance")
_FLAG_BITS = 32
_numbers_of = attrgetter(*STATE_NAMES)


class FleetRecord(NamedTuple):
    """What the last tick of each vehicle did; the arrays are those of the engine and change with the next one.

    Parameters
    ----------
    row : ndarray, shape (n, d)
        What the block received in the accepted evaluation, θ being that of the left track.
    forces : ndarray, shape (n, 3)
        What it returned.
    iterations, divisions : ndarray, shape (n,)
        Broyden's or Newton's steps, and parts that the tick was solved in.
    score : ndarray, shape (n,)
        What the guard's detector said of the row at the tick's start; 0 without a guard.
    active : ndarray of bool, shape (n,)
        Whether the fallback has a share in the forces.
    """

    row: FloatArray
    forces: FloatArray
    iterations: FloatArray
    divisions: FloatArray
    score: FloatArray
    active: NDArray[np.bool_]


class VehicleFleet:
    """Vehicles of one kind, each on its own ground, advanced together in compiled code.

    What one vehicle does is that of a :class:`~grouser.envs.Simulator` to rounding, and the same to the bit whatever
    other vehicles stand beside it and on however many threads. One that leaves the map, diverges, or whose state or
    command is not finite stays where it was and is marked; the others go on.

    Parameters
    ----------
    vehicle : str or TrackedVehicle
        Preset name or vehicle; :meth:`set_vehicle` gives one of them a driveline and a yaw inertia of its own.
    backend : str or ForceBackend
        A compiled one: ``"physics"``, ``"exact"``, ``"native"``, or ``"guarded"`` over two of them.
    ground : str, Ground, or iterable of Ground
        One for all, or one for each: terrains, terrain fields and slopes of them, of one mode.
    count : int
        Number of vehicles.
    tick : float
        T_s in s.
    integrator : {"implicit", "sdirk2", "euler"}
        As the simulator's.
    ground_sampling : {"vehicle", "tracks"}
        Whether θ is taken at the CG or at the middle of each track, which needs a backend with track forces.
    threads : int
        Threads that share the vehicles, the caller's among them.
    state : VehicleState
        Initial state of every vehicle.

    Attributes
    ----------
    numbers : ndarray, shape (11, n)
        The state of every vehicle, a row for each of :data:`~grouser.envs.STATE_NAMES`: the engine's own array, to be
        read and written between two calls.

    Raises
    ------
    ConfigurationError
        If a name is unknown, the backend or a ground is not compiled, or they do not fit together.
    InvalidInputError
        If a number is out of range.
    """

    def __init__(
        self,
        vehicle: str | os.PathLike[str] | TrackedVehicle,
        backend: str | ForceBackend,
        ground: str | os.PathLike[str] | Ground | Iterable[Ground],
        count: int,
        *,
        tick: float = 0.01,
        integrator: Integrator = "implicit",
        ground_sampling: GroundSampling = "vehicle",
        threads: int = 1,
        state: VehicleState = VehicleState(),  # noqa: B008 - frozen
    ) -> None:
        if isinstance(count, bool) or not isinstance(count, int) or count < 1:
            raise InvalidInputError(f"a fleet counts at least 1 vehicle, got {count!r}")
        grounds = _grounds(ground, count)
        self.vehicle: Final = resolve_vehicle(vehicle)
        self.backend: Final = make_backend(backend, mode=grounds[0].mode, vehicle=self.vehicle)
        check_tick(self.backend, tick, integrator, ground_sampling)
        self.tick: Final = tick
        self.integrator: Final[Integrator] = integrator
        self.ground_sampling: Final[GroundSampling] = ground_sampling
        self.numbers: Final[FloatArray] = np.zeros((len(STATE_NAMES), count))
        self._guard = np.zeros((_GUARD_ROWS, count))
        self._record = np.zeros((_RECORD_ROWS, count))
        self._status = np.zeros(count, np.uint8)
        # The vehicles hold the compiled fields that they stand on; a field that nobody drives on goes with its source.
        self._fields: MutableMapping[TerrainField, Field] = WeakKeyDictionary()
        self._threads = threads
        self._fleet = self._compile()
        self._vehicles = [self.vehicle] * count
        self._grounds = list(grounds)
        for index, each in enumerate(grounds):
            self.set_ground(index, each)
            self.set_state(index, state)

    def _compile(self) -> Fleet:
        """Return the engine over the fleet's own arrays."""
        guarded = self.backend if isinstance(self.backend, GuardedBackend) else None
        try:
            return Fleet(
                kernel=compiled_kernel(guarded.primary if guarded else self.backend),
                state=self.numbers,
                guard=self._guard,
                record=self._record,
                status=self._status,
                mass=self.vehicle.mass,
                yaw_inertia=self.vehicle.yaw_inertia,
                tread=self.vehicle.tread,
                contact_center=self.vehicle.contact_center,
                gravity=GRAVITY,
                belt_time_constant=self.vehicle.belt_time_constant,
                belt_acceleration=self.vehicle.belt_acceleration,
                tick=self.tick,
                integrator=INTEGRATORS.index(self.integrator),
                tolerance=tolerance(self.backend.resolution),
                sample_tracks=self.ground_sampling == "tracks",
                threads=self._threads,
                **compiled_guard(self.backend),
            )
        except ValueError as error:
            if isinstance(error, ConfigurationError):
                raise
            raise InvalidInputError(str(error)) from error

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name not in ("_fleet", "_fields")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._fields = WeakKeyDictionary()
        self._fleet = self._compile()
        for index, (vehicle, ground) in enumerate(zip(self._vehicles, self._grounds, strict=True)):
            self.set_vehicle(index, vehicle)
            self.set_ground(index, ground)

    def __len__(self) -> int:
        return len(self._status)

    @property
    def compiled(self) -> Fleet:
        """The engine itself, for compiled code that advances it."""
        return self._fleet

    @property
    def diverged(self) -> NDArray[np.bool_]:
        """Whether each vehicle was lost to numbers that are not finite, or to a tick that was not solved."""
        diverged: NDArray[np.bool_] = self._status == _DIVERGED
        return diverged

    @property
    def off_map(self) -> NDArray[np.bool_]:
        """Whether each vehicle came to where its ground has no parameters."""
        off_map: NDArray[np.bool_] = self._status == _OFF_MAP
        return off_map

    @property
    def record(self) -> FleetRecord:
        """What the last tick did."""
        return FleetRecord(
            self._record[: self.backend.interface.size].T,
            self._record[_FORCES].T,
            self._record[_ITERATIONS],
            self._record[_DIVISIONS],
            self._record[_SCORE],
            self._guard[_WEIGHT] > 0.0,
        )

    @property
    def on_fallback(self) -> NDArray[np.bool_]:
        """Whether the guard of each vehicle has changed over to the fallback."""
        changed: NDArray[np.bool_] = self._guard[_MODE] > 0.0
        return changed

    @property
    def fallback_weight(self) -> FloatArray:
        """Share of the fallback in the forces of each vehicle: the engine's own array."""
        weight: FloatArray = self._guard[_WEIGHT]
        return weight

    def detection(self, index: int) -> Detection | None:
        """Return what the guard's detector said of a vehicle's row at its last tick's start; None without a guard."""
        if not isinstance(self.backend, GuardedBackend):
            return None
        score, reason, worst = self._record[[_SCORE, _REASON, _WORST], index].tolist()
        column = self.backend.interface.names[int(worst)] if worst >= 0 else "primary output"
        return Detection(score, _REASONS[int(reason)], column)

    def get_vehicle(self, index: int) -> TrackedVehicle:
        """Return a vehicle: the fleet's, or the one that was set in its place."""
        return self._vehicles[index]

    def set_vehicle(self, index: int, vehicle: TrackedVehicle) -> None:
        """Replace a vehicle by one with its own yaw inertia, belt time constant or belt acceleration.

        They lie outside the force block, so that a backend made for the fleet's vehicle serves this one too. State and
        ground stay as they are.

        Parameters
        ----------
        index : int
            Which one.
        vehicle : TrackedVehicle
            As the fleet's :attr:`vehicle` in everything else that moves it.

        Raises
        ------
        ConfigurationError
            If it has another track-terrain block or another maximum speed.
        """
        if not vehicle.same_block(self.vehicle) or vehicle.maximum_speed != self.vehicle.maximum_speed:
            raise ConfigurationError(
                f"vehicles of a fleet of {self.vehicle.name} may differ in yaw_inertia, belt_time_constant and "
                f"belt_acceleration, got {vehicle.name} with another track-terrain block or maximum speed"
            )
        self._fleet.set_traits(index, vehicle.yaw_inertia, vehicle.belt_time_constant, vehicle.belt_acceleration)
        self._vehicles[index] = vehicle

    def ground(self, index: int) -> Ground:
        """Return the ground under a vehicle."""
        return self._grounds[index]

    def set_ground(self, index: int, ground: Ground) -> None:
        """Replace the ground under a vehicle by another of the same mode.

        Raises
        ------
        ConfigurationError
            If the mode differs, or the ground is not one that the engine has.
        """
        compiled = compiled_ground(check_mode(ground, self.backend.mode), self._fields)
        self._fleet.set_ground(index, compiled.theta, *compiled.slope, compiled.field)
        self._grounds[index] = ground

    def get_state(self, index: int) -> VehicleState:
        """Return the whole state of a vehicle.

        Raises
        ------
        InvalidInputError
            If a number of it is not finite.
        """
        mode, samples, flags, dwell, calm, weight = self._guard[:, index].tolist()
        bits = int(flags)
        guard = GuardState(
            GuardMode.FALLBACK if mode else GuardMode.PRIMARY,
            dwell,
            calm,
            tuple(bool(bits >> bit & 1) for bit in range(int(samples))),
            weight,
        )
        return VehicleState(**dict(zip(STATE_NAMES, self.numbers[:, index].tolist(), strict=True)), guard=guard)

    def set_state(self, index: int, state: VehicleState) -> None:
        """Replace the whole state of a vehicle, which is lost no longer."""
        guard, flags = state.guard, state.guard.flags[:_FLAG_BITS]
        bits = sum(1 << bit for bit, flag in enumerate(flags) if flag)
        self.numbers[:, index] = _numbers_of(state)
        self._guard[:, index] = [
            guard.mode is GuardMode.FALLBACK,
            len(flags),
            bits,
            guard.dwell,
            guard.calm,
            guard.fallback_weight,
        ]
        self._status[index] = 0

    def advance(self, commands: ArrayLike, ticks: int = 1) -> None:
        """Advance every vehicle that is not lost by a number of ticks under its command.

        Parameters
        ----------
        commands : array_like, shape (n, 2)
            Commanded belt speeds (left, right) in m/s, within the drive's maximum speed. One that is not finite loses
            its vehicle.
        ticks : int
            At least 1.

        Raises
        ------
        InvalidInputError
            If the shape is wrong, a command is out of reach or there is no tick.
        """
        belts = np.ascontiguousarray(commands, dtype=np.float64)
        limit = self.vehicle.maximum_speed
        if belts.shape != (len(self), 2):
            raise InvalidInputError(f"commands have shape ({len(self)}, 2): left, right; got {belts.shape}")
        reachable = (np.abs(belts) <= limit) | ~np.isfinite(belts)
        if not reachable.all():
            index = int(np.argwhere(~reachable)[0, 0])
            raise InvalidInputError(
                f"a belt command is two speeds in [{-limit:g}, {limit:g}] m/s ({self.vehicle.name}), got "
                f"{belts[index].tolist()} for vehicle {index}"
            )
        try:
            self._fleet.advance(belts, ticks)
        except ValueError as error:
            raise InvalidInputError(str(error)) from error


def _grounds(ground: Any, count: int) -> list[Ground]:
    """Return one ground for each vehicle."""
    if isinstance(ground, str | os.PathLike) or not isinstance(ground, Iterable):
        return [resolve_ground(ground)] * count
    grounds = [resolve_ground(each) for each in ground]
    if len(grounds) != count:
        raise InvalidInputError(f"a ground for all or for each of {count} vehicles, got {len(grounds)}")
    return grounds
