"""What the environments in highway-env's scenes share: actions, the control period, ground, info and frames."""

from __future__ import annotations

import contextlib
import os
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, Final, Generic, TypeVar

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from ...terrain import (
    ConfigurationError,
    FloatArray,
    ForceBackend,
    Ground,
    GuardedBackend,
    GuardMode,
    InvalidInputError,
    OffMapError,
    PhysicsBackend,
    SimulationDivergedError,
    SlopedGround,
    TrackedVehicle,
    make_backend,
    parameter_ranges,
    resolve_ground,
    resolve_terrain,
    resolve_vehicle,
    unknown_name,
)
from ..footing import sample_ground, track_forces_on
from ..observation import OBSERVATION_BOUND
from ..rendering import RENDER_MODES, RenderMode
from ..rollout import whole_ratio
from ..state import BeltCommand, VehicleState
from ..tracked_env import Engine
from .commands import twist_belts
from .dependency import import_highway_env
from .motion import MotionModel
from .scene_config import SceneConfig
from .vehicle import TrackedHighwayVehicle

_roads = import_highway_env("road.road")

# Cells of the block that the slip power is taken from, whatever the backend: a plain network has no track forces.
_SLIP_POWER_CELLS: Final = (2, 1)

ConfigT = TypeVar("ConfigT", bound=SceneConfig)
ObservationT = TypeVar("ObservationT")
Action = NDArray[np.float32]


