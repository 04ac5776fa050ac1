"""A fleet does what the simulator does, one vehicle beside many others."""

import gc
import math
import os
import pickle
import weakref
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from grouser.envs import (
    INTEGRATORS,
    STATE_NAMES,
    BeltCommand,
    GroundSampling,
    Integrator,
    Simulator,
    TickRecord,
    VehicleFleet,
    VehicleState,
)
from grouser.surrogate import Surrogate
from grouser.terrain import (
    Detection,
    Disc,
    FloatArray,
    ForceBackend,
    Ground,
    GuardedBackend,
    GuardMode,
    GuardState,
    Patch,
    PhysicsBackend,
    Rectangle,
    RigidTerrain,
    SlopedGround,
    SoilTerrain,
    SwitchingPolicy,
    TerrainField,
    TrackedVehicle,
    make_backend,
    named,
    paint_field,
)

M113 = TrackedVehicle.preset("m113")
ARTIFACTS = Path(__file__).resolve().parents[2] / "surrogate" / "artifacts"
ASPHALT, SAND = named("asphalt"), named("lete-sand")
SLICK = RigidTerrain(mu=0.15, fr=0.02, k=0.01)
EXTENT = (-60.0, 60.0, -60.0, 60.0)
COARSE = {"cells": (2, 1)}


def hills(field: TerrainField) -> TerrainField:
    """Return the field with a surface that rolls by up to 6 degrees."""
    rows, columns = field.parameters.shape[:2]
    y, x = np.mgrid[:rows, :columns] * field.spacing
    heights = 1.5 * np.sin(x / 15.0) * np.cos(y / 20.0)
    return TerrainField(field.mode, field.origin, field.spacing, field.parameters, heights, field.outside)


FIRM = paint_field(ASPHALT, EXTENT, patches=[Patch(SLICK, Disc(8.0, 0.0, 6.0))], outside="extend")
SOFT = paint_field(
    SAND, EXTENT, patches=[Patch(SoilTerrain(c=30e3, phi=0.3, fr=0.1, k=0.02), Rectangle(y_min=0.4))], outside="extend"
)
GROUNDS: dict[str, Ground] = {
    "rigid": ASPHALT,
    "soil": SAND,
    "rigid slope": SlopedGround(ASPHALT, grade=0.2, bank=-0.1),
    "soil slope": SlopedGround(SAND, grade=-0.15, bank=0.1),
    "rigid field": FIRM,
    "soil hills": SlopedGround(hills(SOFT), grade=0.05),
}


def commands(seed: int, ticks: int, hold: int = 40) -> FloatArray:
    """Random belt speeds, held for 0.4 s each."""
    drawn = np.random.default_rng(seed).uniform(-6.0, 9.0, (math.ceil(ticks / hold), 2))
    return np.repeat(drawn, hold, axis=0)[:ticks]


def numbers(state: VehicleState) -> FloatArray:
    return np.array([getattr(state, name) for name in STATE_NAMES])


def side_by_side(
    backend: ForceBackend, ground: Ground, ticks: int, *, seed: int = 0, **options: Any
) -> Iterator[tuple[TickRecord, VehicleFleet]]:
    """Drive a simulator and a fleet of one by the same commands."""
    start = VehicleState.rolling(2.0)
    simulator = Simulator(backend.vehicle, backend, ground, state=start, **options)
    fleet = VehicleFleet(backend.vehicle, backend, ground, 1, state=start, **options)
    for command in commands(seed, ticks):
        record = simulator.step(BeltCommand(*command.tolist()))
        fleet.advance(command[None])
        yield record, fleet


def farthest(backend: ForceBackend, ground: Ground, ticks: int, **options: Any) -> float:
    """Return the largest difference in any number of the state; the records agree as well, or it raises."""
    worst = 0.0
    for record, fleet in side_by_side(backend, ground, ticks, **options):
        assert not fleet.diverged.any()
        worst = max(worst, float(np.abs(fleet.numbers[:, 0] - numbers(record.state)).max()))
        scale = np.maximum(np.abs(record.row), 1.0)
        assert np.all(np.abs(fleet.record.row[0] - record.row) <= 1e-3 * scale)
    assert fleet.numbers[0, 0] != 0.0
    return worst


# The same vehicle in Python


