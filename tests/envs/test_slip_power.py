"""Slip power: what the belts give and the body does not get."""

import pytest

from grouser.envs import BeltCommand, Simulator, VehicleState
from grouser.envs.slip_power import slip_power, slip_power_block
from grouser.terrain import PhysicsBackend, RigidTerrain, TrackedVehicle

M113 = TrackedVehicle.preset("m113")
BLOCK = slip_power_block(M113, "rigid")


@pytest.mark.parametrize("rolling_resistance", [0.0, 0.1])
def test_straight_ahead_it_is_shear_force_times_slip_speed(rolling_resistance: float) -> None:
    ground = RigidTerrain(mu=0.8, fr=rolling_resistance, k=0.02)
    state = VehicleState(vx=2.0, v_left=3.0, v_right=3.0)
    record = Simulator(M113, PhysicsBackend(M113, "rigid"), ground, state=state).step(BeltCommand(5.0, 5.0))
    row = record.row.copy()
    row[BLOCK.interface.index("fr")] = 0.0
    shear_force = BLOCK.forces(row)[0]
    assert shear_force > 1e4
    assert slip_power(BLOCK, record) == pytest.approx(shear_force * (row[5] - row[0]), rel=1e-9)


def test_what_rolls_loses_nothing() -> None:
    simulator = Simulator(
        M113, PhysicsBackend(M113, "rigid"), RigidTerrain(0.8, 0.0, 0.02), state=VehicleState.rolling(4.0)
    )
    assert slip_power(BLOCK, simulator.step(BeltCommand(4.0, 4.0))) == pytest.approx(0.0, abs=1e-6)
