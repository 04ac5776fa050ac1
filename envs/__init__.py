"""How does the vehicle move, and what is the task? Simulator, interface log, rollout, paths and Gymnasium tasks."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .corridor import Corridor, Lane
from .driveline import advance_belts
from .fleet import FleetRecord, VehicleFleet
from .footing import GROUND_SAMPLINGS, Footing, GroundSampling
from .log import STATE_NAMES, InterfaceLog, LogRecorder
from .motion_profile import MotionProfile
from .path import Path, Projection
from .paths import make_path, path_names
from .registration import register_environments
from .rollout import rollout
from .simulator import Simulator, TickRecord
from .speed_config import SpeedConfig, SpeedResetOptions
from .speed_tracking import SpeedTrackingEnv
from .state import BeltCommand, Driver, VehicleState
from .task_config import TaskConfig
from .tick import INTEGRATORS, Integrator
from .tracking import PathTrackingEnv
from .tracking_config import ResetOptions, TrackingConfig

if TYPE_CHECKING:
    from .highway import OffRoadEnv, ParkingEnv, TrackedHighwayVehicle, tracked_vehicle_class, use_tracked_vehicle

# What needs highway-env is loaded where it is first asked for.
_HIGHWAY_NAMES = (
    "OffRoadEnv",
    "ParkingEnv",
    "TrackedHighwayVehicle",
    "tracked_vehicle_class",
    "use_tracked_vehicle",
)

__all__ = [
    "GROUND_SAMPLINGS",
    "INTEGRATORS",
    "STATE_NAMES",
    "BeltCommand",
    "Corridor",
    "Driver",
    "FleetRecord",
    "Footing",
    "GroundSampling",
    "Integrator",
    "InterfaceLog",
    "Lane",
    "LogRecorder",
    "MotionProfile",
    "OffRoadEnv",
    "ParkingEnv",
    "Path",
    "PathTrackingEnv",
    "Projection",
    "ResetOptions",
    "Simulator",
    "SpeedConfig",
    "SpeedResetOptions",
    "SpeedTrackingEnv",
    "TaskConfig",
    "TickRecord",
    "TrackedHighwayVehicle",
    "TrackingConfig",
    "VehicleFleet",
    "VehicleState",
    "advance_belts",
    "make_path",
    "path_names",
    "register_environments",
    "rollout",
    "tracked_vehicle_class",
    "use_tracked_vehicle",
]


def __getattr__(name: str) -> Any:
    if name in _HIGHWAY_NAMES:
        return getattr(import_module(".highway", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
