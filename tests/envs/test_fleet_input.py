"""What a fleet refuses, and how it says so."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from grouser.envs import Simulator, VehicleFleet, VehicleState
from grouser.native import Field, Fleet, Physics
from grouser.surrogate import Surrogate
from grouser.terrain import (
    ConfigurationError,
    Detection,
    FloatArray,
    ForceBackend,
    GuardedBackend,
    InvalidInputError,
    PhysicsBackend,
    RigidTerrain,
    SwitchingPolicy,
    TrackedVehicle,
    named,
)

M113 = TrackedVehicle.preset("m113")
ASPHALT = named("asphalt")
PHYSICS = PhysicsBackend(M113, "rigid", cells=(2, 1))
DETECTOR = Surrogate.resolve(M113, "rigid", None).detector


class Plain(ForceBackend):
    def forces(self, x: FloatArray) -> FloatArray:
        return np.zeros((*x.shape[:-1], 3))


class Halved(PhysicsBackend):
    """Compiled physics with another last word in Python."""

    def forces_and_jacobian(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        forces, jacobian = super().forces_and_jacobian(x)
        return forces / 2, jacobian / 2


class Always:
    def score(self, x: FloatArray) -> FloatArray:
        return np.zeros(len(x))

    def detect(self, row: FloatArray) -> Detection:
        return Detection(0.0, "none", "vx")


class Everywhere:
    """A ground of one's own."""

    mode = "rigid"

    def parameters_at(self, x: float, y: float) -> FloatArray:
        return ASPHALT.parameters

    def gradient_at(self, x: float, y: float) -> tuple[float, float]:
        return 0.0, 0.0


@pytest.mark.parametrize(
    ("backend", "said"),
    [
        (Plain(M113, "rigid"), "'physics', 'exact', 'native' or 'guarded'"),
        (Halved(M113, "rigid", cells=(2, 1)), "Python"),
        (GuardedBackend(Plain(M113, "rigid"), PHYSICS, DETECTOR), "Python"),
        (GuardedBackend(PHYSICS, Plain(M113, "rigid"), DETECTOR), "Python"),
        (GuardedBackend(PHYSICS, PHYSICS, Always()), "BoxMahalanobisDetector"),
        (GuardedBackend(PHYSICS, PHYSICS, DETECTOR, SwitchingPolicy(entry_window=33)), "entry_window"),
    ],
)
def test_a_backend_that_is_not_compiled_is_refused_with_what_to_use(backend: ForceBackend, said: str) -> None:
    with pytest.raises(ConfigurationError, match=said):
        VehicleFleet(M113, backend, ASPHALT, 1)


def test_a_ground_of_one_s_own_is_refused_with_what_to_use() -> None:
    Simulator(M113, PHYSICS, Everywhere())  # type: ignore[arg-type]
    with pytest.raises(ConfigurationError, match="TerrainField or a SlopedGround"):
        VehicleFleet(M113, PHYSICS, Everywhere(), 1)  # type: ignore[arg-type]


def test_a_ground_of_the_other_mode_is_refused() -> None:
    fleet = VehicleFleet(M113, PHYSICS, ASPHALT, 1)
    with pytest.raises(ConfigurationError, match="rigid ground, got soil"):
        fleet.set_ground(0, named("lete-sand"))
    with pytest.raises(ConfigurationError, match="rigid ground, got soil"):
        VehicleFleet(M113, PHYSICS, [ASPHALT, named("lete-sand")], 2)


