"""Backends by name. Rooms above this one register theirs; nothing here names them."""

from __future__ import annotations

import os
from collections.abc import Callable
from importlib import import_module
from typing import Any, Final

from .backend import ForceBackend
from .errors import ConfigurationError, unknown_name
from .interface import Mode, interface
from .vehicle import TrackedVehicle, resolve_vehicle

BackendFactory = Callable[..., ForceBackend]

_ENTRY_POINTS: Final[dict[str, str | BackendFactory]] = {}


def register_backend(name: str, entry_point: str | BackendFactory) -> None:
    """Make a backend available to :func:`make_backend`, as Gymnasium registers environments.

    Parameters
    ----------
    name : str
        Name that users pass as ``backend=``.
    entry_point : str or callable
        ``"package.module:attribute"``, imported on first use, or the factory itself. It is called with the keyword
        arguments ``vehicle`` and ``mode`` and whatever options :func:`make_backend` received.

    Raises
    ------
    ConfigurationError
        If a string entry point has no colon.
    """
    if isinstance(entry_point, str) and entry_point.count(":") != 1:
        raise ConfigurationError(f"an entry point reads 'package.module:attribute', got {entry_point!r}")
    _ENTRY_POINTS[name] = entry_point


def backend_names() -> tuple[str, ...]:
    """Names that :func:`make_backend` knows, sorted."""
    return tuple(sorted(_ENTRY_POINTS))


def make_backend(
    backend: str | ForceBackend, *, mode: str, vehicle: str | os.PathLike[str] | TrackedVehicle = "m113", **options: Any
) -> ForceBackend:
    """Build a force backend.

    Parameters
    ----------
    backend : str or ForceBackend
        ``"physics"``, ``"torch"``, ``"native"``, ``"guarded"``, a registered name, or a backend, which is returned as
        it is once mode and vehicle are seen to fit.
    mode : {"rigid", "soil"}
        Terrain mode.
    vehicle : str, path-like or TrackedVehicle
        Preset name, catalogue file or vehicle.
    **options
        Passed to the backend: ``artifact=`` for surrogates (default: the shipped one of that vehicle and mode),
        ``cells=`` and ``contact=`` for physics.

    Raises
    ------
    ConfigurationError
        If the name is unknown, an option is not the backend's, or a given backend is for another mode or vehicle.

    Examples
    --------
    >>> make_backend("physics", mode="rigid", vehicle="m113").mode
    'rigid'
    """
    checked_mode: Mode = interface(mode).mode
    checked_vehicle = resolve_vehicle(vehicle)
    if isinstance(backend, ForceBackend):
        if options:
            raise ConfigurationError(f"options {sorted(options)} do not apply to a backend that is already built")
        if backend.mode != checked_mode or not backend.vehicle.same_block(checked_vehicle):
            raise ConfigurationError(
                f"the backend is for {backend.vehicle.name} on {backend.mode} ground, "
                f"asked for {checked_vehicle.name} on {checked_mode} ground"
            )
        return backend
    if backend not in _ENTRY_POINTS:
        raise unknown_name("backend", backend, _ENTRY_POINTS)
    try:
        return _load(backend)(vehicle=checked_vehicle, mode=checked_mode, **options)
    except TypeError as error:
        if "unexpected keyword argument" in str(error):
            raise ConfigurationError(f"the {backend!r} backend does not take these options: {error}") from error
        raise


def _load(name: str) -> BackendFactory:
    entry_point = _ENTRY_POINTS[name]
    if not isinstance(entry_point, str):
        return entry_point
    module, attribute = entry_point.split(":")
    factory: BackendFactory = getattr(import_module(module), attribute)
    return factory
