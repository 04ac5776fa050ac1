"""Which force does the ground return? Interface, terrains, vehicles, the block's equations, and force backends."""

from .backend import ForceBackend, assemble
from .block import SHEAR_PATHS, ShearGrid, ShearPath, block_forces, reference_forces
from .catalogue import Sheet, SourcedNumber, read_terrains, read_vehicles, terrain_sheet, vehicle_sheet
from .closed_forms import (
    locked_tracks_moment,
    matched_pivot_moment,
    mobilized_share,
    radius_integral,
    shear_capacity,
    skid_turn_slip,
    straight_thrust,
    turning_resistance,
)
from .compiled import CompiledBackend
from .errors import (
    ArtifactError,
    ConfigurationError,
    GrouserError,
    InvalidInputError,
    SimulationDivergedError,
    missing_extra,
    unknown_name,
)
from .exact import ExactBackend
from .field import OUTSIDE_RULES, Outside, TerrainField
from .field_file import load_field, save_field
from .files import write_aside, write_json
from .ground import Ground, SlopedGround, resolve_ground
from .guard import BlendedForces, Detection, Detector, GuardedBackend, GuardMode, GuardState, SwitchingPolicy
from .interface import (
    MODES,
    MOTION_NAMES,
    MOTION_SIZE,
    OUTPUT_NAMES,
    OUTPUTS,
    RIGID,
    SOIL,
    Column,
    FloatArray,
    Interface,
    Mode,
    interface,
    mirror_forces,
    reverse_forces,
)
from .named import named, resolve_terrain, terrain_names
from .namespace import NUMPY, ArrayNamespace, casadi_namespace, torch_namespace
from .painting import Disc, Noise, Patch, Rectangle, Shape, paint_field
from .parameters import (
    RANGE_NAMES,
    ParameterRanges,
    RigidTerrain,
    SoilTerrain,
    Terrain,
    parameter_ranges,
    terrain_from_mapping,
    terrain_type,
)
from .physics import PhysicsBackend, physics_options
from .registry import backend_names, make_backend, register_backend
from .slope import LEVEL, ForceFunction, Gravity, body_gravity, level_equivalent, on_slope
from .steady import SteadyMotion, steady_motion, steady_turn, tightest_turn
from .vehicle import CONTACTS, GRAVITY, Contact, TrackedVehicle, resolve_vehicle, vehicle_names

register_backend("physics", PhysicsBackend)
register_backend("exact", ExactBackend)

__all__ = [
    "CONTACTS",
    "GRAVITY",
    "LEVEL",
    "MODES",
    "MOTION_NAMES",
    "MOTION_SIZE",
    "NUMPY",
    "OUTPUTS",
    "OUTPUT_NAMES",
    "OUTSIDE_RULES",
    "RANGE_NAMES",
    "RIGID",
    "SHEAR_PATHS",
    "SOIL",
    "ArrayNamespace",
    "ArtifactError",
    "BlendedForces",
    "Column",
    "CompiledBackend",
    "ConfigurationError",
    "Contact",
    "Detection",
    "Detector",
    "Disc",
    "ExactBackend",
    "FloatArray",
    "ForceBackend",
    "ForceFunction",
    "Gravity",
    "Ground",
    "GrouserError",
    "GuardMode",
    "GuardState",
    "GuardedBackend",
    "Interface",
    "InvalidInputError",
    "Mode",
    "Noise",
    "Outside",
    "ParameterRanges",
    "Patch",
    "PhysicsBackend",
    "Rectangle",
    "RigidTerrain",
    "Shape",
    "ShearGrid",
    "ShearPath",
    "Sheet",
    "SimulationDivergedError",
    "SlopedGround",
    "SoilTerrain",
    "SourcedNumber",
    "SteadyMotion",
    "SwitchingPolicy",
    "Terrain",
    "TerrainField",
    "TrackedVehicle",
    "assemble",
    "backend_names",
    "block_forces",
    "body_gravity",
    "casadi_namespace",
    "interface",
    "level_equivalent",
    "load_field",
    "locked_tracks_moment",
    "make_backend",
    "matched_pivot_moment",
    "mirror_forces",
    "missing_extra",
    "mobilized_share",
    "named",
    "on_slope",
    "paint_field",
    "parameter_ranges",
    "physics_options",
    "radius_integral",
    "read_terrains",
    "read_vehicles",
    "reference_forces",
    "register_backend",
    "resolve_ground",
    "resolve_terrain",
    "resolve_vehicle",
    "reverse_forces",
    "save_field",
    "shear_capacity",
    "skid_turn_slip",
    "steady_motion",
    "steady_turn",
    "straight_thrust",
    "terrain_from_mapping",
    "terrain_names",
    "terrain_sheet",
    "terrain_type",
    "tightest_turn",
    "torch_namespace",
    "turning_resistance",
    "unknown_name",
    "vehicle_names",
    "vehicle_sheet",
    "write_aside",
    "write_json",
]
