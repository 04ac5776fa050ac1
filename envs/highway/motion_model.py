"""How a vehicle in a scene is moved: vehicle, backend, ground and tick."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

from ...terrain import ForceBackend, Ground, TrackedVehicle, make_backend, resolve_ground, unknown_name
from ..footing import GroundSampling
from ..simulator import check_tick
from ..tick import Integrator
from ..tracked_env import ENGINES, Engine


@dataclass(frozen=True, eq=False)
class MotionModel:
    """How a vehicle is moved.

    Parameters
    ----------
    vehicle : TrackedVehicle
        The vehicle.
    backend : ForceBackend
        Of the vehicle, and of the ground's mode.
    ground : Ground
        Under it.
    tick : float
        T_s in s.
    integrator : {"implicit", "sdirk2", "euler"}
        As the simulator's.
    ground_sampling : {"vehicle", "tracks"}
        As the simulator's.
    engine : {"compiled", "python"}, optional
        What computes the ticks; the compiled engine by default, wherever it has the backend and the ground.

    Raises
    ------
    ConfigurationError
        If a name is unknown, or the parts do not fit together.
    InvalidInputError
        If the tick is not in (0, 1] s.
    """

    vehicle: TrackedVehicle
    backend: ForceBackend
    ground: Ground
    tick: float = 0.01
    integrator: Integrator = "implicit"
    ground_sampling: GroundSampling = "vehicle"
    engine: Engine | None = None

    def __post_init__(self) -> None:
        if self.engine is not None and self.engine not in ENGINES:
            raise unknown_name("engine", self.engine, ENGINES)
        check_tick(self.backend, self.tick, self.integrator, self.ground_sampling)

    def __deepcopy__(self, memo: dict[int, Any]) -> MotionModel:
        # Nothing of it ever changes, and a copied backend would compile its kernel anew.
        return self


@cache
def standard_model() -> MotionModel:
    """Return an M113 on asphalt, with the ``"physics"`` backend."""
    vehicle, ground = TrackedVehicle.preset("m113"), resolve_ground("asphalt")
    return MotionModel(vehicle, make_backend("physics", mode=ground.mode, vehicle=vehicle), ground)
