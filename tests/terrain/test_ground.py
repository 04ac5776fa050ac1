"""Ground that changes along the way."""

import numpy as np
import pytest

from grouser.terrain import ConfigurationError, InvalidInputError, SteppedTerrain, named, resolve_ground


def test_each_side_of_the_line_has_its_own_ground() -> None:
    ice, asphalt = named("ice"), named("asphalt")
    ground = SteppedTerrain(before=ice, beyond=asphalt, boundary=10.0)
    assert ground.mode == "rigid"
    np.testing.assert_array_equal(ground.parameters_at(9.999, 50.0), ice.parameters)
    np.testing.assert_array_equal(ground.parameters_at(10.001, -50.0), asphalt.parameters)


def test_a_ground_has_one_mode() -> None:
    with pytest.raises(ConfigurationError, match=r"rigid.*soil"):
        SteppedTerrain(named("ice"), named("lete-sand"), 0.0)


def test_a_ground_is_given_by_name_or_as_itself() -> None:
    stepped = SteppedTerrain(named("asphalt"), named("ice"), 0.0)
    assert resolve_ground("ice") == named("ice")
    assert resolve_ground(stepped) is stepped
    with pytest.raises(ConfigurationError, match="asphalt"):
        resolve_ground("asphlt")
    with pytest.raises(ConfigurationError, match="unknown terrain"):
        resolve_ground(3)  # type: ignore[arg-type]


def test_a_boundary_is_finite() -> None:
    with pytest.raises(InvalidInputError, match="boundary"):
        SteppedTerrain(named("asphalt"), named("ice"), float("nan"))
