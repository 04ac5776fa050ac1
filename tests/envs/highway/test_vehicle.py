"""A vehicle of highway-env that moves as the simulator says, whatever its host does to it."""

from __future__ import annotations

import copy
import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from highway_env.vehicle.kinematics import Vehicle
from highway_env.vehicle.objects import Obstacle

from grouser.envs import BeltCommand, Simulator, VehicleState
from grouser.envs.highway import MotionModel, TrackedHighwayVehicle, tracked_vehicle_class
from grouser.terrain import (
    ConfigurationError,
    Disc,
    InvalidInputError,
    Mode,
    Patch,
    TerrainField,
    TrackedVehicle,
    make_backend,
    named,
    paint_field,
)

Options = Callable[[str, Mode], dict[str, Any]]

WEAVE = [(5.0, 5.0), (3.0, 6.0), (6.0, 2.0), (-1.0, 3.0), (0.0, 0.0)]
PATCHY: TerrainField = paint_field(
    named("asphalt"),
    (-10.0, 40.0, -20.0, 20.0),
    patches=[Patch(named("ice"), Disc(6.0, 1.5, 4.0))],
    outside="extend",
)


def weave(vehicle: TrackedHighwayVehicle, dt: float = 0.1) -> list[VehicleState]:
    """Drive through turns both ways, reverse and a stop, and return the states along the way."""
    states = []
    for left, right in WEAVE:
        vehicle.act(BeltCommand(left, right))
        for _ in range(5):
            vehicle.step(dt)
            states.append(vehicle.state)
    return states


def simulated(simulator: Simulator, ticks: int = 10) -> list[VehicleState]:
    """The same drive of a bare simulator."""
    states = []
    for left, right in WEAVE:
        for _ in range(5):
            for _ in range(ticks):
                simulator.step(BeltCommand(left, right))
            states.append(simulator.get_state())
    return states


class TestMotion:
    @pytest.mark.parametrize("backend", ["physics", "native", "guarded", "torch"])
    def test_is_the_simulators_to_the_bit(self, backend_options: Options, road: Any, backend: str) -> None:
        options = backend_options(backend, "rigid")
        kind = tracked_vehicle_class(backend, backend_options=options, engine="python")
        start = VehicleState.rolling(4.0, y=1.0, heading=0.2)
        simulator = Simulator(
            "m113", make_backend(backend, mode="rigid", vehicle="m113", **options), "asphalt", state=start
        )
        assert weave(kind(road, [0.0, 1.0], 0.2, 4.0)) == simulated(simulator)

    @pytest.mark.parametrize("sampling", ["vehicle", "tracks"])
    def test_on_patches_is_the_simulators(self, road: Any, sampling: Any) -> None:
        kind = tracked_vehicle_class("physics", terrain=PATCHY, ground_sampling=sampling, engine="python")
        start = VehicleState.rolling(4.0)
        simulator = Simulator("m113", "physics", PATCHY, ground_sampling=sampling, state=start)
        assert weave(kind(road, [0.0, 0.0], 0.0, 4.0)) == simulated(simulator)

    @pytest.mark.parametrize("backend", ["physics", "native"])
    def test_of_the_compiled_engine_is_that_to_rounding(
        self, backend_options: Options, road: Any, backend: str
    ) -> None:
        options = backend_options(backend, "rigid")
        drives = [
            weave(tracked_vehicle_class(backend, backend_options=options, engine=engine)(road, [0.0, 0.0], 0.0, 4.0))
            for engine in ("compiled", "python")
        ]
        for one, other in zip(*drives, strict=True):
            assert (one.x, one.y, one.heading) == pytest.approx((other.x, other.y, other.heading), abs=1e-5)

    def test_a_step_that_the_tick_does_not_divide_is_taken_in_equal_ticks(self, road: Any) -> None:
        vehicle = tracked_vehicle_class("physics", engine="python")(road, [0.0, 0.0], 0.0, 4.0)
        simulator = Simulator("m113", "physics", "asphalt", tick=1 / 15 / 7, state=VehicleState.rolling(4.0))
        assert weave(vehicle, 1 / 15) == simulated(simulator, 7)
        assert vehicle.state.time == pytest.approx(25 / 15)

    def test_velocity_has_the_side_slip(self, road: Any) -> None:
        vehicle = tracked_vehicle_class("physics", terrain="ice")(road, [0.0, 0.0], 0.0, 8.0)
        vehicle.act(BeltCommand(4.0, 9.0))
        for _ in range(20):
            vehicle.step(0.05)
        before = vehicle.position.copy()
        vehicle.step(1e-3)
        assert (vehicle.position - before) / 1e-3 == pytest.approx(vehicle.velocity, abs=0.02)
        assert abs(vehicle.side_slip) > 0.05
        course = math.atan2(vehicle.velocity[1], vehicle.velocity[0])
        assert math.remainder(course - vehicle.heading - vehicle.side_slip, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)

    def test_a_guard_remembers_from_step_to_step(self, backend_options: Options, road: Any) -> None:
        kind = tracked_vehicle_class("guarded", backend_options=backend_options("guarded", "rigid"))
        vehicle = kind(road, [0.0, 0.0], 0.0, 4.0)
        weave(vehicle)
        assert vehicle.state.guard != VehicleState().guard
        assert copy.deepcopy(vehicle).state.guard == vehicle.state.guard

    def test_leaves_no_trace_of_speeds_beyond_the_drive(self, road: Any) -> None:
        vehicle = TrackedHighwayVehicle(road, [0.0, 0.0], 0.0, 25.0)
        assert vehicle.speed == vehicle.state.v_left == TrackedVehicle.preset("m113").maximum_speed