@pytest.mark.parametrize("ground", GROUNDS)
def test_a_thousand_implicit_ticks_on_physics_are_those_of_the_simulator(ground: str) -> None:
    backend = make_backend("physics", mode=GROUNDS[ground].mode, vehicle=M113, **COARSE)
    assert farthest(backend, GROUNDS[ground], 1000) < 1e-9


@pytest.mark.parametrize("vehicle", ["ugv", "maxxii"])
def test_other_vehicles_drive_alike(vehicle: str) -> None:
    kind = TrackedVehicle.preset(vehicle)
    backend = make_backend("physics", mode="rigid", vehicle=kind, **COARSE)
    state, limit = VehicleState(), kind.maximum_speed
    simulator = Simulator(kind, backend, ASPHALT, state=state)
    fleet = VehicleFleet(kind, backend, ASPHALT, 1, state=state)
    for command in np.clip(commands(3, 300), -limit, limit):
        record = simulator.step(BeltCommand(*command.tolist()))
        fleet.advance(command[None])
        np.testing.assert_allclose(fleet.numbers[:, 0], numbers(record.state), rtol=0, atol=1e-9)


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("name", ["physics", "exact"])
def test_every_integrator_takes_the_simulators_ticks(name: str, integrator: Integrator) -> None:
    backend = make_backend(name, mode="rigid", vehicle=M113, **COARSE)
    # Explicit Euler is chaotic near rest.
    ticks, bound = (60, 1e-6) if integrator == "euler" else (300, 1e-9)
    assert farthest(backend, ASPHALT, ticks, integrator=integrator) < bound


@pytest.mark.parametrize("ground", ["soil", "soil slope", "soil hills", "rigid field"])
def test_split_ground_takes_each_track_s_own(ground: str) -> None:
    backend = make_backend("physics", mode=GROUNDS[ground].mode, vehicle=M113, **COARSE)
    sampling: GroundSampling = "tracks"
    assert farthest(backend, GROUNDS[ground], 400, ground_sampling=sampling) < 1e-9


def test_one_track_on_a_slick_strip_turns_the_vehicle() -> None:
    field = paint_field(ASPHALT, EXTENT, spacing=0.25, patches=[Patch(SLICK, Rectangle(y_min=0.0))], outside="extend")
    start = VehicleState.rolling(8.0)
    whole, split = (
        VehicleFleet(M113, "physics", field, 1, ground_sampling=sampling, state=start)
        for sampling in ("vehicle", "tracks")
    )
    for fleet in (whole, split):
        fleet.advance([[0.0, 0.0]], 100)
    # The right track brakes harder.
    assert split.get_state(0).heading < -0.1
    assert abs(whole.get_state(0).heading) < 1e-9


@pytest.mark.parametrize("artifact", ["m113-rigid", "m113-rigid-paper-recipe", "m113-soil"])
@pytest.mark.parametrize("integrator", ["implicit", "sdirk2"])
def test_surrogates_in_float32_agree_to_the_solver_s_tolerance(artifact: str, integrator: Integrator) -> None:
    ground = ASPHALT if "rigid" in artifact else SAND
    surrogate = Surrogate.load(ARTIFACTS / f"{artifact}.safetensors")
    backend = make_backend("native", mode=ground.mode, vehicle=M113, artifact=surrogate)
    # A solver that stops at 1e-6 m/s, and forces that forget a difference.
    assert farthest(backend, ground, 400, integrator=integrator) < 1e-4


def test_the_structured_surrogate_takes_split_ground() -> None:
    backend = make_backend("native", mode="soil", vehicle=M113)
    assert farthest(backend, GROUNDS["soil hills"], 300, ground_sampling="tracks") < 1e-4


# Guard


def guarded(**policy: Any) -> GuardedBackend:
    backend = make_backend(
        "guarded",
        mode="rigid",
        vehicle=M113,
        artifact=Surrogate.load(ARTIFACTS / "m113-rigid-paper.safetensors"),
        policy=SwitchingPolicy(**policy),
        **COARSE,
    )
    assert isinstance(backend, GuardedBackend)
    return backend


# Ground within the training range, with ice outside of it.
PATCHED = paint_field(
    ASPHALT,
    EXTENT,
    spacing=0.5,
    patches=[Patch(RigidTerrain(0.12, 0.02, 0.02), Disc(6.0, 0.0, 3.0))],
    outside="extend",
)


