"""Scenes of highway-env with vehicles that slip: its roads, lanes, collisions and pictures, our motion."""

from .motion import Motion, MotionModel
from .parking import ParkingEnv
from .parking_config import ParkingConfig, ParkingResetOptions
from .scene_config import SceneConfig
from .vehicle import TrackedHighwayVehicle, tracked_vehicle_class

__all__ = [
    "Motion",
    "MotionModel",
    "ParkingConfig",
    "ParkingEnv",
    "ParkingResetOptions",
    "SceneConfig",
    "TrackedHighwayVehicle",
    "tracked_vehicle_class",
]
