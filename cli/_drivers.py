"""Who drives and who gives the force, from what was typed."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Final

from ..envs import Driver, Path
from ..terrain import ConfigurationError, Ground, TrackedVehicle, terrain_type, unknown_name

if TYPE_CHECKING:
    from ..surrogate import Surrogate

CONTROLLERS: Final = ("mpc", "pure-pursuit")
_POLICY_SUFFIX: Final = ".safetensors"
_PHYSICS_BLOCKS: Final = ("physics", "exact")


def driver_factory(
    controller: str, path: Path, vehicle: TrackedVehicle, ground: Ground, speed: float
) -> tuple[str, Callable[[], Driver]]:
    """Return a controller's short name and what makes a fresh one.

    Parameters
    ----------
    controller : str
        One of :data:`CONTROLLERS`, the file of a policy, or the name of a shipped one.
    path : Path
        To drive along.
    vehicle : TrackedVehicle
        To drive.
    ground : Ground
        Both controllers are told the slip parameters of the level ground at the path's start.
    speed : float
        Reference speed in m/s.

    Raises
    ------
    ConfigurationError
        If the controller is unknown, or the policy is for another vehicle or ground.
    """
    from ..controllers import (
        MPCConfig,
        PathTrackingMPC,
        PolicyDriver,
        PurePursuit,
        identify_slip,
        load_policy,
        shipped_policies,
    )

    if controller.endswith(_POLICY_SUFFIX) or controller in shipped_policies():
        policy = load_policy(controller)
        trained = PolicyDriver(policy, path, ground).vehicle
        if trained != vehicle:
            raise ConfigurationError(f"{controller} drives {trained.name}, asked for {vehicle.name}: pass --vehicle")
        return FilePath(controller).stem, lambda: PolicyDriver(policy, path, ground)
    if controller not in CONTROLLERS:
        raise unknown_name("controller", controller, (*CONTROLLERS, *shipped_policies(), f"POLICY{_POLICY_SUFFIX}"))
    x, y = path.point_at(0.0)
    start = terrain_type(ground.mode)(*ground.parameters_at(float(x), float(y)).tolist())
    slip = identify_slip(vehicle, start, speed=speed)
    if controller == "mpc":
        return controller, lambda: PathTrackingMPC(path, vehicle, slip, MPCConfig(speed=speed))
    return controller, lambda: PurePursuit(path, vehicle, speed, slip=slip)


def fitting_artifact(artifacts: Sequence[FilePath], mode: str) -> Surrogate | None:
    """Return the artifact of a mode; the first where none fits, for the backend to refuse; None for the shipped one."""
    from ..surrogate import Surrogate

    loaded = [Surrogate.load(file) for file in artifacts]
    return next((surrogate for surrogate in loaded if surrogate.mode == mode), loaded[0] if loaded else None)


def takes_artifact(backend: str) -> bool:
    """Whether a backend answers from an artifact; the physics blocks do not."""
    return backend not in _PHYSICS_BLOCKS


def artifact_options(backend: str, artifacts: Sequence[FilePath], mode: str) -> dict[str, Any]:
    """Return the options of a backend that is given artifacts to choose from; those of no use are not read."""
    return {"artifact": fitting_artifact(artifacts, mode)} if artifacts and takes_artifact(backend) else {}


@contextmanager
def one_torch_thread(backends: Collection[str]) -> Iterator[None]:
    """Keep torch, where a backend is its, from spreading one row's evaluation over cores, which is slower."""
    if "torch" not in backends:
        yield
        return
    from ..surrogate.threads import torch_threads

    with torch_threads(1):
        yield