@pytest.mark.parametrize("integrator", ["implicit", "sdirk2"])
@pytest.mark.parametrize(
    "policy", [{}, {"blend_samples": 1, "entry_votes": 1, "entry_window": 1}, {"entry_window": 32, "entry_votes": 5}]
)
def test_the_guard_changes_over_with_the_simulator_s(policy: dict[str, Any], integrator: Integrator) -> None:
    modes, weights = set(), set()
    for record, fleet in side_by_side(guarded(**policy), PATCHED, 800, seed=5, integrator=integrator):
        state = fleet.get_state(0)
        assert state.guard == record.state.guard
        found, expected = fleet.detection(0), record.detection
        assert found is not None
        assert expected is not None
        assert found.reason == expected.reason
        assert found.worst_column == expected.worst_column
        assert found.score == pytest.approx(expected.score, rel=1e-3)
        assert fleet.record.active[0] == (state.guard.fallback_weight > 0.0)
        np.testing.assert_allclose(fleet.numbers[:, 0], numbers(record.state), rtol=0, atol=1e-4)
        modes.add(state.guard.mode)
        weights.add(state.guard.fallback_weight)
    assert modes == set(GuardMode)
    assert {0.0, 1.0} <= weights


def test_a_guard_s_memory_survives_being_read_and_written() -> None:
    fleet = VehicleFleet(M113, guarded(entry_window=32), ASPHALT, 2)
    memory = GuardState(GuardMode.FALLBACK, 0.25, 0.125, (True, False, True, *[False] * 28, True), 0.75)
    state = VehicleState(x=1.0, heading=-2.0, guard=memory)
    fleet.set_state(1, state)
    assert fleet.get_state(1) == state
    assert fleet.get_state(0) == VehicleState()


def test_a_primary_that_fails_hands_the_whole_tick_to_the_fallback() -> None:
    # A network of this vehicle whose weights overflow: every output is infinite.
    surrogate = Surrogate.load(ARTIFACTS / "m113-rigid-paper-recipe.safetensors")
    broken = make_backend("native", mode="rigid", vehicle=M113, artifact=surrogate)
    fallback = PhysicsBackend(M113, "rigid", cells=(2, 1))
    broken._kernel = _overflowing_network()  # type: ignore[attr-defined]
    backend = GuardedBackend(broken, fallback, surrogate.detector)
    for tick, (record, fleet) in enumerate(side_by_side(backend, ASPHALT, 60)):
        detection = fleet.detection(0)
        assert detection is not None
        if tick == 0:
            assert detection == record.detection == Detection(math.inf, "finite", "primary output")
        assert fleet.get_state(0).guard == record.state.guard
        np.testing.assert_allclose(fleet.numbers[:, 0], numbers(record.state), rtol=0, atol=1e-6)


def _overflowing_network() -> Any:
    from grouser.native import Mlp

    return Mlp(
        activation=0,
        widths=(10, 3),
        parameters=np.full(33, 3e38, np.float32).tobytes(),
        input_mean=np.full(10, -1e3),
        input_scale=np.ones(10),
        output_mean=np.zeros(3),
        output_scale=np.ones(3),
    )


# One beside many


def crowd(backend: ForceBackend, ground: Ground, count: int, threads: int, **options: Any) -> VehicleFleet:
    """Drive vehicles that all differ, for 120 ticks in calls of 1, 2, 3 ... ticks."""
    fleet = VehicleFleet(M113, backend, ground, count, threads=threads, **options)
    generator = np.random.default_rng(1)
    for index in range(count):
        x, y, heading, speed, turn = generator.uniform(-1.0, 1.0, 5) * (15.0, 15.0, 3.0, 4.0, 0.3)
        fleet.set_state(index, VehicleState(x, y, heading, vx=speed, yaw_rate=turn, v_left=speed, v_right=speed))
    belts = generator.uniform(-6.0, 9.0, (15, count, 2))
    for ticks in range(1, 16):
        fleet.advance(belts[ticks - 1], ticks)
    return fleet


CROWDS: list[tuple[Callable[[], ForceBackend], Ground, dict[str, Any]]] = [
    (lambda: make_backend("physics", mode="rigid", vehicle=M113, **COARSE), FIRM, {}),
    (lambda: make_backend("physics", mode="soil", vehicle=M113, **COARSE), SOFT, {"ground_sampling": "tracks"}),
    (lambda: make_backend("native", mode="rigid", vehicle=M113), FIRM, {"integrator": "sdirk2"}),
    (guarded, PATCHED, {}),
]


