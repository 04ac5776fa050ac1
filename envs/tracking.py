"""``grouser/PathTracking-v0``: keep a tracked vehicle on a path, whatever answers for the ground."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

import gymnasium
import numpy as np
from numpy.typing import NDArray

from ..terrain import (
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
    resolve_ground,
    resolve_vehicle,
    unknown_name,
)
from ..terrain.parameters import require_in
from .footing import require_covered, sample_ground, track_forces_on
from .observation import OBSERVATION_BOUND, Observation, belt_command, observation_size, observe, reference_speed
from .path import Path, Projection
from .paths import make_path
from .rendering import Renderer, RenderMode
from .rollout import whole_ratio
from .simulator import Simulator, TickRecord
from .state import VehicleState
from .tracking_config import ResetOptions, check_reset_options, tracking_config

# Cells of the block that the slip power is taken from, whatever the backend: a plain network has no track forces.
_SLIP_POWER_CELLS: Final = (2, 1)


class PathTrackingEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """Keep a tracked vehicle on a path by its belt speeds.

    ## Action space

    ``Box(-1, 1, (2,), float32)``, held for one control period.

    | mode | action[0] | action[1] |
    |---|---|---|
    | ``belts`` | left belt speed / training speed | right belt speed / training speed |
    | ``twist`` | speed / training speed | yaw rate / ``yaw_rate_scale``; belts saturate at the training speed |

    ## Observation space

    ``Box(-10, 10, (19,), float32)``, three or four longer with ``observe_terrain``.

    | index | part | scale |
    |---|---|---|
    | 0, 1 | vx, vy | training speed |
    | 2 | yaw rate | ``yaw_rate_scale`` |
    | 3, 4 | v_left, v_right | training speed |
    | 5 | cross-track error, positive to the left of the path | ``maximum_cross_track`` |
    | 6 | heading error | π |
    | 7-16 | x, y of the path .4, .8, 1.2, 1.6, 2 s ahead at reference speed, body frame | distance of the last |
    | 17, 18 | previous action | 1 |
    | 19- | terrain parameters θ under the vehicle, -1 to 1 over the ``wide`` ranges | |

    ## Reward

    ``progress_weight · min(p, 2 − p) − cross_track_weight · (e/2 m)² − action_change_weight · |Δa|²
    − slip_power_weight · P_slip/(W v_ref)``

    with p = Δs/(v_ref Δt) the progress along the path over that at reference speed, e the cross-track error, and P_slip ≥ 0 the power that the tracks lose to
    slip: belt power less the power that reaches the body, without rolling resistance, from the block at 2 × 1 cells an
    element on every backend. The terms are in ``info["reward_terms"]``.

    ## Start and end

    The vehicle starts near the path's start (with ``random_start``, anywhere on it), rolling along it; see :class:`ResetOptions`. An episode terminates
    beyond ``maximum_cross_track`` or at the path's end (one lap of a closed path), and is truncated at
    ``time_limit``. Where a surrogate drives the simulation beyond what can be solved, it terminates with
    ``info["diverged"]`` and the reward of standing at ``maximum_cross_track``, less the weight of progress; and with
    ``info["off_map"]`` and the same reward where the vehicle leaves a terrain field that refuses it.

    ## Info

    All of the last tick of the control period: ``force`` [Qx, Qy, Mz], ``backend`` that answered (of a guard: its primary's or fallback's name),
    ``cross_track_error`` in m, ``progress`` in m, ``reward_terms``; ``track_forces`` and ``sprocket_power`` (W) where
    the backend knows the tracks apart; ``ood_score`` and ``fallback_weight`` with a guard.

    Parameters
    ----------
    backend : str or ForceBackend
        ``"physics"``, ``"torch"``, ``"native"``, ``"guarded"``, a registered name, or a backend.
    vehicle : str, path-like or TrackedVehicle
        Preset name, catalogue file or vehicle.
    terrain : str, path-like or Ground
        Ground name, a TOML file of one, an ``.npz`` file of a terrain field, or anything that gives θ and a slope at a
        position; its mode is the backend's.
    path : str or Path
        ``straight``, ``circle``, ``sine``, ``figure-eight``, ``iso-3888-1``, a CSV file of x, y, or a path.
    render_mode : {"rgb_array", "human"}, optional
        How :meth:`render` shows the vehicle.
    backend_options : mapping, optional
        For :func:`grouser.terrain.make_backend`, such as ``{"artifact": "mine.safetensors"}``.
    **settings
        Fields of :class:`TrackingConfig`.

    Raises
    ------
    ConfigurationError
        If a name or setting is unknown.
    InvalidInputError
        If periods do not divide or a value is impossible.

    ## Version history

    v0: first version.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - as Gymnasium declares it
        "render_modes": ["rgb_array", "human"],
        "render_fps": 10,
    }

    def __init__(
        self,
        backend: str | ForceBackend = "native",
        vehicle: str | os.PathLike[str] | TrackedVehicle = "m113",
        terrain: str | os.PathLike[str] | Ground = "asphalt",
        path: str | os.PathLike[str] | Path = "iso-3888-1",
        *,
        render_mode: RenderMode | None = None,
        backend_options: Mapping[str, Any] | None = None,
        **settings: Any,
    ) -> None:
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise unknown_name("render mode", render_mode, self.metadata["render_modes"])
        self.config: Final = tracking_config(settings)
        self.vehicle: Final = resolve_vehicle(vehicle)
        self.path: Final = path if isinstance(path, Path) else make_path(path, self.vehicle)
        self._ground: Ground = self._sloped(terrain)
        built = make_backend(backend, mode=self._ground.mode, vehicle=self.vehicle, **(backend_options or {}))
        self.simulator: Final = Simulator(
            self.vehicle,
            built,
            self._ground,
            tick=self.config.tick,
            integrator=self.config.integrator,
            ground_sampling=self.config.ground_sampling,
        )
        self._ticks = whole_ratio(self.config.control_period, self.config.tick, "control_period and tick")
        self._steps = whole_ratio(self.config.time_limit, self.config.control_period, "time_limit and control_period")
        self.reference_speed: Final = reference_speed(self.vehicle, self.config)
        self._slip_block = PhysicsBackend(self.vehicle, built.mode, cells=_SLIP_POWER_CELLS)
        self.render_mode = render_mode
        # Gymnasium widens render_mode to any string.
        self._draw_mode = render_mode
        self._renderer: Renderer | None = None
        self.metadata = self.metadata | {"render_fps": round(1 / self.config.control_period)}
        size = observation_size(built.mode, self.config)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)
        self.observation_space = gymnasium.spaces.Box(-OBSERVATION_BOUND, OBSERVATION_BOUND, (size,), np.float32)
        self._action = np.zeros(2)
        self._foot = self.path.project(*self.path.point_at(0.0), near=0.0)
        self._start = 0.0
        self._step_count = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode; ``options`` as in :class:`ResetOptions`.

        The same draws are made whatever the options, so that an option changes nothing but what it names.
        """
        super().reset(seed=seed)
        chosen = check_reset_options(options or {})
        self._check_reach(chosen)
        lateral, heading, share, along = self.np_random.uniform(-1.0, 1.0, size=4)
        lateral = chosen.get("lateral_offset", self.config.lateral_spread * lateral)
        heading = chosen.get("heading_offset", self.config.heading_spread * heading)
        lowest = self.config.lowest_start_speed
        speed = chosen.get("speed", self.reference_speed * (lowest + (1 - lowest) * (share + 1) / 2))
        drawn_start = self.path.length * (along + 1) / 2 if self.config.random_start else 0.0
        arc_length = float(chosen.get("arc_length", drawn_start))
        x, y = self.path.point_at(arc_length)
        direction = self.path.heading_at(arc_length)
        drawn = VehicleState.rolling(
            float(speed),
            x=x - float(lateral) * math.sin(direction),
            y=y + float(lateral) * math.cos(direction),
            heading=direction + float(heading),
        )
        state = chosen.get("state", drawn)
        ground = self._sloped(chosen["terrain"]) if "terrain" in chosen else self._ground
        # Before anything changes: a start off the map is refused, and the last episode stays.
        sample_ground(ground, self.vehicle, self.config.ground_sampling, x=state.x, y=state.y, heading=state.heading)
        self.simulator.set_ground(ground)
        self.simulator.set_state(replace(state, time=0.0))
        near = None if "state" in chosen else arc_length
        self._foot = self.path.project(state.x, state.y, near=near, heading=state.heading)
        self._start = self._foot.arc_length
        self._step_count = 0
        self._action = np.zeros(2)
        if self._renderer is not None:
            self._renderer.reset()
        if self.render_mode == "human":
            self.render()
        return self._observation(), {"cross_track_error": self._foot.cross_track, "progress": 0.0}

    def _sloped(self, terrain: str | os.PathLike[str] | Ground) -> Ground:
        """Return the ground on the configured slope, once its map is seen to reach as far as an episode can."""
        ground = resolve_ground(terrain)
        overshoot = self.vehicle.maximum_speed * self.config.control_period + self.vehicle.tread
        require_covered(ground, self.path, self.config.maximum_cross_track + overshoot)
        if self.config.grade == 0 and self.config.bank == 0:
            return ground
        return SlopedGround(ground, self.config.grade, self.config.bank)

    def _check_reach(self, options: ResetOptions) -> None:
        fastest, widest, longest = self.vehicle.maximum_speed, self.config.maximum_cross_track, self.path.length
        require_in("reset option speed", options.get("speed", 0.0), -fastest, fastest)
        require_in("reset option lateral_offset", options.get("lateral_offset", 0.0), -widest, widest)
        require_in("reset option arc_length", options.get("arc_length", 0.0), -longest, longest)

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Hold an action for one control period.

        Raises
        ------
        InvalidInputError
            If the action is not two numbers in [-1, 1].
        """
        checked = np.asarray(action, dtype=np.float64)
        if checked.shape != (2,) or not np.all(np.abs(checked) <= 1.0):
            raise InvalidInputError(f"an action is two numbers in [-1, 1], got {action!r}")
        command = belt_command(checked, self.vehicle, self.config)
        try:
            for _ in range(self._ticks):
                record = self.simulator.step(command)
        except SimulationDivergedError:
            return self._broken_off(checked, "diverged")
        except OffMapError:
            return self._broken_off(checked, "off_map")
        foot = self.path.project(record.state.x, record.state.y, near=self._foot.arc_length)
        terms = self._reward_terms(checked, foot, record)
        self._foot, self._action = foot, checked
        self._step_count += 1
        progress = foot.arc_length - self._start
        finished = progress >= self.path.length if self.path.closed else foot.arc_length >= self.path.length
        terminated = bool(finished or abs(foot.cross_track) > self.config.maximum_cross_track)
        truncated = not terminated and self._step_count >= self._steps
        if self.render_mode == "human":
            self.render()
        info = self._info(record) | {"reward_terms": terms, "progress": progress}
        return self._observation(), sum(terms.values()), terminated, truncated, info

    def _broken_off(self, action: FloatArray, why: str) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """End the episode where the last solved tick left the vehicle: one bad episode must not end a training."""
        self._action = action
        self._step_count += 1
        state = self.simulator.get_state()
        self._foot = self.path.project(state.x, state.y, near=self._foot.arc_length)
        info = {why: True, "cross_track_error": self._foot.cross_track}
        worst = self.config.cross_track_weight * (self.config.maximum_cross_track / 2.0) ** 2
        return self._observation(), -self.config.progress_weight - worst, True, False, info

    def render(self) -> NDArray[np.uint8] | None:
        """Show the vehicle from above: an image (height, width, 3), or a window."""
        if self._draw_mode is None:
            gymnasium.logger.warn("render() without a render_mode: pass render_mode='rgb_array' to gymnasium.make")
            return None
        if self._renderer is None:
            self._renderer = Renderer(self.path, self.vehicle, self._draw_mode, fps=self.metadata["render_fps"])
        return self._renderer.draw(self.simulator.get_state(), label=self.simulator.backend.name)

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _observation(self) -> Observation:
        return observe(
            self.simulator.get_state(),
            self._foot,
            self._action,
            vehicle=self.vehicle,
            path=self.path,
            config=self.config,
            ground=self.simulator.ground,
        )

    def _reward_terms(self, action: NDArray[np.float64], foot: Projection, record: TickRecord) -> dict[str, float]:
        config = self.config
        full_progress = self.reference_speed * config.control_period
        progress = (foot.arc_length - self._foot.arc_length) / full_progress
        change = action - self._action
        power_scale = self.vehicle.weight * self.reference_speed
        return {
            "progress": config.progress_weight * min(progress, 2.0 - progress),
            "cross_track": -config.cross_track_weight * (foot.cross_track / 2.0) ** 2,
            "action_change": -config.action_change_weight * float(change @ change),
            "slip_power": -config.slip_power_weight * self._slip_power(record) / power_scale,
        }

    def _slip_power(self, record: TickRecord) -> float:
        """Return VtL F_L + VtR F_R − (Qx Vx + Qy Vy + Mz ω) of the shear forces, in W."""
        tracks = track_forces_on(record.footing, self._slip_block, record.row, rolling=False)
        belt_power = float(record.row[5:7] @ tracks[:, 0])
        return belt_power - float(record.row[:3] @ tracks.sum(axis=0))

    def _info(self, record: TickRecord) -> dict[str, Any]:
        backend = self.simulator.backend
        info: dict[str, Any] = {
            "force": record.forces.copy(),
            "backend": backend.name,
            "cross_track_error": self._foot.cross_track,
        }
        if backend.has_track_forces:
            shear = track_forces_on(record.footing, backend, record.row, rolling=False)
            info |= {
                "track_forces": track_forces_on(record.footing, backend, record.row),
                "sprocket_power": float(record.row[5:7] @ shear[:, 0]),
            }
        if isinstance(backend, GuardedBackend) and record.detection is not None:
            guard = record.state.guard
            active = backend.primary if guard.mode is GuardMode.PRIMARY else backend.fallback
            info |= {
                "backend": active.name,
                "ood_score": record.detection.score,
                "fallback_weight": guard.fallback_weight,
            }
        return info
