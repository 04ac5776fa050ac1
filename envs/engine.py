"""What the compiled engine takes of a backend, a guard and a ground."""

from __future__ import annotations

import math
from collections.abc import MutableMapping
from typing import Any, Final, NamedTuple, Protocol, runtime_checkable

import numpy as np

from ..native import Detector, Field
from ..terrain import (
    CompiledBackend,
    ConfigurationError,
    FloatArray,
    ForceBackend,
    Ground,
    GuardedBackend,
    Mode,
    RigidTerrain,
    SlopedGround,
    SoilTerrain,
    SwitchingPolicy,
    TerrainField,
)

#: Samples that the compiled guard remembers.
MAXIMUM_ENTRY_WINDOW: Final = 32


@runtime_checkable
class CompilableDetector(Protocol):
    """A detector that hands out its compiled form."""

    @property
    def mode(self) -> Mode:
        """Terrain mode."""

    def compiled(self) -> Detector:
        """Return the compiled detector."""


class CompiledGround(NamedTuple):
    """θ of both tracks, the slope (∂z/∂x, ∂z/∂y) of the plane, and the field that replaces θ and adds to the slope."""

    theta: FloatArray
    slope: tuple[float, float]
    field: Field | None


def compiled_kernel(backend: ForceBackend) -> Any:
    """Return the compiled function of a backend whose forces are that function and nothing else.

    Raises
    ------
    ConfigurationError
        If it has none.
    """
    kind = type(backend)
    plain = isinstance(backend, CompiledBackend) and all(
        getattr(kind, name) is getattr(CompiledBackend, name)
        for name in ("forces", "forces_and_jacobian", "track_forces", "track_forces_and_jacobian")
    )
    kernel = backend.kernel if isinstance(backend, CompiledBackend) and plain else None
    if not hasattr(kernel, "kernel"):
        raise ConfigurationError(
            f"the compiled engine moves vehicles on compiled forces, and the {backend.name!r} backend is Python: use "
            "'physics', 'exact', 'native' or 'guarded', or the Simulator, which takes any backend"
        )
    return kernel


def compiled_guard(backend: ForceBackend) -> dict[str, Any]:
    """Return fallback, detector and policy as the engine takes them; nothing without a guard.

    Raises
    ------
    ConfigurationError
        If the detector or the policy is none that the engine has.
    """
    if not isinstance(backend, GuardedBackend):
        return {}
    return {
        "fallback": compiled_kernel(backend.fallback),
        "detector": _compiled_detector(backend.detector, backend.mode),
        "policy": _compiled_policy(backend.policy),
    }


def _compiled_detector(detector: object, mode: Mode) -> Detector:
    if not isinstance(detector, CompilableDetector) or detector.mode != mode:
        raise ConfigurationError(
            f"the compiled guard knows a box and a Mahalanobis distance in {mode} ground, not a "
            f"{type(detector).__name__}: use a BoxMahalanobisDetector of that mode, or the Simulator"
        )
    return detector.compiled()


def _compiled_policy(policy: SwitchingPolicy) -> tuple[int, int, float, float, float, int]:
    if type(policy) is not SwitchingPolicy or policy.entry_window > MAXIMUM_ENTRY_WINDOW:
        raise ConfigurationError(
            f"the compiled guard takes a plain SwitchingPolicy with an entry_window of at most {MAXIMUM_ENTRY_WINDOW}, "
            f"got {policy!r}: use one, or the Simulator"
        )
    return (
        policy.entry_votes,
        policy.entry_window,
        policy.exit_score,
        policy.exit_time,
        policy.minimum_dwell,
        policy.blend_samples,
    )


def compiled_ground(ground: Ground, fields: MutableMapping[TerrainField, Field]) -> CompiledGround:
    """Return a ground as the engine takes it.

    Parameters
    ----------
    ground : Ground
        A terrain, a terrain field, or a slope of one.
    fields : mutable mapping
        Fields that are compiled already; a new one is added.

    Raises
    ------
    ConfigurationError
        If it is another ground.
    """
    along = aside = 0.0
    while isinstance(ground, SlopedGround):
        along, aside = along + math.tan(ground.grade), aside + math.tan(ground.bank)
        ground = ground.ground
    if isinstance(ground, RigidTerrain | SoilTerrain):
        return CompiledGround(np.tile(ground.parameters, 2), (along, aside), None)
    if not isinstance(ground, TerrainField):
        raise ConfigurationError(
            "the compiled engine drives on a terrain, a TerrainField or a SlopedGround over one, not on a "
            f"{type(ground).__name__}: sample it into a field, or use the Simulator"
        )
    if ground not in fields:
        fields[ground] = _compiled_field(ground)
    return CompiledGround(np.zeros(2 * ground.parameters.shape[2]), (along, aside), fields[ground])


def _compiled_field(field: TerrainField) -> Field:
    rows, columns, parameters = field.parameters.shape
    around = [(1, 1), (1, 1)]
    return Field(
        rows=rows,
        columns=columns,
        parameters=parameters,
        x=field.origin[0],
        y=field.origin[1],
        spacing=field.spacing,
        extend=field.outside == "extend",
        theta=np.pad(field.parameters, [*around, (0, 0)], mode="edge"),
        height=None if field.elevation is None else np.pad(field.elevation, around, mode="edge"),
    )


def check_mode(ground: Ground, mode: Mode) -> Ground:
    """Return the ground, once it is seen to be of a mode.

    Raises
    ------
    ConfigurationError
        If it is of the other.
    """
    if ground.mode != mode:
        raise ConfigurationError(f"the backend is for {mode} ground, got {ground.mode}")
    return ground
