"""Grounds by name and by file, and planes that are tilted."""

import math
from pathlib import Path

import numpy as np
import pytest
from grounds import stepped

from grouser.terrain import (
    ConfigurationError,
    InvalidInputError,
    SlopedGround,
    TerrainField,
    named,
    resolve_ground,
    save_field,
)


def test_a_ground_is_given_by_name_or_as_itself() -> None:
    field = stepped(named("asphalt"), named("ice"), 0.0)
    assert resolve_ground("ice") == named("ice")
    assert resolve_ground(field) is field
    with pytest.raises(ConfigurationError, match="asphalt"):
        resolve_ground("asphlt")


def test_a_ground_is_given_by_the_file_of_a_field(tmp_path: Path) -> None:
    file = save_field(stepped(named("asphalt"), named("ice"), 3.0), tmp_path / "onto-ice.npz")
    for given in (file, str(file)):
        ground = resolve_ground(given)
        assert isinstance(ground, TerrainField)
        np.testing.assert_array_equal(ground.parameters_at(4.0, 0.0), named("ice").parameters)


@pytest.mark.parametrize("given", [3, None, TerrainField])
def test_what_is_no_ground_is_told_what_a_ground_has(given: object) -> None:
    with pytest.raises(InvalidInputError, match="mode, parameters_at and gradient_at"):
        resolve_ground(given)  # type: ignore[arg-type]


def test_a_plane_has_one_gradient_and_the_grounds_parameters() -> None:
    slope = SlopedGround(named("lete-sand"), grade=math.radians(10), bank=math.radians(-5))
    assert slope.mode == "soil"
    for x, y in ((0.0, 0.0), (-30.0, 12.0)):
        assert slope.gradient_at(x, y) == (math.tan(math.radians(10)), math.tan(math.radians(-5)))
        np.testing.assert_array_equal(slope.parameters_at(x, y), named("lete-sand").parameters)


def test_slopes_add_up() -> None:
    slope = SlopedGround(SlopedGround(named("ice"), grade=0.1), grade=0.1, bank=0.2)
    assert slope.gradient_at(0.0, 0.0) == (2 * math.tan(0.1), math.tan(0.2))


@pytest.mark.parametrize("slope", [{"grade": 0.8}, {"bank": -0.8}, {"grade": math.nan}])
def test_a_slope_stays_below_forty_five_degrees(slope: dict[str, float]) -> None:
    with pytest.raises(InvalidInputError, match=next(iter(slope))):
        SlopedGround(named("ice"), **slope)
