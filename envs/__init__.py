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
from .randomization import Randomization
from .registration import register_environments
from .reward import RewardFunction, StepView
from .rollout import rollout
from .simulator import Simulator, TickRecord
from .speed_config import SpeedConfig, SpeedResetOptions
from .speed_tracking import SpeedTrackingEnv
from .state import BeltCommand, Driver, VehicleState
from .task_config import RandomizedTaskConfig, TaskConfig
from .tick import INTEGRATORS, Integrator
from .tracking import PathTrackingEnv
from .tracking_config import ResetOptions, TrackingConfig
from .vector_wrappers import VectorActionDelay, VectorObservationNoise
from .wrappers import ActionDelay, ObservationNoise

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
    "ActionDelay",
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
    "ObservationNoise",
    "OffRoadEnv",
    "ParkingEnv",
    "Path",
    "PathTrackingEnv",
    "Projection",
    "Randomization",
    "RandomizedTaskConfig",
    "ResetOptions",
    "RewardFunction",
    "Simulator",
    "SpeedConfig",
    "SpeedResetOptions",
    "SpeedTrackingEnv",
    "StepView",
    "TaskConfig",
    "TickRecord",
    "TrackedHighwayVehicle",
    "TrackingConfig",
    "VectorActionDelay",
    "VectorObservationNoise",
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
