"""Pure pursuit in ``grouser/PathTracking-v0``, and its settings searched on physics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from grouser.controllers import PurePursuit, PurePursuitConfig, SlipParameters, identify_slip
from grouser.controllers.rl import EpisodeResult
from grouser.controllers.rl.episode import Agent
from grouser.controllers.rl.evaluation import judge_episode
from grouser.envs import PathTrackingEnv
from grouser.terrain import named

# The slip model is that of the ground; the search may still weaken what it adds to the turn.
_LOOKAHEAD_TIMES: Final = (0.5, 0.6, 0.7, 0.8, 0.9, 1.1)
_PROPORTIONAL: Final = (0.5, 1.0, 2.0)
_INTEGRAL: Final = (0.0, 0.5)
_YAW_GAIN_SHARES: Final = (1.0, 1.15)


@dataclass(frozen=True)
class Pursuit:
    """Pure pursuit as it is set.

    Parameters
    ----------
    config : PurePursuitConfig
        Settings.
    slip : SlipParameters
        Losses that it makes up for.
    """

    config: PurePursuitConfig
    slip: SlipParameters


@dataclass(frozen=True)
class Drives:
    """Episodes, one a seed.

    Parameters
    ----------
    returns, cross_track_rmse : ndarray, shape (n,)
        Of each.
    lengths : ndarray, shape (n,)
        Steps.
    """

    returns: np.ndarray
    cross_track_rmse: np.ndarray
    lengths: np.ndarray


def drive(environment: PathTrackingEnv, agent: Agent, seeds: Sequence[int]) -> Drives:
    """Drive whole episodes."""
    return _drives([judge_episode(agent, environment, seed) for seed in seeds])


def pursue(environment: PathTrackingEnv, pursuit: Pursuit, seeds: Sequence[int]) -> Drives:
    """Drive whole episodes by pure pursuit, at the speed at which progress earns most.

    Parameters
    ----------
    environment : PathTrackingEnv
        Of either action mode.
    pursuit : Pursuit
        The settings.
    seeds : sequence of int
        Of the resets.
    """
    return _drives([judge_episode(_Pursuer(environment, pursuit), environment, seed) for seed in seeds])


class _Pursuer:
    """Pure pursuit as an agent of one episode.

    It follows the environment's state, which no observation holds. Its belt speeds are handed over as actions, so that
    every driver pays for the same action changes.
    """

    def __init__(self, environment: PathTrackingEnv, pursuit: Pursuit) -> None:
        self._environment = environment
        self._driver = PurePursuit(
            environment.path, environment.vehicle, environment.reference_speed, slip=pursuit.slip, config=pursuit.config
        )

    def act(self, _: Any) -> NDArray[np.float32]:
        environment = self._environment
        command = self._driver.command(environment.simulator.get_state())
        action = np.array([command.left, command.right]) / environment.vehicle.training_speed
        if environment.config.action_mode == "twist":
            yaw_rate = (command.right - command.left) / environment.vehicle.tread
            action = np.array([action.mean(), yaw_rate / environment.config.yaw_rate_scale])
        return np.clip(action, -1, 1).astype(np.float32)


def _drives(episodes: Sequence[EpisodeResult]) -> Drives:
    return Drives(
        np.array([episode.episode_return for episode in episodes]),
        np.array([episode.measures["cross_track_error_rmse"] for episode in episodes]),
        np.array([episode.length for episode in episodes]),
    )


def tuned(environment: PathTrackingEnv, terrain: str, seeds: Sequence[int]) -> dict[str, Pursuit]:
    """Return the settings of the smallest cross-track RMSE and those of the largest return over the seeds.

    Parameters
    ----------
    environment : PathTrackingEnv
        On physics.
    terrain : str
        Ground that the slip parameters are identified on.
    seeds : sequence of int
        None of those that are judged.
    """
    slip = identify_slip(environment.vehicle, named(terrain), environment.simulator.backend)
    found = []
    for lookahead, proportional, integral, share in product(
        _LOOKAHEAD_TIMES, _PROPORTIONAL, _INTEGRAL, _YAW_GAIN_SHARES
    ):
        config = PurePursuitConfig(
            lookahead_time=lookahead, lookahead_minimum=0.8, proportional=proportional, integral=integral
        )
        pursuit = Pursuit(config, replace(slip, yaw_gain=min(1.0, share * slip.yaw_gain)))
        driven = pursue(environment, pursuit, seeds)
        found.append((float(driven.cross_track_rmse.mean()), float(driven.returns.mean()), pursuit))
    return {
        "pure pursuit, tuned for cross-track RMSE": min(found, key=lambda entry: entry[0])[2],
        "pure pursuit, tuned for return": max(found, key=lambda entry: entry[1])[2],
    }
