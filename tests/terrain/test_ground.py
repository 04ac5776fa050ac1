"""Ground that changes along the way."""

import numpy as np
import pytest

from grouser.terrain import ConfigurationError, SteppedTerrain, named


def test_each_side_of_the_line_has_its_own_ground() -> None:
    ice, asphalt = named("ice"), named("asphalt")
    ground = SteppedTerrain(before=ice, beyond=asphalt, boundary=10.0)
    assert ground.mode == "rigid"
    np.testing.assert_array_equal(ground.parameters_at(9.999, 50.0), ice.parameters)
    np.testing.assert_array_equal(ground.parameters_at(10.001, -50.0), asphalt.parameters)


def test_a_ground_has_one_mode() -> None:
    with pytest.raises(ConfigurationError, match=r"rigid.*soil"):
        SteppedTerrain(named("ice"), named("lete-sand"), 0.0)
