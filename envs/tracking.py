"""``grouser/PathTracking-v0``: keep a tracked vehicle on a path, whatever answers for the ground."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, Final

from ..terrain import ForceBackend, Ground, TrackedVehicle
from .path import Path
from .path_task import PathEpisode, PathTask
from .rendering import RenderMode
from .reward import RewardFunction
from .tracked_env import Engine, TrackedVehicleEnv
from .tracking_config import TrackingConfig, tracking_config


class PathTrackingEnv(TrackedVehicleEnv[TrackingConfig, PathEpisode]):
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

    with p = Δs/(v_ref Δt) the progress along the path over that at reference speed, e the cross-track error, and
    P_slip ≥ 0 the power that the tracks lose to slip: belt power less the power that reaches the body, without rolling
    resistance, from the block at 2 × 1 cells an element on every backend. The terms are in ``info["reward_terms"]``.

    ## Start and end

    The vehicle starts near the path's start (with ``random_start``, anywhere on it), rolling along it; see
    :class:`ResetOptions`. With ``randomize`` the ground, the drive and the yaw inertia differ from episode to episode;
    see :class:`Randomization`. An episode terminates beyond ``maximum_cross_track`` or at the path's end (one lap of a
    closed path), and is truncated at ``time_limit``. Where a surrogate drives the simulation beyond what can be solved,
    it terminates with ``info["diverged"]`` and the reward of standing at ``maximum_cross_track``, less the weight of
    progress; and with ``info["off_map"]`` and the same reward where the vehicle leaves a terrain field that refuses it.

    ## Info

    | key | of the last tick of a control period | where |
    |---|---|---|
    | ``cross_track_error``, ``progress`` | in m | always, at reset too |
    | ``reward_terms`` | by name, weighted | unless the simulation broke off |
    | ``force`` | [Qx, Qy, Mz] in N and N m | unless the simulation broke off |
    | ``backend`` | that answered; of a guard its primary's or fallback's name | unless the simulation broke off |
    | ``track_forces``, ``sprocket_power`` | [Fx, Fy, M] of each track; W | backends that know the tracks apart |
    | ``ood_score``, ``fallback_weight`` | of the guard | with a guard |
    | ``diverged``, ``off_map`` | True | where the simulation broke off |
    | ``randomization`` | θ at the start, drive and yaw inertia, in SI units | at reset, with ``randomize`` |

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
    engine : {"compiled", "python"}, optional
        What simulates a control period: the compiled engine, by default wherever it has the backend and the ground, or
        the Python tick, its reference.
    reward : callable, optional
        Takes the place of the reward above: from a :class:`StepView` of n vehicles, here of one, to n numbers.
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

    def __init__(
        self,
        backend: str | ForceBackend = "native",
        vehicle: str | os.PathLike[str] | TrackedVehicle = "m113",
        terrain: str | os.PathLike[str] | Ground = "asphalt",
        path: str | os.PathLike[str] | Path = "iso-3888-1",
        *,
        render_mode: RenderMode | None = None,
        backend_options: Mapping[str, Any] | None = None,
        engine: Engine | None = None,
        reward: RewardFunction | None = None,
        **settings: Any,
    ) -> None:
        task = PathTask(vehicle, terrain, tracking_config(settings), path)
        self.path: Final = task.path
        self.reference_speed: Final = task.reference_speed
        super().__init__(
            task, backend, render_mode=render_mode, backend_options=backend_options, engine=engine, reward=reward
        )
