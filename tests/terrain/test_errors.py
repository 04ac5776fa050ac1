"""The error hierarchy and the sentences that errors share."""

import pickle

import pytest

from grouser.terrain import (
    ArtifactError,
    ConfigurationError,
    GrouserError,
    InvalidInputError,
    SimulationDivergedError,
    missing_extra,
    unknown_name,
)


@pytest.mark.parametrize("error", [InvalidInputError, ArtifactError, ConfigurationError, SimulationDivergedError])
def test_every_error_is_a_grouser_error(error: type[Exception]) -> None:
    assert issubclass(error, GrouserError)


def test_an_unknown_name_comes_with_the_nearest_and_the_rest() -> None:
    assert str(unknown_name("fruit", "aple", ["pear", "apple"])) == (
        "unknown fruit 'aple'; did you mean 'apple'? (known: apple, pear)"
    )


def test_a_name_near_to_nothing_comes_with_what_is_known() -> None:
    message = str(unknown_name("fruit", "zzz", ["pear", "apple"]))
    assert "did you mean" not in message
    assert "apple, pear" in message


def test_a_missing_package_names_the_extra_that_brings_it() -> None:
    message = str(missing_extra("casadi", "mpc"))
    assert "casadi" in message
    assert "grouser[mpc]" in message


def test_a_diverged_simulation_carries_its_state_across_processes() -> None:
    error = pickle.loads(pickle.dumps(SimulationDivergedError("no tick solved", state={"vx": 1.0})))
    assert str(error) == "no tick solved"
    assert error.state == {"vx": 1.0}
