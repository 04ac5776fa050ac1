"""What the environments in highway-env's scenes share: actions, the control period, ground, info and frames."""

from __future__ import annotations

import contextlib
import os
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar, Final, Generic, TypeVar

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from ...terrain import (
    FloatArray,
    ForceBackend,
    Ground,
    GuardedBackend,
    OffMapError,
    SimulationDivergedError,
    SlopedGround,
    TrackedVehicle,
    interface,
    make_backend,
    resolve_ground,
    resolve_vehicle,
    unknown_name,
)
from ...terrain.parameters import require_in
from ..footing import sample_ground
from ..observation import belt_command, check_action, terrain_sight, terrain_size
from ..rendering import RENDER_MODES, RenderMode
from ..rollout import whole_ratio
from ..slip_power import slip_power, slip_power_block
from ..state import VehicleState
from ..step_info import drawn_info, guard_info
from ..surroundings import Randomizer, Surroundings
from ..task_config import changed_config
from ..tracked_env import Engine
from .dependency import import_highway_env
from .footprint import Footprint
from .kinematics import Kinematics
from .motion_model import MotionModel
from .scene_config import SceneConfig
from .scene_observation import motion_parts
from .scene_renderer import SceneRenderer
from .vehicle import TrackedHighwayVehicle

_roads = import_highway_env("road.road")

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
    usual_speed : float, optional
        What ``top_speed`` is by default, in m/s, unless the training speed is lower.
    render_mode : {"rgb_array", "human"}, optional
        How :meth:`render` shows the scene.

    Raises
    ------
    ConfigurationError
        If a name is unknown.
    InvalidInputError
        If periods do not divide.
    """

    #: Height of a frame in m, and what stands in its middle; None is the vehicle.
    _view: ClassVar[tuple[float, tuple[float, float] | None]]

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": 10}  # noqa: RUF012 - Gymnasium's way

    def __init__(
        self,
        config: ConfigT,
        *,
        backend: str | ForceBackend,
        vehicle: str | os.PathLike[str] | TrackedVehicle,
        terrain: str | os.PathLike[str] | Ground,
        usual_speed: float | None = None,
        render_mode: RenderMode | None,
        backend_options: Mapping[str, Any] | None,
        engine: Engine | None,
    ) -> None:
        if render_mode is not None and render_mode not in RENDER_MODES:
            raise unknown_name("render mode", render_mode, RENDER_MODES)
        self.config: ConfigT = config
        self.vehicle: Final = resolve_vehicle(vehicle)
        training_speed = self.vehicle.training_speed
        self.top_speed: Final = config.top_speed or min(usual_speed or training_speed, training_speed)
        require_in("top_speed", self.top_speed, 0.0, self.vehicle.maximum_speed, low_open=True)
        self._substeps = whole_ratio(config.control_period, config.scene_period, "control_period and scene_period")
        whole_ratio(config.scene_period, config.tick, "scene_period and tick")
        self._most_steps = whole_ratio(config.time_limit, config.control_period, "time_limit and control_period")
        self._ground = self._prepare_ground(terrain)
        self._randomizer = self._make_randomizer(config)
        self._model = MotionModel(
            self.vehicle,
            make_backend(backend, mode=self._ground.mode, vehicle=self.vehicle, **(backend_options or {})),
            self._ground,
            tick=config.tick,
            integrator=config.integrator,
            ground_sampling=config.ground_sampling,
            engine=engine,
        )
        self._slip_block = slip_power_block(self.vehicle, self._ground.mode)
        self.render_mode = render_mode
        # Gymnasium widens render_mode to any string.
        self._draw_mode = render_mode
        # Gymnasium's metadata is shared by every environment of the class.
        self.metadata = self.metadata | {"render_fps": round(1 / config.control_period)}
        self.action_space = Box(-1.0, 1.0, (2,), np.float32)
        self._action: FloatArray = np.zeros(2)
        self._steps = 0
        self._vehicle: TrackedHighwayVehicle | None = None
        self._theta: FloatArray = np.zeros(len(interface(self._ground.mode).parameter_names))
        self._renderer: SceneRenderer | None = None
        self._succeeded = False

    @property
    def highway_vehicle(self) -> TrackedHighwayVehicle:
        """The vehicle on the road."""
        if self._vehicle is None:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        return self._vehicle

    @property
    def road(self) -> Any:
        """The road of highway-env, with its network, vehicles and objects."""
        return self.highway_vehicle.road

    @property
    def ground(self) -> Ground:
        """The ground of the episode."""
        return self.highway_vehicle.motion.ground

    @property
    def backend(self) -> ForceBackend:
        """What answers for the ground."""
        return self._model.backend

    def reconfigure(self, **settings: Any) -> None:
        """Change settings of how episodes begin, of the scene and of randomization, from the next reset on.

        Parameters
        ----------
        **settings
            Those that ``changeable`` of the configuration names.

        Raises
        ------
        ConfigurationError
            If a key is unknown, its setting holds for the life of an environment, or a value does not fit the scene as it
            was made; nothing has changed then.
        InvalidInputError
            If a value is impossible; nothing has changed then.
        """
        self._take_on(changed_config(self.config, settings))

    def _take_on(self, config: ConfigT) -> None:
        """Take changed settings on, or refuse them and change nothing."""
        self._randomizer = self._make_randomizer(config)
        self.config = config

    def _prepare_ground(self, terrain: str | os.PathLike[str] | Ground) -> Ground:
        """Return a ground as the scene takes it, still on the level."""
        return resolve_ground(terrain)

    def _make_randomizer(self, config: ConfigT) -> Randomizer:
        return Randomizer(config.randomize, self._ground, self.vehicle, self._prepare_ground)

    def _draw_surroundings(self, options: Mapping[str, Any]) -> Surroundings:
        """Draw ground and vehicle of an episode, after everything else that its start draws.

        Raises
        ------
        ConfigurationError
            If the reset option ``terrain`` does not fit the scene.
        """
        ground = self._prepare_ground(options["terrain"]) if "terrain" in options else None
        return self._randomizer.draw(self.np_random, ground)

    def _drawn_info(self, surroundings: Surroundings, state: VehicleState) -> dict[str, Any]:
        """Return what ``info`` tells of what an episode drew, where anything is randomized."""
        return drawn_info(self._ground.mode, self._randomizer.drawn(surroundings, state.x, state.y))

    def _begin(self, network: Any, objects: list[Any], state: VehicleState, surroundings: Surroundings) -> None:
        """Put the vehicle on a road."""
        ground, machine = surroundings
        grade, bank = self.config.grade, self.config.bank
        if grade or bank:
            ground = SlopedGround(ground, grade, bank)
        sampling = self.config.ground_sampling
        # A start off the map is refused here, before anything has changed.
        sample_ground(ground, machine, sampling, x=state.x, y=state.y, heading=state.heading)
        road = _roads.Road(network=network, np_random=self.np_random, road_objects=objects)
        model = replace(self._model, vehicle=machine, ground=ground)
        vehicle = TrackedHighwayVehicle(road, [state.x, state.y], state.heading, model=model, size=self.config.size)
        vehicle.state = state
        vehicle.motion.watched = bool(self.config.slip_power_weight) or isinstance(self.backend, GuardedBackend)
        road.vehicles.append(vehicle)
        self._vehicle = vehicle
        self._action = np.zeros(2)
        self._steps = 0
        self._succeeded = False
        if self._renderer is not None:
            self._renderer.reset()
        if self.render_mode == "human":
            self.render()

    def _advance(self, action: NDArray[Any]) -> tuple[FloatArray, dict[str, Any]]:
        """Hold an action for one control period, or until the vehicle collides or is lost.

        Returns
        -------
        ndarray, shape (2,)
            The action.
        dict
            ``crashed``, and ``diverged`` or ``off_map`` where the simulation broke off.
        """
        given = check_action(action)
        vehicle, road = self.highway_vehicle, self.road
        vehicle.act(belt_command(given, self.vehicle, self.config, top_speed=self.top_speed))
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
        slip_share = 0.0
        if self.config.slip_power_weight and not is_lost(info):
            power = slip_power(self._slip_block, self.highway_vehicle.motion.last_tick())
            slip_share = power / (self.vehicle.weight * self.top_speed)
        return (
            -self.config.action_change_weight * float(change @ change),
            -self.config.slip_power_weight * slip_share,
        )

    def _guard_info(self) -> dict[str, Any]:
        """Return what the guard of a guarded backend did in the last tick."""
        if not isinstance(self.backend, GuardedBackend):
            return {}
        return guard_info(self.backend, self.highway_vehicle.motion.last_tick())

    def _motion_parts(self, state: Kinematics) -> list[float]:
        """Return velocity, yaw rate, belts and previous action, scaled."""
        scale = self.config.yaw_rate_scale
        return motion_parts(state, self._action, top_speed=self.top_speed, yaw_rate_scale=scale)

    def _terrain_parts(self, state: Kinematics) -> list[float]:
        """Return the terrain parameters under the vehicle, -1 to 1 over the wide ranges, where they are observed."""
        if not self.config.observe_terrain:
            return []
        # Off the map the vehicle sees what it saw last.
        with contextlib.suppress(OffMapError):
            self._theta = self.ground.parameters_at(state.x, state.y)
        shown: list[float] = terrain_sight(self._ground.mode, self._theta).tolist()
        return shown

    @property
    def _terrain_size(self) -> int:
        return terrain_size(self._ground.mode, self.config)

    def render(self) -> NDArray[np.uint8] | None:
        """Show the scene from above: an image (height, width, 3), or a window."""
        if self._draw_mode is None:
            gymnasium.logger.warn("render() without a render_mode: pass render_mode='rgb_array' to gymnasium.make")
            return None
        vehicle = self.highway_vehicle
        if self._renderer is None:
            self._renderer = SceneRenderer(
                self.vehicle,
                Footprint(vehicle.LENGTH, vehicle.WIDTH),
                self._draw_mode,
                view_height=self._view[0],
                center=self._view[1],
                fps=self.metadata["render_fps"],
            )
        return self._renderer.show(
            vehicle.state, vehicle.road, self.ground, label=self.backend.name, parked=self._succeeded
        )

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    @abstractmethod
    def _observe(self) -> ObservationT:
        """Return the observation of the vehicle where it is."""


def is_lost(info: Mapping[str, Any]) -> bool:
    """Whether a step's info tells of a simulation that broke off."""
    return bool(info.get("diverged") or info.get("off_map"))
