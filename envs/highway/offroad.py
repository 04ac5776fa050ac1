"""``grouser/OffRoad-v0``: drive a winding road to its end, around obstacles and over changing ground."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

import gymnasium
import numpy as np
from numpy.typing import NDArray

from ...terrain import (
    ConfigurationError,
    ForceBackend,
    Ground,
    RigidTerrain,
    SoilTerrain,
    Terrain,
    TrackedVehicle,
    resolve_ground,
)
from ...terrain.parameters import require_in
from ..observation import LOOK_AHEAD_TIMES, look_along
from ..path import Path, Projection
from ..rendering import RenderMode
from ..state import VehicleState
from ..task_config import check_options
from ..tracked_env import Engine
from .course import Course, course_network, course_obstacles, draw_course, paint_course
from .obstacles import OBSTACLE_PARTS, nearest_obstacles, obstacle_table
from .offroad_config import OffRoadConfig, OffRoadResetOptions, offroad_config
from .scene import Action, SceneEnv, is_lost
from .scene_observation import bounded, observation_box

Observation = NDArray[np.float32]

_OBSTACLE_SCALE: Final = 30.0


class OffRoadEnv(SceneEnv[OffRoadConfig, Observation]):
    """Drive a winding road to its end, around obstacles and over patches of other ground.

    Every episode draws its own road, obstacles and patches. The road is a lane of highway-env along a
    :class:`~grouser.envs.Path`, ``env.unwrapped.path``, which the MPC and pure pursuit take as it is; the ground is a
    terrain field, ``env.unwrapped.ground``.

    ## Action space

    ``Box(-1, 1, (2,), float32)``, held for one control period.

    | mode | action[0] | action[1] |
    |---|---|---|
    | ``belts`` | left belt speed / ``top_speed`` | right belt speed / ``top_speed`` |
    | ``twist`` | speed / ``top_speed`` | yaw rate / ``yaw_rate_scale``; belts saturate at ``top_speed`` |

    ``top_speed`` is the training speed.

    ## Observation space

    ``Box(-10, 10, (28,), float32)`` with three obstacles observed; three more for each further one.

    | index | part | scale |
    |---|---|---|
    | 0, 1 | Vx, Vy | ``top_speed`` |
    | 2 | yaw rate | ``yaw_rate_scale`` |
    | 3, 4 | v_left, v_right | ``top_speed`` |
    | 5, 6 | previous action | 1 |
    | 7 | distance from the road's middle, positive to the left | half the road's width |
    | 8 | heading error | π |
    | 9-18 | x, y of the road's middle .4, .8, 1.2, 1.6, 2 s ahead at reference speed, body frame | distance of the last |
    | 19-27 | forward, leftward, radius of the nearest obstacles; (1, 0, 0) for none | 30 m |
    | 28- | with ``observe_terrain``: terrain parameters θ, -1 to 1 over the ``wide`` ranges | |

    ## Reward

    ``progress_weight · min(p, 2 − p) − cross_track_weight · (e/half width)² − collision_weight · lost
    − off_road_weight · off − action_change_weight · |Δa|² − slip_power_weight · P_slip/(W v_top)``

    with p = Δs/(v_ref Δt) the progress along the road over that at reference speed, e the distance from its middle, and
    lost = 1 where the vehicle has collided or the simulation broke off, off = 1 where it has left the road. The terms are
    in ``info["reward_terms"]``.

    ## Start and end

    The vehicle starts near the road's start, rolling along it; see :class:`OffRoadResetOptions`. An episode terminates
    at the road's end, where the CG leaves the road, at a collision, and where the simulation breaks off, with
    ``info["diverged"]``. It is truncated at ``time_limit``.

    ## Info

    ``is_success`` (the end is reached), ``crashed``, ``off_road``, ``steps``, ``cross_track_error`` and ``progress`` in
    m, ``reward_terms``, ``backend`` that answered in the last tick; ``ood_score`` and ``fallback_weight`` with a guard;
    at a reset with ``randomize``, ``randomization``: what was drawn, in SI units, θ as beside the patches.

    Parameters
    ----------
    backend : str or ForceBackend
        ``"physics"``, ``"torch"``, ``"native"``, ``"guarded"``, a registered name, or a backend.
    vehicle : str, path-like or TrackedVehicle
        Preset name, catalogue file or vehicle.
    terrain : str, path-like or Terrain
        Ground beside the patches; its mode is the backend's and the patches'.
    render_mode : {"rgb_array", "human"}, optional
        How :meth:`render` shows the scene.
    backend_options : mapping, optional
        For :func:`grouser.terrain.make_backend`.
    engine : {"compiled", "python"}, optional
        What computes the ticks: the compiled engine, by default wherever it has the backend and the ground, or the
        Python tick, its reference.
    **settings
        Fields of :class:`OffRoadConfig`.

    Raises
    ------
    ConfigurationError
        If a name or setting is unknown.
    InvalidInputError
        If periods do not divide or a value is impossible.

    ## Version history

    v0: first version.
    """

    _view = (36.0, None)

    def __init__(
        self,
        backend: str | ForceBackend = "native",
        vehicle: str | os.PathLike[str] | TrackedVehicle = "m113",
        terrain: str | os.PathLike[str] | Terrain = "grenville-loam",
        *,
        render_mode: RenderMode | None = None,
        backend_options: Mapping[str, Any] | None = None,
        engine: Engine | None = None,
        **settings: Any,
    ) -> None:
        config = offroad_config(settings)
        super().__init__(
            config,
            backend=backend,
            vehicle=vehicle,
            terrain=terrain,
            render_mode=render_mode,
            backend_options=backend_options,
            engine=engine,
        )
        speed = config.reference_speed
        self.reference_speed: Final = self.vehicle.training_speed / 2 if speed is None else speed
        self._patch_grounds = config.patch_grounds(self._ground.mode)
        self._course: Course | None = None
        self._foot = Projection(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        self._obstacles = np.zeros((0, 3))
        size = 9 + 2 * len(LOOK_AHEAD_TIMES) + OBSTACLE_PARTS * config.observed_obstacles + self._terrain_size
        self.observation_space = observation_box(size)

    @property
    def course(self) -> Course:
        """Road, obstacles and patches of the episode."""
        if self._course is None:
            raise gymnasium.error.ResetNeeded("there is no course before reset()")
        return self._course

    @property
    def path(self) -> Path:
        """Middle of the road: what the MPC and pure pursuit take."""
        return self.course.path

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode on a course of its own; ``options`` as in :class:`OffRoadResetOptions`.

        The same draws are made whatever the options, so that an option changes nothing but what it names.
        """
        super().reset(seed=seed)
        chosen = check_options(OffRoadResetOptions, options or {})
        course = draw_course(self.np_random, self.config, self._patch_grounds)
        state = self._start(course.path, chosen)
        surroundings = self._draw_surroundings(chosen)
        obstacles, width = course_obstacles(course), self.config.road_width
        painted = paint_course(course, self._prepare_ground(surroundings.ground), width)
        self._begin(course_network(course, width), obstacles, state, surroundings._replace(ground=painted))
        self._course, self._obstacles = course, obstacle_table(obstacles)
        self._foot = course.path.project(state.x, state.y, heading=state.heading)
        info = self._measures() | {"crashed": False, "steps": 0, "is_success": False}
        return self._observe(), info | self._drawn_info(surroundings, state)

    def _take_on(self, config: OffRoadConfig) -> None:
        patch_grounds = config.patch_grounds(self._ground.mode)
        super()._take_on(config)
        self._patch_grounds = patch_grounds

    def _prepare_ground(self, terrain: str | os.PathLike[str] | Ground) -> Terrain:
        """Return a ground that patches can be painted on."""
        ground = resolve_ground(terrain)
        if not isinstance(ground, RigidTerrain | SoilTerrain):
            raise ConfigurationError(
                f"patches are painted on a terrain that is alike everywhere, not on a {type(ground).__name__}"
            )
        return ground

    def _start(self, path: Path, chosen: OffRoadResetOptions) -> VehicleState:
        config, fastest = self.config, self.vehicle.maximum_speed
        lateral, heading, share = self.np_random.uniform(-1.0, 1.0, 3).tolist()
        lateral = float(chosen.get("lateral_offset", config.lateral_spread * lateral))
        require_in("reset option lateral_offset", lateral, -config.road_width / 2, config.road_width / 2)
        lowest = config.lowest_start_speed
        speed = float(chosen.get("speed", self.reference_speed * (lowest + (1 - lowest) * (share + 1) / 2)))
        require_in("reset option speed", speed, -fastest, fastest)
        direction = path.heading_at(0.0)
        x, y = path.point_at(0.0)
        drawn = VehicleState.rolling(
            speed,
            x=x - lateral * math.sin(direction),
            y=y + lateral * math.cos(direction),
            heading=direction + float(chosen.get("heading_offset", config.heading_spread * heading)),
        )
        return replace(chosen.get("state", drawn), time=0.0)

    def step(self, action: Action) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Hold an action for one control period, or until the vehicle collides.

        Raises
        ------
        InvalidInputError
            If the action is not two numbers in [-1, 1].
        """
        config, before = self.config, self._foot.arc_length
        given, info = self._advance(action)
        change, slip_power = self._control_costs(given, info)
        state, path = self.highway_vehicle.kinematics(), self.path
        self._foot = foot = path.project(state.x, state.y, near=before)
        half_width = config.road_width / 2
        progress = (foot.arc_length - before) / (self.reference_speed * config.control_period)
        failed, off_road = info["crashed"] or is_lost(info), abs(foot.cross_track) > half_width
        terms = {
            "progress": config.progress_weight * min(progress, 2.0 - progress),
            "cross_track": -config.cross_track_weight * (foot.cross_track / half_width) ** 2,
            "collision": -config.collision_weight if failed else 0.0,
            "off_road": -config.off_road_weight if off_road else 0.0,
            "action_change": change,
            "slip_power": slip_power,
        }
        if not is_lost(info):
            info |= self._guard_info()
        arrived = foot.arc_length >= path.length and not failed and not off_road
        info |= self._measures() | {"off_road": off_road, "is_success": arrived, "reward_terms": terms}
        terminated = bool(failed or off_road or arrived)
        truncated = not terminated and self._steps >= self._most_steps
        if self.render_mode == "human":
            self.render()
        return self._observe(), sum(terms.values()), terminated, truncated, info

    def _measures(self) -> dict[str, float]:
        return {"cross_track_error": self._foot.cross_track, "progress": self._foot.arc_length}

    def _observe(self) -> Observation:
        state, config = self.highway_vehicle.kinematics(), self.config
        pose = state.x, state.y, state.heading
        parts = [
            *self._motion_parts(state),
            *look_along(self.path, pose, self._foot, speed=self.reference_speed, width=config.road_width / 2).tolist(),
            *nearest_obstacles(self._obstacles, *pose, count=config.observed_obstacles, scale=_OBSTACLE_SCALE),
        ]
        return bounded(parts + self._terrain_parts(state))
