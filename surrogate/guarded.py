"""The guarded surrogate: a network where it was trained, the compiled physics elsewhere."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, ClassVar, Final, Literal

from ..native import Gated
from ..terrain import (
    CompiledBackend,
    FloatArray,
    ForceBackend,
    GuardedBackend,
    Mode,
    PhysicsBackend,
    SwitchingPolicy,
    TrackedVehicle,
    make_backend,
    physics_options,
    unknown_name,
)
from .artifact import Surrogate
from .backends import Artifact, NativeSurrogate, TorchSurrogate

_PRIMARIES: Final = {"native": NativeSurrogate, "torch": TorchSurrogate}


class GuardedSurrogate(GuardedBackend):
    """A surrogate, the physics to fall back on, and the artifact's detector between them.

    Parameters
    ----------
    vehicle : TrackedVehicle
        The vehicle.
    mode : {"rigid", "soil"}
        Terrain mode.
    artifact : path or Surrogate, optional
        The shipped one of that vehicle and mode by default.
    primary : {"native", "torch"}
        What evaluates the network.
    policy : SwitchingPolicy, optional
        Entry, hysteresis, dwell, blend.
    **fallback
        Options of the fallback, such as ``cells`` and ``contact`` of :class:`~grouser.terrain.PhysicsBackend`. It is
        the artifact's teacher, physics unless it was taught by another block, with the teacher's options by default.

    Raises
    ------
    ArtifactError
        If the artifact cannot be read or is for another vehicle or mode.
    ConfigurationError
        If the primary is unknown, or torch is asked for and not installed.
    """

    name: ClassVar[str] = "guarded"

    def __init__(
        self,
        vehicle: TrackedVehicle,
        mode: Mode,
        artifact: Artifact = None,
        primary: Literal["native", "torch"] = "native",
        policy: SwitchingPolicy | None = None,
        **fallback: Any,
    ) -> None:
        if primary not in _PRIMARIES:
            raise unknown_name("primary backend", primary, _PRIMARIES)
        surrogate = Surrogate.resolve(vehicle, mode, artifact)
        super().__init__(
            _PRIMARIES[primary](vehicle, mode, surrogate),
            fallback_of(surrogate, vehicle, **fallback),
            surrogate.detector,
            policy,
        )
        self.surrogate: Final = surrogate
        self._compiled = self._compile()

    def _compile(self) -> CompiledBackend | None:
        """Return primary, detector and fallback as one compiled function, where all of them are."""
        primary, fallback = self.primary, self.fallback
        if not isinstance(primary, NativeSurrogate) or not isinstance(fallback, PhysicsBackend):
            return None
        gated = Gated(primary=primary.kernel, fallback=fallback.kernel, detector=self.surrogate.detector.compiled())
        return _CompiledGate(self.vehicle, self.mode, gated, domain="k must be positive")

    @property
    def compiled(self) -> CompiledBackend | None:
        """Primary, detector and fallback as one compiled function; None where one of them is not compiled."""
        return self._compiled

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_compiled"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._compiled = self._compile()

    def forces(self, x: FloatArray) -> FloatArray:
        """Return [Qx, Qy, Mz], shape (3,) or (n, 3); see :meth:`GuardedBackend.forces`."""
        return super().forces(x) if self._compiled is None else self._compiled.forces(x)

    def forces_and_jacobian(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return forces and ∂Q/∂x; see :meth:`GuardedBackend.forces_and_jacobian`."""
        return super().forces_and_jacobian(x) if self._compiled is None else self._compiled.forces_and_jacobian(x)

    def describe(self) -> dict[str, Any]:
        """Return the guard's parts, the detector's calibration and the switching policy."""
        return super().describe() | {"detector": self.surrogate.detector.summary(), "policy": asdict(self.policy)}


class _CompiledGate(CompiledBackend):
    name: ClassVar[str] = "guarded"


def fallback_of(surrogate: Surrogate, vehicle: TrackedVehicle, **options: Any) -> ForceBackend:
    """Return what a surrogate falls back on: its teacher, physics unless it was taught by another block.

    Parameters
    ----------
    surrogate : Surrogate
        The surrogate.
    vehicle : TrackedVehicle
        One of its block.
    **options
        Of the fallback, over the teacher's.
    """
    teacher = surrogate.recipe.get("teacher", {})
    name = teacher.get("backend", "physics")
    return make_backend(name, mode=surrogate.mode, vehicle=vehicle, **physics_options(teacher) | options)