@pytest.mark.parametrize(("make", "ground", "options"), CROWDS, ids=["physics", "split", "native", "guarded"])
def test_a_vehicle_alone_has_the_bits_that_it_has_anywhere_in_a_fleet(
    make: Callable[[], ForceBackend], ground: Ground, options: dict[str, Any]
) -> None:
    backend = make()
    fleet = crowd(backend, ground, 37, 1, **options)
    assert len(np.unique(fleet.numbers[0])) == 37
    for threads in (2, 3):
        other = crowd(backend, ground, 37, threads, **options)
        np.testing.assert_array_equal(other.numbers, fleet.numbers)
        np.testing.assert_array_equal(other.record.row, fleet.record.row)
    generator = np.random.default_rng(1)
    starts = [generator.uniform(-1.0, 1.0, 5) * (15.0, 15.0, 3.0, 4.0, 0.3) for _ in range(37)]
    belts = generator.uniform(-6.0, 9.0, (15, 37, 2))
    for index in (0, 15, 16, 36):
        x, y, heading, speed, turn = starts[index]
        start = VehicleState(x, y, heading, vx=speed, yaw_rate=turn, v_left=speed, v_right=speed)
        alone = VehicleFleet(M113, backend, ground, 1, state=start, **options)
        for ticks in range(1, 16):
            alone.advance(belts[ticks - 1, index : index + 1], ticks)
        np.testing.assert_array_equal(alone.numbers[:, 0], fleet.numbers[:, index])
        assert alone.get_state(0).guard == fleet.get_state(index).guard


def test_ten_ticks_at_once_are_ten_single_ticks_to_the_bit() -> None:
    fleets = [VehicleFleet(M113, "physics", FIRM, 20, state=VehicleState.rolling(3.0)) for _ in range(2)]
    belts = np.random.default_rng(2).uniform(0.0, 8.0, (20, 2))
    fleets[0].advance(belts, 10)
    for _ in range(10):
        fleets[1].advance(belts)
    np.testing.assert_array_equal(fleets[0].numbers, fleets[1].numbers)
    for first, second in zip(fleets[0].record, fleets[1].record, strict=True):
        np.testing.assert_array_equal(first, second)


def test_each_vehicle_drives_on_its_own_ground() -> None:
    grounds: list[Ground] = [ASPHALT, SLICK, SlopedGround(ASPHALT, grade=0.3), FIRM]
    fleet = VehicleFleet(M113, "physics", grounds, 4, state=VehicleState.rolling(5.0, y=0.5))
    fleet.advance(np.zeros((4, 2)), 150)
    for index, ground in enumerate(grounds):
        assert fleet.ground(index) is ground
        simulator = Simulator(M113, "physics", ground, state=VehicleState.rolling(5.0, y=0.5))
        for _ in range(150):
            state = simulator.step(BeltCommand(0.0, 0.0)).state
        np.testing.assert_allclose(fleet.numbers[:, index], numbers(state), rtol=0, atol=1e-9)


# Belts and yaw inertia of one's own


def various(count: int, seed: int = 3) -> list[TrackedVehicle]:
    """Vehicles on one block whose yaw inertia and belts all differ."""
    drawn = np.random.default_rng(seed).uniform(0.5, 2.0, (count, 3)).tolist()
    return [
        replace(
            M113,
            yaw_inertia=M113.yaw_inertia * inertia,
            belt_time_constant=M113.belt_time_constant * lag,
            belt_acceleration=M113.belt_acceleration * acceleration,
        )
        for inertia, lag, acceleration in drawn
    ]


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_vehicle_with_its_own_belts_and_yaw_inertia_is_that_of_the_simulator(integrator: Integrator) -> None:
    backend = make_backend("physics", mode="rigid", vehicle=M113, **COARSE)
    vehicles, start = various(3), VehicleState.rolling(3.0)
    fleet = VehicleFleet(M113, backend, FIRM, 3, integrator=integrator, state=start)
    simulators = [Simulator(each, backend, FIRM, integrator=integrator, state=start) for each in vehicles]
    for index, each in enumerate(vehicles):
        fleet.set_vehicle(index, each)
    for command in commands(4, 300 if integrator != "euler" else 100):
        fleet.advance(np.tile(command, (3, 1)))
        states = [simulator.step(BeltCommand(*command.tolist())).state for simulator in simulators]
    np.testing.assert_allclose(fleet.numbers.T, [numbers(state) for state in states], rtol=0, atol=1e-9)
    assert len(np.unique(fleet.numbers[0])) == 3


