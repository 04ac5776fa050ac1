"""Terrain parameters: validity, order, ranges and drawing from them."""

import math
from dataclasses import FrozenInstanceError
from typing import Any

import numpy as np
import pytest

from grouser.terrain import (
    MODES,
    RANGE_NAMES,
    ConfigurationError,
    InvalidInputError,
    Mode,
    ParameterRanges,
    RigidTerrain,
    SoilTerrain,
    named,
    parameter_ranges,
    terrain_from_mapping,
    terrain_names,
)
from grouser.terrain.parameters import require_whole


def test_parameters_stand_in_interface_order() -> None:
    np.testing.assert_array_equal(RigidTerrain(mu=0.7, fr=0.02, k=0.05).parameters, [0.7, 0.02, 0.05])
    np.testing.assert_array_equal(SoilTerrain(c=1e3, phi=0.5, fr=0.1, k=0.02).parameters, [1e3, 0.5, 0.1, 0.02])


def test_a_terrain_is_the_same_everywhere() -> None:
    ground = SoilTerrain(c=1e3, phi=0.5)
    np.testing.assert_array_equal(ground.parameters_at(-3.0, 1e6), ground.parameters)


def test_a_terrain_is_frozen() -> None:
    with pytest.raises(FrozenInstanceError):
        RigidTerrain(0.7).mu = 0.8  # type: ignore[misc]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("mu", 0.0),
        ("mu", -0.1),
        ("mu", 2.1),
        ("mu", math.nan),
        ("mu", math.inf),
        ("fr", -0.01),
        ("fr", 1.1),
        ("k", 0.0),
        ("k", -0.01),
        ("k", 1.5),
    ],
)
def test_impossible_firm_ground_is_refused_by_name_and_value(name: str, value: float) -> None:
    with pytest.raises(InvalidInputError, match=rf"^{name} must lie in .*, got {value}"):
        RigidTerrain(**{"mu": 0.7, name: value})


@pytest.mark.parametrize(
    ("name", "value"),
    [("c", -1.0), ("c", 6e5), ("phi", -0.1), ("phi", 1.3), ("phi", math.nan), ("fr", -0.01), ("k", 0.0)],
)
def test_impossible_soil_is_refused_by_name_and_value(name: str, value: float) -> None:
    with pytest.raises(InvalidInputError, match=rf"^{name} must lie in .*, got {value}"):
        SoilTerrain(**{"c": 1e3, "phi": 0.5, name: value})


def test_a_soil_without_strength_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="strength"):
        SoilTerrain(c=0.0, phi=0.0)


def test_a_parameter_that_is_no_number_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="mu"):
        RigidTerrain(mu="0.7")  # type: ignore[arg-type]


def test_a_hard_patch_in_soil_is_pure_friction() -> None:
    assert math.tan(SoilTerrain(c=0.0, phi=math.atan(0.8)).phi) == pytest.approx(0.8, rel=1e-15)


def test_a_mapping_names_the_mode_and_the_parameters() -> None:
    assert terrain_from_mapping({"mode": "rigid", "mu": 0.5, "k": 0.03}) == RigidTerrain(0.5, k=0.03)
    assert terrain_from_mapping({"mode": "soil", "c": 1e3, "phi": 0.4}) == SoilTerrain(1e3, 0.4)


@pytest.mark.parametrize(
    ("mapping", "message"),
    [
        ({"mode": "sol", "c": 1e3, "phi": 0.4}, "did you mean 'soil'"),
        ({"mode": "soil", "ph": 0.4}, "did you mean 'phi'"),
    ],
)
def test_unknown_keys_and_modes_are_answered_with_the_nearest(mapping: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigurationError, match=message):
        terrain_from_mapping(mapping)


def test_a_missing_parameter_is_named() -> None:
    with pytest.raises(InvalidInputError, match="phi"):
        terrain_from_mapping({"mode": "soil", "c": 1e3})