@pytest.mark.parametrize(
    ("options", "error", "said"),
    [
        ({"count": 0}, InvalidInputError, "at least 1"),
        ({"count": 2.0}, InvalidInputError, "at least 1"),
        ({"ground": [ASPHALT]}, InvalidInputError, "each of 2"),
        ({"ground": 3}, InvalidInputError, "a ground has mode"),
        ({"tick": 0.0}, InvalidInputError, "tick"),
        ({"threads": 0}, InvalidInputError, "threads"),
        ({"threads": 65}, InvalidInputError, "threads"),
        ({"integrator": "implict"}, ConfigurationError, "implicit"),
        ({"ground_sampling": "track"}, ConfigurationError, "tracks"),
        ({"backend": "phisics"}, ConfigurationError, "physics"),
        ({"backend": "guarded", "ground_sampling": "tracks"}, ConfigurationError, "has_track_forces"),
    ],
)
def test_options_out_of_range_are_refused(options: dict[str, Any], error: type[Exception], said: str) -> None:
    given: dict[str, Any] = {"vehicle": M113, "backend": PHYSICS, "ground": ASPHALT, "count": 2} | options
    with pytest.raises(error, match=said):
        VehicleFleet(**given)


@pytest.mark.parametrize(
    ("commands", "ticks", "said"),
    [
        (np.zeros((2, 2)), 1, r"shape \(3, 2\)"),
        (np.zeros(6), 1, r"shape \(3, 2\)"),
        ([[0.0, 0.0], [0.0, 99.0], [0.0, 0.0]], 1, "vehicle 1"),
        (np.zeros((3, 2)), 0, "ticks"),
        (np.zeros((3, 2)), -1, "ticks"),
    ],
)
def test_commands_that_do_not_fit_are_refused_and_nothing_moves(commands: Any, ticks: int, said: str) -> None:
    fleet = VehicleFleet(M113, PHYSICS, ASPHALT, 3)
    with pytest.raises(InvalidInputError, match=said):
        fleet.advance(commands, ticks)
    assert fleet.get_state(0) == VehicleState()


@pytest.mark.parametrize("change", [{"mass": 12e3}, {"cg_height": 1.0}, {"tread": 2.5}, {"maximum_speed": 20.0}])
def test_a_vehicle_that_needs_another_block_or_commands_is_refused(change: dict[str, float]) -> None:
    fleet = VehicleFleet(M113, PHYSICS, ASPHALT, 2)
    with pytest.raises(ConfigurationError, match="yaw_inertia, belt_time_constant and belt_acceleration"):
        fleet.set_vehicle(1, replace(M113, **change))  # type: ignore[arg-type]
    assert fleet.get_vehicle(1) is M113


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
@pytest.mark.parametrize("place", [0, 1, 2])
def test_the_engine_refuses_traits_that_are_not_positive_and_finite(place: int, value: float) -> None:
    traits = [37300.0, 0.2, 4.0]
    traits[place] = value
    with pytest.raises(ValueError, match="positive and finite"):
        engine().set_traits(0, *traits)


@pytest.mark.parametrize("index", [-1, 4, 2**40])
def test_a_vehicle_that_is_not_there_has_no_traits(index: int) -> None:
    with pytest.raises(ValueError, match="vehicle must lie in"):
        engine().set_traits(index, 37300.0, 0.2, 4.0)


@pytest.mark.parametrize("index", [-1, 3, 2**40])
def test_there_is_no_ground_under_a_vehicle_that_is_not_there(index: int) -> None:
    fleet = VehicleFleet(M113, PHYSICS, ASPHALT, 3)
    with pytest.raises((ValueError, IndexError)):
        fleet._fleet.set_ground(index, np.zeros(6), 0.0, 0.0)


# The engine's own arrays


def engine(**changes: Any) -> Fleet:
    given: dict[str, Any] = {
        "kernel": PHYSICS.kernel,
        "state": np.zeros((11, 4)),
        "guard": np.zeros((6, 4)),
        "record": np.zeros((19, 4)),
        "status": np.zeros(4, np.uint8),
        "mass": 11300.0,
        "yaw_inertia": 37300.0,
        "tread": 2.159,
        "contact_center": 0.0,
        "gravity": 9.81,
        "belt_time_constant": 0.2,
        "belt_acceleration": 4.0,
        "tick": 0.01,
        "integrator": 0,
        "tolerance": 1e-11,
        "sample_tracks": False,
        "threads": 1,
    }
    return Fleet(**given | changes)


SHARED = np.zeros((19, 4))