def test_whoever_stands_beside_it_a_vehicle_of_its_own_kind_has_the_same_bits() -> None:
    backend = make_backend("native", mode="rigid", vehicle=M113)
    vehicles, belts = various(37), np.random.default_rng(5).uniform(-4.0, 8.0, (20, 37, 2))
    fleets = [VehicleFleet(M113, backend, FIRM, 37, threads=threads) for threads in (1, 2)]
    for fleet in fleets:
        for index, each in enumerate(vehicles):
            fleet.set_vehicle(index, each)
        for command in belts:
            fleet.advance(command, 10)
    np.testing.assert_array_equal(fleets[0].numbers, fleets[1].numbers)
    for index in (0, 15, 36):
        alone = VehicleFleet(vehicles[index], backend, FIRM, 1)
        for command in belts:
            alone.advance(command[index : index + 1], 10)
        np.testing.assert_array_equal(alone.numbers[:, 0], fleets[0].numbers[:, index])


def test_a_vehicle_set_back_to_the_fleet_s_leaves_no_trace() -> None:
    fleets = [VehicleFleet(M113, "physics", ASPHALT, 2, state=VehicleState.rolling(3.0)) for _ in range(2)]
    fleets[0].set_vehicle(1, various(1)[0])
    fleets[0].set_vehicle(1, M113)
    for fleet in fleets:
        fleet.advance(np.array([[4.0, 1.0], [1.0, 4.0]]), 50)
    np.testing.assert_array_equal(fleets[0].numbers, fleets[1].numbers)


def test_a_pickled_fleet_keeps_the_vehicles_that_were_set() -> None:
    fleet = VehicleFleet(M113, "physics", ASPHALT, 2)
    fleet.set_vehicle(1, various(1)[0])
    copied = pickle.loads(pickle.dumps(fleet))
    assert copied.get_vehicle(1) == fleet.get_vehicle(1) != copied.get_vehicle(0)
    for each in (fleet, copied):
        each.advance(np.full((2, 2), 6.0), 30)
    np.testing.assert_array_equal(fleet.numbers, copied.numbers)
    assert fleet.numbers[0, 0] != fleet.numbers[0, 1]


