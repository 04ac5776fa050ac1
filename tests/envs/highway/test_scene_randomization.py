"""Ground and vehicle of a scene's episodes: drawn as the other tasks draw them, after start and course."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from gymnasium.utils.seeding import np_random

from grouser.envs import OffRoadEnv, ParkingEnv, Randomization
from grouser.envs.highway.course import draw_course
from grouser.envs.highway.parking_lot import draw_parking, spot_network
from grouser.envs.surroundings import Randomizer, drawn_names
from grouser.terrain import ConfigurationError, Disc, Patch, TerrainField, named, paint_field

MakeParking = Callable[..., ParkingEnv]
MakeOffRoad = Callable[..., OffRoadEnv]

EVERYTHING = Randomization(
    terrain="wide", belt_time_constant=(0.5, 2.0), belt_acceleration=(0.8, 1.25), yaw_inertia=(0.8, 1.25)
)


def draws(env: Any, count: int) -> list[dict[str, float]]:
    return [env.reset(seed=seed)[1]["randomization"] for seed in range(count)]


class TestDraws:
    def test_come_after_parking_v0s(self, make_parking: MakeParking) -> None:
        """Against the tasks' randomizer, behind the lot's draws by hand."""
        env = make_parking("physics", randomize=EVERYTHING, parked_vehicles=2)
        info = env.reset(seed=5)[1]
        generator, _ = np_random(5)
        draw_parking(generator, spot_network(), parked=2, spread=0.0)
        expected = Randomizer(EVERYTHING, named("asphalt"), env.vehicle, lambda ground: ground).draw(generator)
        assert env.ground.parameters_at(0.0, 0.0).tolist() == expected.ground.parameters_at(0.0, 0.0).tolist()
        assert env.highway_vehicle.model.vehicle == expected.vehicle != env.vehicle
        assert info["randomization"] == {
            **dict(zip(("mu", "fr", "k"), expected.ground.parameters_at(0.0, 0.0).tolist(), strict=True)),
            **{name: getattr(expected.vehicle, name) for name in drawn_names("rigid")[3:]},
        }

    def test_come_after_course_and_start(self, make_offroad: MakeOffRoad) -> None:
        env = make_offroad("physics", randomize=EVERYTHING, patches=3)
        info = env.reset(seed=5)[1]
        generator, _ = np_random(5)
        draw_course(generator, env.config, (named("lete-sand"),))
        generator.uniform(-1.0, 1.0, 3)
        loam = named("grenville-loam")
        ground, vehicle = Randomizer(EVERYTHING, loam, env.vehicle, lambda ground: ground).draw(generator)
        numbers = [*ground.parameters_at(0.0, 0.0).tolist(), *(getattr(vehicle, n) for n in drawn_names("soil")[4:])]
        assert info["randomization"] == dict(zip(drawn_names("soil"), numbers, strict=True))
        assert env.highway_vehicle.model.vehicle == vehicle

    @pytest.mark.parametrize("name", ["make_parking", "make_offroad"])
    def test_nothing_randomized_changes_neither_start_nor_course(
        self, request: pytest.FixtureRequest, name: str
    ) -> None:
        make = request.getfixturevalue(name)
        plain, drawn = make("physics"), make("physics", randomize=EVERYTHING)
        for seed in range(3):
            _, info = plain.reset(seed=seed)
            assert "randomization" not in info
            drawn.reset(seed=seed)
            assert plain.highway_vehicle.state == drawn.highway_vehicle.state
            places = [[each.position.tolist() for each in env.road.objects] for env in (plain, drawn)]
            assert places[0] == places[1]

    def test_one_of_several_grounds(self, make_parking: MakeParking) -> None:
        seen = {each["mu"] for each in draws(make_parking("physics", randomize={"terrain": ("ice", "gravel")}), 12)}
        assert seen == {named("ice").parameters[0], named("gravel").parameters[0]}

    def test_the_ground_beside_the_patches(self, make_offroad: MakeOffRoad) -> None:
        """It is told as drawn, also where the vehicle starts on a patch."""
        randomize = {"terrain": ("lete-sand", "snow-sweden")}
        env = make_offroad("physics", randomize=randomize, patches=60, patch_terrains=("clayey-soil-55",))
        cohesions = {named(name).parameters[0] for name in randomize["terrain"]}
        assert {each["c"] for each in draws(env, 8)} == cohesions
        assert isinstance(env.ground, TerrainField)
        assert named("clayey-soil-55").parameters[0] in env.ground.parameters[..., 0]

    def test_factors_scale_a_field(self, make_parking: MakeParking) -> None:
        field = paint_field(named("asphalt"), (-40, 40, -25, 25), patches=[Patch(named("ice"), Disc(10.0, 0.0, 5.0))])
        env = make_parking("physics", terrain=field, randomize={"terrain": {"mu": (0.5, 0.5)}})
        env.reset(seed=0)
        for x in (0.0, 10.0):
            assert env.ground.parameters_at(x, 0.0)[0] == pytest.approx(0.5 * field.parameters_at(x, 0.0)[0])

    def test_the_reset_option_has_the_last_word_on_the_ground_alone(self, make_parking: MakeParking) -> None:
        env = make_parking("physics", randomize=EVERYTHING)
        drawn = env.reset(seed=1)[1]["randomization"]
        given = env.reset(seed=1, options={"terrain": "ice"})[1]["randomization"]
        assert given == drawn | dict(zip(("mu", "fr", "k"), named("ice").parameters.tolist(), strict=True))


@pytest.mark.parametrize("engine", ["compiled", "python"])
def test_an_episode_is_that_of_such_a_vehicle(make_parking: MakeParking, engine: str) -> None:
    factors = {"belt_time_constant": (2.0, 2.0), "yaw_inertia": (0.8, 0.8)}
    drawn = make_parking("physics", randomize=factors, engine=engine)
    machine = drawn.vehicle
    slow = replace(machine, belt_time_constant=2 * machine.belt_time_constant, yaw_inertia=0.8 * machine.yaw_inertia)
    made = make_parking("physics", vehicle=slow, engine=engine)
    for env in (drawn, made):
        env.reset(seed=3)
        for _ in range(4):
            env.step(np.array([0.2, 0.9], np.float32))
    ours, theirs = (np.array(env.highway_vehicle.kinematics()) for env in (drawn, made))
    assert ours == pytest.approx(theirs, abs=1e-9)


@pytest.mark.parametrize(
    ("randomize", "message"),
    [
        ({"terrains": ("ice",)}, "did you mean 'terrain'"),
        ({"terrain": "broad"}, "known: paper, wide"),
        ({"terrain": ("ice", "lete-sand")}, "rigid ground, and one to be drawn is soil"),
    ],
)
def test_what_does_not_fit_is_named(make_parking: MakeParking, randomize: Any, message: str) -> None:
    with pytest.raises(ConfigurationError, match=message):
        make_parking("physics", randomize=randomize)


def test_patches_need_a_ground_that_is_alike_everywhere(make_offroad: MakeOffRoad) -> None:
    field = TerrainField.uniform(named("lete-sand"), (-9.0, 9.0, -9.0, 9.0))
    with pytest.raises(ConfigurationError, match="alike everywhere"):
        make_offroad("physics", randomize={"terrain": ("lete-sand", field)})
