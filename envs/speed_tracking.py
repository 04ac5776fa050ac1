"""``grouser/SpeedTracking-v0``: keep a commanded speed and yaw rate, whatever answers for the ground."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from ..terrain import ForceBackend, Ground, TrackedVehicle
from .rendering import RenderMode
from .reward import RewardFunction
from .speed_config import SpeedConfig, speed_config
from .speed_task import SpeedEpisode, SpeedTask
from .tracked_env import Engine, TrackedVehicleEnv


class SpeedTrackingEnv(TrackedVehicleEnv[SpeedConfig, SpeedEpisode]):
    """Keep the speed and yaw rate that a profile commands, by the belt speeds.

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
    | 5 | speed error, vx less the commanded speed | training speed |
    | 6 | yaw rate error, actual less commanded | ``yaw_rate_scale`` |
    | 7-16 | commanded speed and yaw rate .4, .8, 1.2, 1.6, 2 s ahead | training speed, ``yaw_rate_scale`` |
    | 17, 18 | previous action | 1 |
    | 19- | terrain parameters θ under the vehicle, -1 to 1 over the ``wide`` ranges | |

    ## Reward

    ``speed_weight / (1 + (e_v/σ_v)²) + yaw_rate_weight / (1 + (e_ω/σ_ω)²) − action_change_weight · |Δa|²
    − slip_power_weight · P_slip/(W v_ref)``

    with e_v and e_ω the errors at the control period's end, σ_v and σ_ω the tolerances, v_ref half the training speed,
    and P_slip ≥ 0 the power that the tracks lose to slip, as in :class:`PathTrackingEnv`. The terms are in
    ``info["reward_terms"]``.

    ## Start and end

    The vehicle starts at (0, 0) with a heading drawn over the full circle, rolling straight ahead at a share of the
    profile's first speed. The profile changes to a new speed and yaw rate every ``segment_time``, smoothly over
    ``ramp_time``. Its draws are kept within ``effort`` of what the vehicle reaches: belts at the training speed,
    lateral acceleration that the ground's strength at the start holds, belt acceleration, and ``yaw_rate_scale``;
    see :class:`SpeedResetOptions` for one of your own. With ``randomize`` the ground, the drive and the yaw inertia
    differ from episode to episode, and the profile with them; see :class:`Randomization`. An episode is truncated at
    ``time_limit``. Where a surrogate drives the simulation beyond what can be solved, it terminates with
    ``info["diverged"]``, and with ``info["off_map"]`` where the vehicle leaves a terrain field that refuses it; the
    reward of that step is −(``speed_weight`` + ``yaw_rate_weight``).

    ## Info

    As of :class:`PathTrackingEnv`, but for ``speed_error`` in m/s and ``yaw_rate_error`` in rad/s, actual less
    commanded, in place of ``cross_track_error`` and ``progress``.

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
        How :meth:`render` shows the vehicle.
    backend_options : mapping, optional
        For :func:`grouser.terrain.make_backend`, such as ``{"artifact": "mine.safetensors"}``.
    engine : {"compiled", "python"}, optional
        What simulates a control period: the compiled engine, by default wherever it has the backend and the ground, or
        the Python tick, its reference.
    reward : callable, optional
        Takes the place of the reward above: from a :class:`StepView` of n vehicles, here of one, to n numbers.
    **settings
        Fields of :class:`SpeedConfig`.

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
        *,
        render_mode: RenderMode | None = None,
        backend_options: Mapping[str, Any] | None = None,
        engine: Engine | None = None,
        reward: RewardFunction | None = None,
        **settings: Any,
    ) -> None:
        task = SpeedTask(vehicle, terrain, speed_config(settings))
        super().__init__(
            task, backend, render_mode=render_mode, backend_options=backend_options, engine=engine, reward=reward
        )
