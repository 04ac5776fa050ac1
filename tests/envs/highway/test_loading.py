"""Who does not ask for a scene does not load highway-env, and who has none is told what to install."""

from __future__ import annotations

import subprocess
import sys

import pytest


def run(script: str) -> None:
    done = subprocess.run([sys.executable, "-P", "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_ids_are_known_without_loading_highway_env() -> None:
    run(
        "import sys, gymnasium, grouser\n"
        "from grouser.envs import PathTrackingEnv\n"
        "assert {'grouser/Parking-v0', 'grouser/OffRoad-v0'} <= set(gymnasium.registry)\n"
        "assert 'highway_env' not in sys.modules"
    )


@pytest.mark.parametrize("name", ["Parking", "OffRoad"])
def test_a_missing_package_is_named(name: str) -> None:
    run(
        "import sys; sys.modules['highway_env'] = None\n"
        "import gymnasium, grouser\n"
        "from grouser.terrain import ConfigurationError\n"
        "try:\n"
        f"    gymnasium.make('grouser/{name}-v0')\n"
        "except ConfigurationError as error:\n"
        "    assert 'grouser[highway]' in str(error)\n"
        "else:\n"
        "    raise AssertionError"
    )


def test_names_are_found_in_envs() -> None:
    run(
        "import grouser.envs as envs, grouser.envs.highway as highway\n"
        "assert envs.ParkingEnv is highway.ParkingEnv\n"
        "assert envs.tracked_vehicle_class is highway.tracked_vehicle_class\n"
        "try:\n"
        "    envs.ParkngEnv\n"
        "except AttributeError as error:\n"
        "    assert 'ParkngEnv' in str(error)"
    )
