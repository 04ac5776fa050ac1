"""Classes of tracked vehicles for highway-env to make, each with a backend, a machine and a ground of its own."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from ...terrain import ForceBackend, Ground, TrackedVehicle, make_backend, resolve_ground, resolve_vehicle
from ..footing import GroundSampling
from ..tick import Integrator
from ..tracked_env import Engine
from .footprint import footprint_of
from .motion_model import MotionModel
from .vehicle import TrackedHighwayVehicle


def tracked_vehicle_class(
    backend: str | ForceBackend = "physics",
    vehicle: str | os.PathLike[str] | TrackedVehicle = "m113",
    terrain: str | os.PathLike[str] | Ground = "asphalt",
    *,
    size: tuple[float, float] | None = None,
    backend_options: Mapping[str, Any] | None = None,
    tick: float = 0.01,
    integrator: Integrator = "implicit",
    ground_sampling: GroundSampling = "vehicle",
    engine: Engine | None = None,
) -> type[TrackedHighwayVehicle]:
    """Return a class of tracked vehicles that highway-env can make by its own constructors.

    Parameters
    ----------
    backend : str or ForceBackend
        Name for :func:`grouser.terrain.make_backend`, or a backend.
    vehicle : str, path-like or TrackedVehicle
        Preset name, catalogue file or vehicle.
    terrain : str, path-like or Ground
        The ground of every vehicle of the class, a terrain field with patches included.
    size : tuple of float, optional
        Length and width in m; those of its hull, else of the rectangle around its tracks.
    backend_options : mapping, optional
        For :func:`grouser.terrain.make_backend`.
    tick, integrator, ground_sampling, engine
        As of :class:`MotionModel`; the tick is the longest that a step is divided into.

    Raises
    ------
    ConfigurationError
        If a name is unknown, or the parts do not fit together.
    InvalidInputError
        If a number is impossible.
    """
    machine, ground = resolve_vehicle(vehicle), resolve_ground(terrain)
    model = MotionModel(
        machine,
        make_backend(backend, mode=ground.mode, vehicle=machine, **(backend_options or {})),
        ground,
        tick=tick,
        integrator=integrator,
        ground_sampling=ground_sampling,
        engine=engine,
    )
    length, width = footprint_of(machine, size)

    class Configured(TrackedHighwayVehicle):
        """As configured."""

        LENGTH, WIDTH = length, width

        @classmethod
        def default_model(cls) -> MotionModel:
            return model

    return Configured