@pytest.mark.parametrize(
    ("name", "mode", "low", "high"),
    [
        ("wide", "rigid", (0.1, 0.01, 0.005), (1.0, 0.20, 0.06)),
        ("paper", "rigid", (0.4, 0.01, 0.005), (1.0, 0.10, 0.06)),
        ("wide", "soil", (0.0, math.radians(4), 0.01, 0.005), (70e3, math.radians(42), 0.20, 0.06)),
        ("paper", "soil", (1e3, math.radians(5), 0.01, 0.005), (20e3, math.radians(25), 0.10, 0.06)),
    ],
)
def test_the_declared_ranges(name: str, mode: Mode, low: tuple[float, ...], high: tuple[float, ...]) -> None:
    ranges = parameter_ranges(name, mode)
    assert ranges.low == pytest.approx(low, rel=1e-15)
    assert ranges.high == pytest.approx(high, rel=1e-15)


def test_an_unknown_range_is_answered_with_the_nearest() -> None:
    with pytest.raises(ConfigurationError, match="did you mean 'wide'"):
        parameter_ranges("wid", "soil")


@pytest.mark.parametrize("name", terrain_names())
def test_every_named_ground_lies_inside_the_wide_range(name: str) -> None:
    ground = named(name)
    assert parameter_ranges("wide", ground.mode).contains(ground)


def test_ice_lies_outside_the_ranges_of_the_paper() -> None:
    assert not parameter_ranges("paper", "rigid").contains(named("ice"))


def test_the_bounds_belong_to_the_range() -> None:
    ranges = parameter_ranges("wide", "rigid")
    assert ranges.contains(RigidTerrain(*ranges.low))
    assert ranges.contains(RigidTerrain(*ranges.high))
    assert not ranges.contains(RigidTerrain(1.0 + 1e-12, *ranges.high[1:]))


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", RANGE_NAMES)
def test_draws_lie_inside_and_reach_across_the_range(name: str, mode: Mode) -> None:
    ranges = parameter_ranges(name, mode)
    rng = np.random.default_rng(1)
    drawn = [ranges.sample(rng) for _ in range(500)]
    assert all(ranges.contains(terrain) for terrain in drawn)
    values = np.array([terrain.parameters for terrain in drawn])
    span = np.subtract(ranges.high, ranges.low)
    assert np.all(values.max(0) - values.min(0) > 0.9 * span)  # 500 draws miss a tenth at an end with p < 1e-10


def test_half_of_the_drawn_cohesions_lie_below_an_eighth_of_the_range() -> None:
    rng = np.random.default_rng(2)
    drawn = np.array([parameter_ranges("wide", "soil").sample(rng).parameters[0] for _ in range(4000)])
    assert np.mean(drawn < 70e3 / 8) == pytest.approx(0.5, abs=0.04)  # 5 standard errors of 4000 draws


def test_the_same_generator_draws_the_same_terrains() -> None:
    ranges = parameter_ranges("wide", "soil")
    assert ranges.sample(np.random.default_rng(3)) == ranges.sample(np.random.default_rng(3))


def test_ranges_are_plain_values() -> None:
    ranges = ParameterRanges("rigid", (0.2, 0.0, 0.01), (0.4, 0.1, 0.02))
    assert ranges.interface.mode == "rigid"
    assert ranges.contains(RigidTerrain(0.3, 0.05, 0.015))


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", RANGE_NAMES)
def test_places_of_the_unit_cube_follow_the_law_of_the_draws(name: str, mode: Mode) -> None:
    ranges, first, second = parameter_ranges(name, mode), np.random.default_rng(3), np.random.default_rng(3)
    drawn = np.array([ranges.sample(first).parameters for _ in range(200)])
    np.testing.assert_allclose(ranges.at(second.random(drawn.shape)), drawn, rtol=1e-14)
    corners = ranges.at(np.array([np.zeros(drawn.shape[1]), np.ones(drawn.shape[1])]))
    np.testing.assert_allclose(corners, [ranges.low, ranges.high], rtol=1e-14)


@pytest.mark.parametrize("value", [0, 5, 2.0, True, "3", math.nan])
def test_what_is_no_whole_number_or_out_of_its_interval_is_refused(value: Any) -> None:
    with pytest.raises(InvalidInputError, match=r"^count must be a whole number in \[1, 4\], got "):
        require_whole("count", value, 1, 4)


def test_whole_numbers_need_no_upper_bound() -> None:
    for value in (3, 10**12):
        require_whole("count", value, 3)
    with pytest.raises(InvalidInputError, match=r"^count must be a whole number of at least 3, got 2$"):
        require_whole("count", 2, 3)
