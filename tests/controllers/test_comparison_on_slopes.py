"""Comparisons on slopes: the reference that forces are held against is the block under the load of the slope."""

from collections.abc import Callable

import pytest

from grouser.controllers import PurePursuit, Scenario, compare
from grouser.envs.paths import straight
from grouser.terrain import Ground, SlopedGround, TrackedVehicle, named, paint_field

M113 = TrackedVehicle.preset("m113")
PATH = straight(8.0)

GROUNDS: dict[str, Callable[[], Ground]] = {
    "plane": lambda: SlopedGround(named("lete-sand"), grade=0.3),
    "hills": lambda: paint_field(
        named("lete-sand"), (-20, 30, -20, 20), elevation=lambda x, y: 0.2 * x + 0.02 * y * y, outside="extend"
    ),
}


@pytest.mark.parametrize("ground", GROUNDS.values(), ids=GROUNDS.keys())
def test_physics_explains_its_own_forces_wholly(ground: Callable[[], Ground]) -> None:
    scenario = Scenario(
        name="slope",
        terrain="lete-sand",
        ground=ground(),
        path=PATH,
        vehicle=M113,
        speed=2.0,
        drivers={"pursuit": lambda: PurePursuit(PATH, M113, 2.0)},
        time_limit=6.0,
    )
    (drive,) = compare([scenario], ["physics"])
    explained = [value for value in drive.row.force_r2 if value is not None]
    assert explained
    assert explained == pytest.approx([1.0] * len(explained), abs=1e-12)