def test_ground_that_nobody_drives_on_any_more_is_let_go() -> None:
    fleet = VehicleFleet(M113, "physics", ASPHALT, 2)
    for index in (0, 1):
        fleet.set_ground(index, TerrainField.uniform(ASPHALT, (-5.0, 5.0, -5.0, 5.0)))
    former = weakref.ref(fleet.ground(0))
    fleet.set_ground(0, TerrainField.uniform(SLICK, (-5.0, 5.0, -5.0, 5.0)))
    gc.collect()
    assert former() is None
    assert len(fleet._fields) == 2
    fleet.advance(np.full((2, 2), 4.0), 5)
    assert fleet.record.row[:, 7].tolist() == [SLICK.parameters[0], ASPHALT.parameters[0]]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="only where processes fork")
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_forked_process_goes_on_without_the_threads_that_it_lost() -> None:
    fleet = VehicleFleet(M113, "physics", ASPHALT, 40, threads=2)
    fleet.advance(np.full((40, 2), 4.0), 2)
    child = os.fork()
    fleet.advance(np.full((40, 2), 4.0), 2)
    if child == 0:
        expected = VehicleFleet(M113, "physics", ASPHALT, 40)
        expected.advance(np.full((40, 2), 4.0), 4)
        alike = np.array_equal(expected.numbers, fleet.numbers)
        del fleet
        os._exit(0 if alike else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


# Vehicles that are lost


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("where", STATE_NAMES)
def test_a_number_that_is_not_finite_loses_its_vehicle_alone(where: str, value: float) -> None:
    fleet = VehicleFleet(M113, make_backend("physics", mode="rigid", vehicle=M113, **COARSE), ASPHALT, 40)
    other = VehicleFleet(M113, fleet.backend, ASPHALT, 40)
    fleet.numbers[STATE_NAMES.index(where), 17] = value
    before = fleet.numbers[:, 17].copy()
    for each in (fleet, other):
        each.advance(np.full((40, 2), 3.0), 5)
    assert np.flatnonzero(fleet.diverged).tolist() == [17]
    np.testing.assert_array_equal(fleet.numbers[:, 17], before)
    kept = np.arange(40) != 17
    np.testing.assert_array_equal(fleet.numbers[:, kept], other.numbers[:, kept])


def test_a_command_that_is_not_finite_loses_one_of_a_thousand() -> None:
    backend = make_backend("physics", mode="rigid", vehicle=M113, **COARSE)
    fleet = VehicleFleet(M113, backend, ASPHALT, 1000, threads=2)
    belts = np.full((1000, 2), 4.0)
    belts[603, 1] = np.nan
    fleet.advance(belts, 3)
    assert np.flatnonzero(fleet.diverged).tolist() == [603]
    np.testing.assert_array_equal(fleet.numbers[:, 603], 0.0)
    assert (fleet.numbers[0, np.arange(1000) != 603] > 0.0).all()


def test_a_vehicle_that_leaves_the_map_stops_at_its_edge_until_it_is_set_again() -> None:
    field = TerrainField.uniform(ASPHALT, (-5.0, 5.0, -5.0, 5.0))
    fleet = VehicleFleet(M113, "physics", field, 3)
    fleet.set_state(1, VehicleState.rolling(4.0, x=4.9))
    fleet.advance(np.full((3, 2), 4.0), 20)
    assert fleet.off_map.tolist() == [False, True, False]
    assert not fleet.diverged.any()
    lost = fleet.get_state(1)
    assert 5.0 < lost.x < 5.05
    fleet.advance(np.full((3, 2), 4.0), 1)
    assert fleet.get_state(1) == lost
    assert fleet.get_state(0).time == pytest.approx(0.21)
    fleet.set_state(1, VehicleState())
    fleet.advance(np.full((3, 2), 4.0), 1)
    assert not fleet.off_map.any()


def test_a_tick_that_is_not_solved_loses_the_vehicle_where_the_simulator_gives_up() -> None:
    # With a bound of zero on its speed a stopped belt is outside the physics' domain.
    backend = PhysicsBackend(M113, "rigid", cells=(2, 1), soft_speed=0.0)
    fleet = VehicleFleet(M113, backend, ASPHALT, 2, state=VehicleState.rolling(2.0))
    fleet.set_state(1, VehicleState())
    fleet.advance(np.array([[2.0, 2.0], [0.0, 0.0]]), 4)
    assert fleet.diverged.tolist() == [False, True]
    assert fleet.get_state(1) == VehicleState()
    assert fleet.get_state(0).time == pytest.approx(0.04)


def test_hard_grip_takes_damping_the_second_guess_and_halved_ticks_as_the_simulator_does() -> None:
    ground = RigidTerrain(mu=1.0, fr=0.05, k=0.001)
    divided = np.zeros(2, int)
    for record, fleet in side_by_side(PhysicsBackend(M113, "rigid", cells=(2, 1)), ground, 600, seed=8):
        divided += record.divisions > 1, int(fleet.record.divisions[0]) > 1
        np.testing.assert_allclose(fleet.numbers[:, 0], numbers(record.state), rtol=0, atol=1e-7)
    assert divided.min() >= 10


# Physics of the whole


@pytest.mark.parametrize("name", ["physics", "native"])
def test_a_steady_drive_and_a_vehicle_at_rest_cost_no_step(name: str) -> None:
    fleet = VehicleFleet(M113, name, ASPHALT, 2, state=VehicleState.rolling(4.0))
    belts = np.array([[4.0, 4.4], [0.0, 0.0]])
    fleet.advance(belts, 1500)
    before = fleet.numbers[3:10].copy()
    fleet.advance(belts)
    assert fleet.record.iterations.tolist() == [0.0, 0.0]
    np.testing.assert_allclose(fleet.numbers[3:10], before, rtol=0, atol=1e-12)


def test_a_braked_vehicle_comes_to_rest_without_chatter() -> None:
    fleet = VehicleFleet(M113, "physics", [ASPHALT, SLICK], 2, state=VehicleState.rolling(5.0))
    speeds = []
    for _ in range(60):
        fleet.advance(np.zeros((2, 2)), 20)
        speeds.append(fleet.numbers[3].copy())
    assert all((after <= before + 1e-12).all() for before, after in pairwise(speeds))
    assert np.abs(speeds[-1]).max() < 1e-6
