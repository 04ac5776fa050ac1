"""Ten million ticks: memory stays where it is, and every vehicle stays on its feet."""

import gc
import resource
from pathlib import Path

import numpy as np
import pytest

from grouser.envs import VehicleFleet, VehicleState
from grouser.terrain import TrackedVehicle, make_backend, named

VEHICLES, TICKS, ROUNDS = 1000, 100, 100


def resident_kilobytes() -> int:
    status = Path("/proc/self/status")
    if not status.exists():
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return next(int(line.split()[1]) for line in status.read_text().splitlines() if line.startswith("VmRSS"))


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["native", "guarded"])
def test_ten_million_ticks_hold_memory_flat(backend: str) -> None:
    vehicle = TrackedVehicle.preset("m113")
    fleet = VehicleFleet(
        vehicle,
        make_backend(backend, mode="rigid", vehicle=vehicle),
        named("asphalt"),
        VEHICLES,
        threads=2,
        state=VehicleState.rolling(4.0),
    )
    generator = np.random.default_rng(0)
    commands = np.full((VEHICLES, 2), 4.0)
    sizes = []
    for _ in range(ROUNDS):
        commands = np.clip(commands + generator.normal(0.0, 0.5, commands.shape), -8.0, 8.0)
        fleet.advance(commands, TICKS)
        gc.collect()
        sizes.append(resident_kilobytes())
    assert not fleet.diverged.any()
    assert np.isfinite(fleet.numbers).all()
    assert np.max(np.abs(fleet.numbers[3])) < 1.1 * vehicle.maximum_speed
    # After the first rounds nothing is left to be allocated; a page a round would be 400 kB.
    assert max(sizes[10:]) - sizes[9] < 300