class TestCommands:
    def test_none_holds_the_last(self, road: Any) -> None:
        asked, held = (TrackedHighwayVehicle(road, [0.0, 0.0], 0.0, 3.0) for _ in range(2))
        for each in (asked, held):
            each.act(BeltCommand(2.0, 4.0))
        for _ in range(4):
            asked.act(BeltCommand(2.0, 4.0))
            held.act(None)
            asked.step(0.05)
            held.step(0.05)
        assert asked.state == held.state

    def test_an_acceleration_is_that_of_the_belts(self, road: Any) -> None:
        vehicle = TrackedHighwayVehicle(road, [0.0, 0.0], 0.0, 5.0)
        for step in range(1, 11):
            vehicle.act({"acceleration": 1.5, "steering": 0.0})
            vehicle.step(0.1)
            assert vehicle.state.v_left == pytest.approx(5.0 + 0.15 * step, abs=1e-9)

    def test_steering_commands_the_bicycles_yaw_rate(self, road: Any) -> None:
        vehicle = TrackedHighwayVehicle(road, [0.0, 0.0], 0.0, 5.0)
        reference = Vehicle(road, [0.0, 0.0], 0.0, 5.0)
        reference.LENGTH = vehicle.LENGTH
        for each in (vehicle, reference):
            each.act({"acceleration": 0.0, "steering": 0.2})
        reference.step(0.1)
        for _ in range(20):
            vehicle.step(0.1)
        belts = vehicle.state.v_right - vehicle.state.v_left
        mean = (vehicle.state.v_right + vehicle.state.v_left) / 2
        rolling = belts / TrackedVehicle.preset("m113").tread
        # A bicycle that rolls at the belts' mean speed; the vehicle slips, and turns more slowly.
        assert rolling == pytest.approx(reference.heading / 0.1 * mean / 5.0, rel=1e-3)
        assert 0.0 < vehicle.state.yaw_rate < rolling

    def test_speed_limits_of_the_host_hold(self, road: Any) -> None:
        vehicle = TrackedHighwayVehicle(road, [0.0, 0.0], 0.0, 5.0)
        vehicle.MIN_SPEED, vehicle.MAX_SPEED = 0.0, 6.0
        for _ in range(60):
            vehicle.act({"acceleration": 5.0, "steering": 0.0})
            vehicle.step(0.1)
        assert vehicle.state.v_left == pytest.approx(6.0, abs=0.05)

    @pytest.mark.parametrize(
        "action",
        ["FASTER", {"acceleration": 1.0}, {"acceleration": math.nan, "steering": 0.0}, BeltCommand(math.inf, 0.0), 3],
    )
    def test_what_is_no_command_is_refused(self, road: Any, action: Any) -> None:
        with pytest.raises(InvalidInputError, match=r"command|takes"):
            TrackedHighwayVehicle(road, [0.0, 0.0]).act(action)

    def test_belts_out_of_reach_are_refused(self, road: Any) -> None:
        vehicle = TrackedHighwayVehicle(road, [0.0, 0.0])
        vehicle.act(BeltCommand(30.0, 0.0))
        with pytest.raises(InvalidInputError, match="belt command"):
            vehicle.step(0.1)

    def test_the_hosts_dict_is_not_changed(self, road: Any) -> None:
        vehicle, action = TrackedHighwayVehicle(road, [0.0, 0.0], 0.0, 3.0), {"acceleration": 1.0, "steering": 0.1}
        vehicle.act(action)
        vehicle.crashed = True
        vehicle.step(0.1)
        assert action == {"acceleration": 1.0, "steering": 0.1}


