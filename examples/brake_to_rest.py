"""Brake from 5 m/s to rest, and drive straight: where a network's residue shows beside the physics.

python examples/brake_to_rest.py
"""

import math

import numpy as np

from grouser.envs import BeltCommand, Simulator, VehicleState

print("backend   ground      stop, m   speed left, mm/s   straight: max |Mz|, N m")
for backend in ("physics", "native", "guarded"):
    for ground in ("asphalt", "lete-sand"):
        simulator = Simulator("m113", backend, ground, state=VehicleState.rolling(5.0))
        for _ in range(1200):
            state = simulator.step(BeltCommand(0.0, 0.0)).state
        simulator.set_state(VehicleState.rolling(5.0))
        moments = [simulator.step(BeltCommand(5.0, 5.0)).forces[2] for _ in range(500)]
        left = 1000 * math.hypot(state.vx, state.vy)
        print(f"{backend:9s} {ground:10s} {state.x:8.3f} {left:15.4f} {np.abs(moments).max():20.1f}")
