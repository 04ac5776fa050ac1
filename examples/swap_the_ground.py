"""Drive one lane change on two backends and hold them against each other.

python examples/swap_the_ground.py
"""

import numpy as np

from grouser.controllers import PathTrackingMPC, identify_slip
from grouser.envs import Simulator, VehicleState, make_path, rollout
from grouser.terrain import TrackedVehicle, named

vehicle = TrackedVehicle.preset("m113")
ground = named("asphalt")
path = make_path("iso-3888-1", vehicle)
slip = identify_slip(vehicle, ground, speed=5.0)

ends = {}
for backend in ("physics", "native"):
    simulator = Simulator(vehicle, backend, ground, state=VehicleState.rolling(5.0))
    log = rollout(
        simulator,
        PathTrackingMPC(path, vehicle, slip),
        duration=40.0,
        until=lambda state: state.x >= path.x[-1],
    )
    _, cross_track = path.follow(log.states[:, :2])
    ends[backend] = log.states[-1, :2]
    print(f"{backend:8s} {len(log):5d} ticks, cross-track RMSE {np.sqrt(np.mean(cross_track**2)) * 1000:.1f} mm")
print(f"the two ends lie {np.hypot(*(ends['native'] - ends['physics'])) * 1000:.0f} mm apart")
