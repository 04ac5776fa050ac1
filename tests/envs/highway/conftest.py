"""Scenes with a backend of any kind, and roads to put vehicles on."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import pytest

from grouser.surrogate import Surrogate
from grouser.terrain import Mode

if TYPE_CHECKING:
    from grouser.envs import OffRoadEnv, ParkingEnv

collect_ignore_glob = [] if find_spec("highway_env") else ["test_*.py"]


@pytest.fixture
def road() -> Any:
    """Two straight lanes along x."""
    from highway_env.road.road import Road, RoadNetwork

    return Road(RoadNetwork.straight_road_network(2))


@pytest.fixture
def backend_options(make_surrogate: Callable[[Mode], Surrogate]) -> Callable[[str, Mode], dict[str, Any]]:
    """What a backend needs to be made without a shipped artifact."""

    def options(backend: str, mode: Mode) -> dict[str, Any]:
        return {} if backend == "physics" else {"artifact": make_surrogate(mode)}

    return options


@pytest.fixture
def make_parking(backend_options: Callable[[str, Mode], dict[str, Any]]) -> Callable[..., ParkingEnv]:
    def make(backend: str = "native", **settings: Any) -> ParkingEnv:
        from grouser.envs import ParkingEnv

        return ParkingEnv(backend, backend_options=backend_options(backend, "rigid"), **settings)

    return make


@pytest.fixture
def make_offroad(backend_options: Callable[[str, Mode], dict[str, Any]]) -> Callable[..., OffRoadEnv]:
    def make(backend: str = "native", terrain: str = "grenville-loam", **settings: Any) -> OffRoadEnv:
        from grouser.envs import OffRoadEnv

        mode: Mode = "rigid" if terrain == "asphalt" else "soil"
        return OffRoadEnv(backend, terrain=terrain, backend_options=backend_options(backend, mode), **settings)

    return make
