"""Which force does the ground return? Interface, terrains, vehicles, the block's equations, and force backends."""

from .backend import ForceBackend, assemble
from .block import ShearGrid, block_forces, reference_forces
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
from .files import write_aside, write_json
from .ground import Ground, SteppedTerrain, resolve_ground
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
from .parameters import (
    RANGE_NAMES,
    ParameterRanges,
    RigidTerrain,
    SoilTerrain,
    Terrain,
    parameter_ranges,
    terrain_from_mapping,
)
from .physics import PhysicsBackend, physics_options
from .registry import backend_names, make_backend, register_backend
from .vehicle import CONTACTS, GRAVITY, Contact, TrackedVehicle, resolve_vehicle, vehicle_names

register_backend("physics", PhysicsBackend)

__all__ = [
    "CONTACTS",
    "GRAVITY",
    "MODES",
    "MOTION_NAMES",
    "MOTION_SIZE",
    "NUMPY",
    "OUTPUTS",
    "OUTPUT_NAMES",
    "RANGE_NAMES",
    "RIGID",
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
    "FloatArray",
    "ForceBackend",
    "Ground",
    "GrouserError",
    "GuardMode",
    "GuardState",
    "GuardedBackend",
    "Interface",
    "InvalidInputError",
    "Mode",
    "ParameterRanges",
    "PhysicsBackend",
    "RigidTerrain",
    "ShearGrid",
    "SimulationDivergedError",
    "SoilTerrain",
    "SteppedTerrain",
    "SwitchingPolicy",
    "Terrain",
    "TrackedVehicle",
    "assemble",
    "backend_names",
    "block_forces",
    "casadi_namespace",
    "interface",
    "make_backend",
    "mirror_forces",
    "missing_extra",
    "named",
    "parameter_ranges",
    "physics_options",
    "reference_forces",
    "register_backend",
    "resolve_ground",
    "resolve_terrain",
    "resolve_vehicle",
    "reverse_forces",
    "terrain_from_mapping",
    "terrain_names",
    "torch_namespace",
    "unknown_name",
    "vehicle_names",
    "write_aside",
    "write_json",
]
