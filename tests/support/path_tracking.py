"""Path tracking as its tests drive it: actions, seeded episodes, and a vehicle beside the environment's."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grouser.envs import BeltCommand, PathTrackingEnv, Simulator, VehicleFleet, VehicleState
from grouser.surrogate import Surrogate
from grouser.terrain import FloatArray, ForceBackend, Mode

GROUND = {"rigid": "asphalt", "soil": "lete-sand"}
BACKENDS = ("physics", "torch", "native", "guarded")
Action = NDArray[np.float32]
MakeEnv = Callable[..., PathTrackingEnv]


class Twin(NamedTuple):
    """State, and the last tick's row and forces, of a vehicle beside the environment's."""

    state: VehicleState
    row: FloatArray
    forces: FloatArray


def act(left: float, right: float) -> Action:
    return np.array([left, right], dtype=np.float32)


def tracking_maker(make_surrogate: Callable[[Mode], Surrogate]) -> MakeEnv:
    """What makes an environment on a backend that is named, without a shipped artifact."""

    def make(backend: str | ForceBackend = "physics", mode: Mode = "rigid", **options: Any) -> PathTrackingEnv:
        terrain = options.pop("terrain", GROUND[mode])
        if backend in ("torch", "native", "guarded"):
            options["backend_options"] = {"artifact": make_surrogate(mode)}
        return PathTrackingEnv(backend, "m113", terrain, **options)

    return make


def twin(env: PathTrackingEnv, before: VehicleState, command: BeltCommand, ticks: int = 10) -> Twin:
    """What the vehicle does under a command apart from any task, in the engine that the environment drives in."""
    vehicle, backend, ground = env.vehicle, env.simulator.backend, env.simulator.ground
    if backend.name == "torch":
        simulator = Simulator(vehicle, backend, ground, state=before)
        for _ in range(ticks):
            record = simulator.step(command)
        return Twin(simulator.get_state(), record.row, record.forces)
    fleet = VehicleFleet(vehicle, backend, ground, 1, state=before)
    fleet.advance([command], ticks)
    return Twin(fleet.get_state(0), fleet.record.row[0].copy(), fleet.record.forces[0].copy())


def episode(env: PathTrackingEnv, seed: int, steps: int = 20, **options: Any) -> list[Any]:
    """Drive by a seeded sequence of actions and return everything that came back."""
    generator = np.random.default_rng(7)
    observation, info = env.reset(seed=seed, options=options or None)
    trace: list[Any] = [observation.tobytes(), repr(info)]
    for _ in range(steps):
        action = generator.uniform(-1.0, 1.0, 2).astype(np.float32)
        observation, reward, terminated, truncated, info = env.step(action)
        trace.append((observation.tobytes(), reward, terminated, truncated, info["force"].tobytes(), repr(info)))
    return trace