def read_only(array: FloatArray) -> FloatArray:
    array.setflags(write=False)
    return array


@pytest.mark.parametrize(
    ("changes", "named_in_error"),
    [
        ({"state": np.zeros((11, 5))}, "state"),
        ({"state": np.zeros((4, 11)).T}, "state"),
        ({"state": np.zeros((11, 4), np.float32)}, "state"),
        ({"state": read_only(np.zeros((11, 4)))}, "state"),
        ({"guard": np.zeros((5, 4))}, "guard"),
        ({"record": np.zeros((18, 4))}, "record"),
        ({"status": np.zeros(4)}, "status"),
        ({"status": np.zeros(0, np.uint8)}, "status"),
        ({"record": SHARED, "state": SHARED[:11]}, "overlap"),
        ({"mass": 0.0}, "mass"),
        ({"tick": np.nan}, "tick"),
        ({"contact_center": np.inf}, "contact_center"),
        ({"integrator": 3}, "integrator"),
        ({"threads": 0}, "threads"),
    ],
)
def test_the_engine_names_the_argument_that_does_not_fit(changes: dict[str, Any], named_in_error: str) -> None:
    with pytest.raises(ValueError, match=named_in_error):
        engine(**changes)


def test_the_engine_takes_compiled_kernels_alone() -> None:
    for other in (None, object()):
        with pytest.raises(AttributeError):
            engine(kernel=other)

    class Pretender:
        kernel = 3

    with pytest.raises((TypeError, ValueError)):
        engine(kernel=Pretender())


def test_a_vehicle_without_ground_does_not_start() -> None:
    fleet = engine()
    with pytest.raises(ValueError, match="4 vehicles have no ground"):
        fleet.advance(np.zeros((4, 2)), 1)
    for index in range(4):
        fleet.set_ground(index, np.tile(ASPHALT.parameters, 2), 0.0, 0.0)
    fleet.advance(np.zeros((4, 2)), 1)


def test_commands_may_not_be_the_state_itself() -> None:
    state = np.zeros((11, 4))
    fleet = engine(state=state)
    for index in range(4):
        fleet.set_ground(index, np.tile(ASPHALT.parameters, 2), 0.0, 0.0)
    with pytest.raises(ValueError, match="overlap"):
        fleet.advance(state.ravel()[:8].reshape(4, 2), 1)


def test_the_engine_keeps_the_arrays_alive_and_in_place() -> None:
    state = np.zeros((11, 4))
    fleet = engine(state=state)
    with pytest.raises(ValueError, match="resize"):
        state.resize((22, 4))
    del fleet
    state.resize((22, 4), refcheck=False)


def test_a_kernel_outlives_the_backend_that_made_it() -> None:
    def fleet() -> VehicleFleet:
        return VehicleFleet(M113, PhysicsBackend(M113, "rigid", cells=(2, 1)), RigidTerrain(0.8, 0.03, 0.02), 1)

    moved = fleet()
    moved.advance([[3.0, 3.0]], 10)
    assert moved.get_state(0).x > 0.0
    assert isinstance(moved.backend, PhysicsBackend)
    assert isinstance(moved.backend.kernel, Physics)


@pytest.mark.parametrize(
    "changes",
    [
        {"rows": 0},
        {"columns": -1},
        {"rows": 2**20, "columns": 2**20},
        {"parameters": 5},
        {"spacing": 0.0},
        {"x": np.nan},
        {"theta": np.zeros((4, 5, 2))},
        {"height": np.zeros((3, 5))},
    ],
)
def test_an_impossible_field_is_refused(changes: dict[str, Any]) -> None:
    given: dict[str, Any] = {
        "rows": 2,
        "columns": 3,
        "parameters": 3,
        "x": 0.0,
        "y": 0.0,
        "spacing": 1.0,
        "extend": False,
        "theta": np.ones((4, 5, 3)),
    }
    Field(**given)
    with pytest.raises(ValueError):  # noqa: PT011
        Field(**given | changes)
