"""Scenes of highway-env with vehicles that slip: its roads, lanes, collisions and pictures, our motion."""

from .adoption import use_tracked_vehicle
from .kinematics import Kinematics
from .lane import SplineLane
from .motion import Motion
from .motion_model import MotionModel
from .offroad import OffRoadEnv
from .offroad_config import OffRoadConfig, OffRoadResetOptions
from .parking import ParkingEnv
from .parking_config import ParkingConfig, ParkingResetOptions
from .scene_config import SceneConfig
from .vehicle import TrackedHighwayVehicle
from .vehicle_class import tracked_vehicle_class

__all__ = [
    "Kinematics",
    "Motion",
    "MotionModel",
    "OffRoadConfig",
    "OffRoadEnv",
    "OffRoadResetOptions",
    "ParkingConfig",
    "ParkingEnv",
    "ParkingResetOptions",
    "SceneConfig",
    "SplineLane",
    "TrackedHighwayVehicle",
    "tracked_vehicle_class",
    "use_tracked_vehicle",
]