class TestCollisions:
    def test_a_crash_is_an_impact_and_then_braking(self, road: Any) -> None:
        vehicle = TrackedHighwayVehicle(road, [0.0, 0.0], 0.0, 3.0)
        road.vehicles.append(vehicle)
        road.objects.append(Obstacle(road, [6.0, 0.3]))
        vehicle.act(BeltCommand(3.0, 3.0))
        belts = []
        for _ in range(60):
            road.act()
            road.step(0.05)
            belts += [vehicle.state.v_left] if vehicle.crashed else []
        # As highway-env has it: dv/dt = −v/s, in steps of 50 ms.
        assert belts[20] == pytest.approx(belts[0] * 0.95**20, rel=0.02)
        assert vehicle.position == pytest.approx([vehicle.state.x, vehicle.state.y])

    def test_an_impact_moves_the_vehicle_once(self, road: Any) -> None:
        struck, free = (TrackedHighwayVehicle(road, [0.0, 0.0], 0.0, 3.0) for _ in range(2))
        struck.impact = np.array([-0.5, 0.25])
        for each in (struck, free):
            each.step(0.1)
        assert struck.position - free.position == pytest.approx([-0.5, 0.25], abs=1e-12)
        assert struck.crashed
        assert struck.impact is None

    def test_two_tracked_vehicles_crash_into_one_another(self, road: Any) -> None:
        one = TrackedHighwayVehicle(road, [0.0, 0.0], 0.0, 6.0)
        other = TrackedHighwayVehicle(road, [9.0, 0.0], math.pi, 6.0)
        road.vehicles += [one, other]
        for each in (one, other):
            each.act(BeltCommand(6.0, 6.0))
        for _ in range(20):
            road.act()
            road.step(0.05)
        assert one.crashed
        assert other.crashed