class SceneEnv(gymnasium.Env[ObservationT, Action], Generic[ConfigT, ObservationT]):
    """One tracked vehicle in a scene of highway-env.

    Parameters
    ----------
    config : SceneConfig
        Settings.
    backend, vehicle, terrain, backend_options, engine
        As of the environments.
    render_mode : {"rgb_array", "human"}, optional
        How :meth:`render` shows the scene.

    Raises
    ------
    ConfigurationError
        If a name is unknown.
    InvalidInputError
        If periods do not divide.
    """

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": 10}  # noqa: RUF012 - Gymnasium's way

    def __init__(
        self,
        config: ConfigT,
        *,
        backend: str | ForceBackend,
        vehicle: str | os.PathLike[str] | TrackedVehicle,
        terrain: str | os.PathLike[str] | Ground,
        render_mode: RenderMode | None,
        backend_options: Mapping[str, Any] | None,
        engine: Engine | None,
    ) -> None:
        if render_mode is not None and render_mode not in RENDER_MODES:
            raise unknown_name("render mode", render_mode, RENDER_MODES)
        self.config: Final[ConfigT] = config
        self.tracked_vehicle: Final = resolve_vehicle(vehicle)
        self.top_speed: Final = config.top_speed or self.tracked_vehicle.training_speed / 2
        if self.top_speed > self.tracked_vehicle.maximum_speed:
            raise InvalidInputError(
                f"top_speed must be at most the {self.tracked_vehicle.maximum_speed:g} m/s that the drive of "
                f"{self.tracked_vehicle.name} reaches, got {self.top_speed:g}"
            )
        self._substeps = whole_ratio(config.control_period, config.scene_period, "control_period and scene_period")
        whole_ratio(config.scene_period, config.tick, "scene_period and tick")
        self._most_steps = whole_ratio(config.time_limit, config.control_period, "time_limit and control_period")
        self._terrains = tuple(resolve_terrain(name) for name in config.terrains)
        self._ground = self._terrains[0] if self._terrains else resolve_ground(terrain)
        self._model = MotionModel(
            self.tracked_vehicle,
            make_backend(backend, mode=self._ground.mode, vehicle=self.tracked_vehicle, **(backend_options or {})),
            self._ground,
            tick=config.tick,
            integrator=config.integrator,
            ground_sampling=config.ground_sampling,
            engine=engine,
        )
        self._slip_block = PhysicsBackend(self.tracked_vehicle, self._ground.mode, cells=_SLIP_POWER_CELLS)
        self.render_mode = render_mode
        self._draw_mode = render_mode
        # Gymnasium's is shared by every environment of the class.
        self.metadata = self.metadata | {"render_fps": round(1 / config.control_period)}
        self.action_space = Box(-1.0, 1.0, (2,), np.float32)
        self._action: FloatArray = np.zeros(2)
        self._steps = 0
        self._vehicle: TrackedHighwayVehicle | None = None
        self._theta: FloatArray | None = None

    @property
    def vehicle(self) -> TrackedHighwayVehicle:
        """The vehicle on the road."""
        if self._vehicle is None:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        return self._vehicle

    @property
    def road(self) -> Any:
        """The road of highway-env, with its network, vehicles and objects."""
        return self.vehicle.road

    @property
    def backend(self) -> ForceBackend:
        """What answers for the ground."""
        return self._model.backend

    def _draw_ground(self) -> Ground:
        """Draw the ground of an episode; the same numbers are drawn whatever the settings."""
        share = self.np_random.random()
        mode = self._ground.mode
        sampled = parameter_ranges(self.config.terrain_range or "wide", mode).sample(self.np_random)
        if self.config.terrain_range is not None:
            return sampled
        if self._terrains:
            return self._terrains[int(share * len(self._terrains))]
        return self._ground

    def _sloped(self, ground: Ground) -> Ground:
        if ground.mode != self._ground.mode:
            raise ConfigurationError(f"the task is on {self._ground.mode} ground, got {ground.mode}")
        grade, bank = self.config.grade, self.config.bank
        return SlopedGround(ground, grade, bank) if grade or bank else ground

    def _begin(self, network: Any, objects: list[Any], state: VehicleState, ground: Ground) -> None:
        """Put the vehicle on a road."""
        ground = self._sloped(ground)
        sample_ground(
            ground,
            self.tracked_vehicle,
            self.config.ground_sampling,
            x=state.x,
            y=state.y,
            heading=state.heading,
        )
        road = _roads.Road(network=network, np_random=self.np_random, road_objects=objects)
        vehicle = TrackedHighwayVehicle(
            road, [state.x, state.y], state.heading, model=self._model, size=self.config.size
        )
        vehicle.set_ground(ground)
        vehicle.state = state
        road.vehicles.append(vehicle)
        self._vehicle = vehicle
        self._action = np.zeros(2)
        self._steps = 0

    def _command(self, action: FloatArray) -> BeltCommand:
        limit = self.top_speed
        if self.config.action_mode == "belts":
            return BeltCommand(limit * float(action[0]), limit * float(action[1]))
        yaw_rate = self.config.yaw_rate_scale * float(action[1])
        return twist_belts(limit * float(action[0]), yaw_rate, tread=self.tracked_vehicle.tread, limit=limit)

    def _advance(self, action: NDArray[Any]) -> tuple[FloatArray, dict[str, Any]]:
        """Hold an action for one control period, or until the vehicle collides or is lost.

        Returns
        -------
        ndarray, shape (2,)
            The action.
        dict
            ``crashed``, and ``diverged`` or ``off_map`` where the simulation broke off.
        """
        given = np.asarray(action, dtype=np.float64)
        if given.shape != (2,) or not np.all(np.abs(given) <= 1.0):
            raise InvalidInputError(f"an action is two numbers in [-1, 1], got {action!r}")
        vehicle, road = self.vehicle, self.road
        vehicle.act(self._command(given))
        lost: dict[str, Any] = {}
        try:
            for _ in range(self._substeps):
                road.act()
                road.step(self.config.scene_period)
                if vehicle.crashed:
                    break
        except SimulationDivergedError:
            lost = {"diverged": True}
        except OffMapError:
            lost = {"off_map": True}
        self._steps += 1
        return given, {"crashed": bool(vehicle.crashed), "steps": self._steps, "backend": self.backend.name} | lost

    def _control_costs(self, action: FloatArray, info: Mapping[str, Any]) -> tuple[float, float]:
        """Return the reward's terms of action change and slip power, and remember the action."""
        change, self._action = action - self._action, action
        slip_power = 0.0
        if self.config.slip_power_weight and not is_lost(info):
            slip_power = self._slip_power() / (self.tracked_vehicle.weight * self.top_speed)
        return (
            -self.config.action_change_weight * float(change @ change),
            -self.config.slip_power_weight * slip_power,
        )

    def _slip_power(self) -> float:
        """Return belt power less the power that reaches the body, of the last tick's shear forces, in W."""
        record = self.vehicle.motion.last_tick()
        tracks = track_forces_on(record.footing, self._slip_block, record.row, rolling=False)
        return float(record.row[5:7] @ tracks[:, 0]) - float(record.row[:3] @ tracks.sum(axis=0))

    def _guard_info(self) -> dict[str, Any]:
        """Return what the guard of a guarded backend did in the last tick."""
        backend = self.backend
        if not isinstance(backend, GuardedBackend):
            return {}
        record = self.vehicle.motion.last_tick()
        guard = record.state.guard
        active = backend.primary if guard.mode is GuardMode.PRIMARY else backend.fallback
        score = record.detection.score if record.detection is not None else 0.0
        return {"backend": active.name, "ood_score": score, "fallback_weight": guard.fallback_weight}

    def _motion_parts(self, state: VehicleState) -> list[float]:
        """Return velocity, yaw rate, belts and previous action, scaled."""
        top = self.top_speed
        return [
            state.vx / top,
            state.vy / top,
            state.yaw_rate / self.config.yaw_rate_scale,
            state.v_left / top,
            state.v_right / top,
            *self._action.tolist(),
        ]

    def _terrain_parts(self, state: VehicleState) -> list[float]:
        """Return the terrain parameters under the vehicle, -1 to 1 over the wide ranges, where they are observed."""
        if not self.config.observe_terrain:
            return []
        # Off the map the vehicle sees what it saw last.
        with contextlib.suppress(OffMapError):
            self._theta = self.vehicle.motion.ground.parameters_at(state.x, state.y)
        ranges = parameter_ranges("wide", self._ground.mode)
        low, high = np.array(ranges.low), np.array(ranges.high)
        scaled: list[float] = (2 * ((low if self._theta is None else self._theta) - low) / (high - low) - 1).tolist()
        return scaled

    @property
    def _terrain_size(self) -> int:
        return len(parameter_ranges("wide", self._ground.mode).low) if self.config.observe_terrain else 0

    def render(self) -> NDArray[np.uint8] | None:  # type: ignore[override]
        """Show the scene from above: an image (height, width, 3), or a window."""
        if self._draw_mode is None:
            gymnasium.logger.warn("render() without a render_mode: pass render_mode='rgb_array' to gymnasium.make")
        return None

    @abstractmethod
    def _observe(self) -> ObservationT:
        """Return the observation of the vehicle where it is."""


def is_lost(info: Mapping[str, Any]) -> bool:
    """Whether a step's info tells of a simulation that broke off."""
    return bool(info.get("diverged") or info.get("off_map"))


def bounded(parts: list[float]) -> NDArray[np.float32]:
    """Return an observation, cut to its bound; NaN, of a state that broke off, becomes 0."""
    return np.clip(np.array(parts), -OBSERVATION_BOUND, OBSERVATION_BOUND).astype(np.float32)


def observation_box(size: int) -> Box:
    """Return the space of observations of a size."""
    return Box(-OBSERVATION_BOUND, OBSERVATION_BOUND, (size,), np.float32)
