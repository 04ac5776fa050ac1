"""``grouser/Parking-v0``: put a tracked vehicle into a spot, nose first and standing."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

import numpy as np
from gymnasium.spaces import Dict
from numpy.typing import ArrayLike, NDArray

from ...terrain import ConfigurationError, FloatArray, ForceBackend, Ground, TrackedVehicle
from ..observation import OBSERVATION_BOUND
from ..rendering import RenderMode
from ..state import VehicleState
from ..tracked_env import Engine
from .goal import GOAL_NAMES, GOAL_SCALES, as_goals, goal_errors, goal_reward, make_goal, within
from .goal_pairs import Infos, crashed_or_lost, goal_pairs
from .obstacles import OBSTACLE_PARTS, nearest_obstacles, obstacle_table
from .parking_config import ParkingConfig, check_parking_options, parking_config
from .parking_lot import draw_parking, lot_objects, spot_index, spot_network, spot_pose
from .scene import Action, SceneEnv, is_lost
from .scene_observation import bounded, observation_box

Observation = dict[str, NDArray[np.float32]]

_POSITION_SCALE: Final = GOAL_SCALES[0]
_OBSTACLE_SCALE: Final = 20.0
# At which one manoeuvres in a lot, in m/s.
_USUAL_SPEED: Final = 4.0


class ParkingEnv(SceneEnv[ParkingConfig, Observation]):
    """Put a tracked vehicle into a spot of a parking lot, nose first and standing.

    The lot, its walls, the start and the goal are those of highway-env's ``parking-v0``: with equal seeds the vehicle starts
    with the same heading in the middle of the aisle, at rest, and is asked into the same spot. The goal has one
    heading, away from the aisle, so that tail-in does not count. Nothing had to change for a footprint of 4.86 m ×
    2.69 m: a spot is 8 m × 4 m, the aisle 20 m wide.

    ## Action space

    ``Box(-1, 1, (2,), float32)``, held for one control period.

    | mode | action[0] | action[1] |
    |---|---|---|
    | ``belts`` | left belt speed / ``top_speed`` | right belt speed / ``top_speed`` |
    | ``twist`` | speed / ``top_speed`` | yaw rate / ``yaw_rate_scale``; belts saturate at ``top_speed`` |

    ``top_speed`` is 4 m/s, or the training speed where that is lower.

    ## Observation space

    A ``Dict`` of three boxes, ±10, float32.

    | key | index | part | scale |
    |---|---|---|---|
    | ``achieved_goal``, ``desired_goal`` | 0, 1 | x, y | 5 m |
    | | 2, 3 | velocity along x, y; 0 where desired | 5 m/s |
    | | 4, 5 | cos, sin of the heading | 1 |
    | ``observation`` | 0, 1 | x, y | 5 m |
    | | 2, 3 | cos, sin of the heading | 1 |
    | | 4, 5 | Vx, Vy, body frame | ``top_speed`` |
    | | 6 | yaw rate | ``yaw_rate_scale`` |
    | | 7, 8 | v_left, v_right | ``top_speed`` |
    | | 9, 10 | previous action | 1 |
    | | 11- | with ``parked_vehicles``: forward, leftward, radius of the nearest ``observed_obstacles``; (1, 0, 0) for none | 20 m |
    | | last | with ``observe_terrain``: terrain parameters θ, -1 to 1 over the ``wide`` ranges | |

    ``observation`` does not know the goal, as hindsight replay needs it.

    ## Reward

    ``−(Σ w_i |achieved_i − desired_i|)^p − collision_weight · lost − action_change_weight · |Δa|²
    − slip_power_weight · P_slip/(W v_top)``

    with w = ``reward_weights``, p = ``reward_exponent``, and lost = 1 where the vehicle has collided or the simulation
    broke off. It is parking-v0's form, with every term inside :meth:`compute_reward`; the terms are in
    ``info["reward_terms"]``. Replay hands them on where ``HerReplayBuffer`` is made with ``copy_info_dict=True``.

    ## Start and end

    See :class:`ParkingResetOptions` for what a reset can fix. An episode terminates with success within .5 m, 10° and .1 m/s of
    the goal (the ``..._tolerance`` settings; the yaw rate is not part of a goal), at a collision, and where the
    simulation breaks off, with ``info["diverged"]`` or ``info["off_map"]``. It is truncated at ``time_limit``.

    ## Info

    ``is_success``, ``crashed``, ``steps``, ``position_error`` (m), ``heading_error`` (rad), ``speed_error`` (m/s),
    ``reward_terms``, ``backend`` that answered in the last tick; ``ood_score`` and ``fallback_weight`` with a guard;
    at a reset with ``randomize``, ``randomization``: what was drawn, in SI units, θ as under the start.

    Parameters
    ----------
    backend : str or ForceBackend
        ``"physics"``, ``"torch"``, ``"native"``, ``"guarded"``, a registered name, or a backend.
    vehicle : str, path-like or TrackedVehicle
        Preset name, catalogue file or vehicle.
    terrain : str, path-like or Ground
        Ground name, a TOML file of one, an ``.npz`` file of a terrain field, or anything that gives θ and a slope at a
        position; its mode is the backend's.
    render_mode : {"rgb_array", "human"}, optional
        How :meth:`render` shows the scene.
    backend_options : mapping, optional
        For :func:`grouser.terrain.make_backend`.
    engine : {"compiled", "python"}, optional
        What computes the ticks: the compiled engine, by default wherever it has the backend and the ground, or the
        Python tick, its reference.
    **settings
        Fields of :class:`ParkingConfig`.

    Raises
    ------
    ConfigurationError
        If a name or setting is unknown.
    InvalidInputError
        If periods do not divide or a value is impossible.

    ## Version history

    v0: first version.
    """

    # The panel stands above the lot.
    _view = (66.0, (0.0, 7.5))

    def __init__(
        self,
        backend: str | ForceBackend = "native",
        vehicle: str | os.PathLike[str] | TrackedVehicle = "m113",
        terrain: str | os.PathLike[str] | Ground = "asphalt",
        *,
        render_mode: RenderMode | None = None,
        backend_options: Mapping[str, Any] | None = None,
        engine: Engine | None = None,
        **settings: Any,
    ) -> None:
        config = parking_config(settings)
        super().__init__(
            config,
            backend=backend,
            vehicle=vehicle,
            terrain=terrain,
            usual_speed=_USUAL_SPEED,
            render_mode=render_mode,
            backend_options=backend_options,
            engine=engine,
        )
        self.tolerance = config.tolerance
        self._network = spot_network()
        self._taken: FloatArray = np.zeros((0, 3))
        self._goal = np.zeros(len(GOAL_NAMES), np.float32)
        shown = OBSTACLE_PARTS * config.observed_obstacles if config.parked_vehicles else 0
        space: Any = Dict(
            {
                "observation": observation_box(11 + shown + self._terrain_size),
                "achieved_goal": observation_box(len(GOAL_NAMES)),
                "desired_goal": observation_box(len(GOAL_NAMES)),
            }
        )
        self.observation_space = space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode; ``options`` as in :class:`ParkingResetOptions`.

        The same draws are made whatever the options, so that an option changes nothing but what it names.
        """
        super().reset(seed=seed)
        chosen, config = check_parking_options(options or {}), self.config
        draw = draw_parking(self.np_random, self._network, parked=config.parked_vehicles, spread=config.start_spread)
        surroundings = self._draw_surroundings(chosen)
        if "spot" in chosen:
            spot = spot_index(chosen["spot"])
            draw = draw._replace(spot=spot, taken=tuple(each for each in draw.taken if each != spot))
        drawn = VehicleState(x=draw.x, y=draw.y, heading=float(chosen.get("heading", draw.heading)))
        state = replace(chosen.get("state", drawn), time=0.0)
        objects = lot_objects(self._network, draw, walls=config.walls)
        self._begin(self._network, objects, state, surroundings)
        self._taken = obstacle_table(objects[1 : 1 + len(draw.taken)])
        self.tolerance = config.tolerance
        x, y, heading = spot_pose(self._network, draw.spot)
        self._goal = make_goal(x, y, 0.0, 0.0, heading, OBSERVATION_BOUND)
        observation = self._observe()
        drawn_numbers = self._drawn_info(surroundings, state)
        return observation, self._goal_info(observation, failed=False) | {"crashed": False, "steps": 0} | drawn_numbers

    def step(self, action: Action) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Hold an action for one control period, or until the vehicle collides.

        Raises
        ------
        InvalidInputError
            If the action is not two numbers in [-1, 1].
        """
        given, info = self._advance(action)
        change, slip_power = self._control_costs(given, info)
        if not is_lost(info):
            info |= self._guard_info()
        observation = self._observe()
        failed = info["crashed"] or is_lost(info)
        info["reward_terms"] = terms = {
            "goal": float(self._goal_reward(*_goals_of(observation))[0]),
            "collision": -self.config.collision_weight if failed else 0.0,
            "action_change": change,
            "slip_power": slip_power,
        }
        info |= self._goal_info(observation, failed=failed)
        self._succeeded = info["is_success"]
        terminated = info["is_success"] or failed
        truncated = not terminated and self._steps >= self._most_steps
        if self.render_mode == "human":
            self.render()
        return observation, sum(terms.values()), terminated, truncated, info

    def compute_reward(self, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: Infos) -> Any:
        """Return the reward of reaching goals where others were desired.

        Every term is recomputed: the goal's from the goals, collision and control costs from ``info``.

        Parameters
        ----------
        achieved_goal, desired_goal : array_like, shape (6,) or (n, 6)
            As observed.
        info : mapping, or sequence of n mappings
            Of the step that led to ``achieved_goal``.

        Returns
        -------
        float or ndarray, shape (n,)
            Of many the same to the bit as of each alone.

        Raises
        ------
        InvalidInputError
            If the shapes do not fit, or ``info`` is not that of a step: stable-baselines3's ``HerReplayBuffer`` hands it on
            with ``copy_info_dict=True`` alone.
        """
        achieved, desired, infos = goal_pairs(achieved_goal, desired_goal, info)
        rewards = self._goal_reward(achieved, desired)
        rewards = rewards + np.where(crashed_or_lost(infos), -self.config.collision_weight, 0.0)
        # In the order in which a step sums them, so that not a bit differs.
        for term in ("action_change", "slip_power"):
            rewards = rewards + np.array([each["reward_terms"][term] for each in infos])
        return rewards if np.ndim(achieved_goal) == 2 else float(rewards[0])

    def compute_terminated(self, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: Infos) -> Any:
        """Return whether the goal is reached, or the vehicle has collided or is lost; arguments as above."""
        achieved, desired, infos = goal_pairs(achieved_goal, desired_goal, info)
        ended = within(goal_errors(achieved, desired), self.tolerance) | crashed_or_lost(infos)
        return ended if np.ndim(achieved_goal) == 2 else bool(ended[0])

    def compute_truncated(self, achieved_goal: ArrayLike, desired_goal: ArrayLike, info: Infos) -> Any:
        """Return whether the time is up and nothing else has ended the episode; arguments as above."""
        _, _, infos = goal_pairs(achieved_goal, desired_goal, info)
        late = np.array([each["steps"] >= self._most_steps for each in infos])
        truncated = late & ~np.atleast_1d(self.compute_terminated(achieved_goal, desired_goal, info))
        return truncated if np.ndim(achieved_goal) == 2 else bool(truncated[0])

    def _take_on(self, config: ParkingConfig) -> None:
        before, after = self.config.parked_vehicles, config.parked_vehicles
        if bool(before) != bool(after):
            raise ConfigurationError(
                f"parked_vehicles cannot change from {before} to {after}: observations that show obstacles and those "
                "without any have other sizes; make another environment"
            )
        super()._take_on(config)

    def _goal_reward(self, achieved: FloatArray, desired: FloatArray) -> FloatArray:
        return goal_reward(achieved, desired, self.config.reward_weights, self.config.reward_exponent)

    def _goal_info(self, observation: Observation, *, failed: bool) -> dict[str, Any]:
        errors = goal_errors(*_goals_of(observation))
        return {
            "is_success": bool(within(errors, self.tolerance)[0]) and not failed,
            "position_error": float(errors.position[0]),
            "heading_error": float(errors.heading[0]),
            "speed_error": float(errors.speed[0]),
        }

    def _observe(self) -> Observation:
        state, config = self.highway_vehicle.kinematics(), self.config
        cosine, sine = math.cos(state.heading), math.sin(state.heading)
        parts = [state.x / _POSITION_SCALE, state.y / _POSITION_SCALE, cosine, sine, *self._motion_parts(state)]
        if config.parked_vehicles:
            parts += nearest_obstacles(
                self._taken, state.x, state.y, state.heading, count=config.observed_obstacles, scale=_OBSTACLE_SCALE
            )
        vx, vy = cosine * state.vx - sine * state.vy, sine * state.vx + cosine * state.vy
        return {
            "observation": bounded(parts + self._terrain_parts(state)),
            "achieved_goal": make_goal(state.x, state.y, vx, vy, state.heading, OBSERVATION_BOUND),
            "desired_goal": self._goal.copy(),
        }


def _goals_of(observation: Observation) -> tuple[FloatArray, FloatArray]:
    return as_goals(observation["achieved_goal"]), as_goals(observation["desired_goal"])