class TestHost:
    def test_constructor_and_partial(self, road: Any) -> None:
        marder = TrackedVehicle.preset("marder")
        model = MotionModel(marder, make_backend("physics", mode="rigid", vehicle=marder), named("gravel"))
        vehicle = functools.partial(TrackedHighwayVehicle, model=model)(road, [1.0, 2.0], 0.5, 3.0)
        assert (vehicle.LENGTH, vehicle.WIDTH) == (6.79, 3.24)
        assert vehicle.state == VehicleState.rolling(3.0, x=1.0, y=2.0, heading=0.5)

    def test_the_m113_has_its_real_size(self) -> None:
        assert (TrackedHighwayVehicle.LENGTH, TrackedHighwayVehicle.WIDTH) == (4.86, 2.69)

    def test_a_vehicle_of_unknown_size_covers_its_tracks(self) -> None:
        kind, ugv = tracked_vehicle_class("physics", "ugv"), TrackedVehicle.preset("ugv")
        assert (ugv.contact_length, ugv.overall_width) == (kind.LENGTH, kind.WIDTH)

    def test_a_size_can_be_given(self, road: Any) -> None:
        vehicle = tracked_vehicle_class("physics", size=(3.0, 2.0))(road, [0.0, 0.0])
        assert np.ptp(vehicle.polygon(), axis=0).tolist() == [3.0, 2.0]

    def test_a_copy_goes_its_own_way_to_the_same_place(self, road: Any) -> None:
        vehicle = TrackedHighwayVehicle(road, [0.0, 0.0], 0.0, 4.0)
        road.vehicles.append(vehicle)
        weave(vehicle)
        twin = copy.deepcopy(road).vehicles[0]
        before = vehicle.state
        ahead = weave(twin)
        assert vehicle.state == before
        assert weave(vehicle) == ahead
        assert twin.model.backend is vehicle.model.backend

    def test_create_from_takes_the_state_and_the_model(self, road: Any) -> None:
        vehicle = tracked_vehicle_class("physics", "marder", "ice")(road, [0.0, 0.0], 0.0, 4.0)
        weave(vehicle)
        vehicle.color = (1, 2, 3)
        made = TrackedHighwayVehicle.create_from(vehicle)
        assert (made.state, made.model, made.color, made.LENGTH) == (
            vehicle.state,
            vehicle.model,
            vehicle.color,
            vehicle.LENGTH,
        )

    def test_create_from_another_kind_rolls_on(self, road: Any) -> None:
        made = TrackedHighwayVehicle.create_from(Vehicle(road, [1.0, 2.0], 0.3, 5.0))
        assert made.state == VehicleState.rolling(5.0, x=1.0, y=2.0, heading=0.3)

    def test_prediction_is_what_comes_of_holding_the_command(self, road: Any) -> None:
        vehicle = TrackedHighwayVehicle(road, [0.0, 0.0], 0.0, 4.0)
        weave(vehicle)
        vehicle.act(BeltCommand(2.0, 4.0))
        before = vehicle.state
        positions, headings = vehicle.predict_trajectory_constant_speed(np.array([0.0, 0.5, 1.0]))
        assert vehicle.state == before
        for position, heading in zip(positions, headings, strict=True):
            assert position == pytest.approx(vehicle.position, abs=1e-9)
            assert heading == pytest.approx(vehicle.heading, abs=1e-9)
            for _ in range(5):
                vehicle.step(0.1)

    def test_prediction_without_steering_settles_straight(self, road: Any) -> None:
        vehicle = TrackedHighwayVehicle(road, [0.0, 0.0], 0.0, 4.0, "zero_steering")
        vehicle.act(BeltCommand(3.0, 5.0))
        for _ in range(10):
            vehicle.step(0.1)
        _, headings = vehicle.predict_trajectory_constant_speed([3.0, 4.0])
        assert headings[1] == pytest.approx(headings[0], abs=1e-3)

    def test_who_writes_the_pose_moves_the_vehicle(self, road: Any) -> None:
        vehicle = TrackedHighwayVehicle(road, [0.0, 0.0], 0.0, 4.0)
        weave(vehicle)
        slip = vehicle.state.v_left - vehicle.state.vx
        vehicle.position += [10.0, -1.0]
        vehicle.heading = 1.0
        vehicle.speed = 2.0
        state = vehicle.state
        assert (state.x, state.y, state.heading, state.vx) == (*vehicle.position, 1.0, 2.0)
        assert state.v_left - state.vx == pytest.approx(slip)

    def test_the_lane_is_the_closest_one(self, road: Any) -> None:
        vehicle = TrackedHighwayVehicle(road, [0.0, 0.0], 0.2, 8.0)
        assert vehicle.lane_index == ("0", "1", 0)
        for _ in range(20):
            vehicle.step(0.1)
        assert vehicle.lane_index == road.network.get_closest_lane_index(vehicle.position, vehicle.heading)
        assert vehicle.lane_index == ("0", "1", 1)
        assert vehicle.lane is road.network.get_lane(vehicle.lane_index)
        assert vehicle.on_road

    def test_history_is_kept_where_the_road_asks_for_it(self, road: Any) -> None:
        road.record_history = True
        vehicle = TrackedHighwayVehicle(road, [0.0, 0.0], 0.0, 4.0)
        states = weave(vehicle)
        assert [past.state for past in vehicle.history] == states[::-1]

    def test_to_dict_tells_the_motion(self, road: Any) -> None:
        vehicle = TrackedHighwayVehicle(road, [0.0, 0.0], 0.3, 4.0)
        weave(vehicle)
        told = vehicle.to_dict(Vehicle(road, [1.0, 0.0], 0.0, 2.0))
        assert (told["vx"], told["vy"]) == pytest.approx(tuple(vehicle.velocity - [2.0, 0.0]))
        assert told["yaw_rate"] == vehicle.state.yaw_rate
        assert told["v_left"] == vehicle.state.v_left

    def test_a_road_is_not_needed(self) -> None:
        vehicle = TrackedHighwayVehicle(None, [0.0, 0.0], 0.0, 4.0)
        weave(vehicle)
        assert vehicle.lane_index is None

    def test_ground_of_another_mode_is_refused(self, road: Any) -> None:
        with pytest.raises(ConfigurationError, match="rigid"):
            TrackedHighwayVehicle(road, [0.0, 0.0]).set_ground(named("lete-sand"))

    def test_an_unknown_engine_is_refused(self) -> None:
        with pytest.raises(ConfigurationError, match="compiled"):
            tracked_vehicle_class("physics", engine="compile")  # type: ignore[arg-type]
