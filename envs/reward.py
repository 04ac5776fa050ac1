"""A reward of your own: a function of what a control period did to every vehicle, on arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..terrain import FloatArray, InvalidInputError
from .state import VehicleState

_Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class StepView:
    """What one control period did, a row for each of n vehicles; the arrays are copies.

    A vehicle that sat the period out, since a vector environment in mode ``NextStep`` begins its next episode, is shown
    as its last one ended; its reward is 0 whatever the function says.

    Parameters
    ----------
    x, y, heading, vx, vy, yaw_rate, v_left, v_right : ndarray, shape (n,)
        The state at its end, in SI units, as :class:`~grouser.envs.VehicleState` has it.
    time : ndarray, shape (n,)
        Since the episode's start, in s.
    forces : ndarray, shape (n, 3)
        [Qx, Qy, Mz] of its last tick, in N and N m; 0 where the simulation broke off.
    actions, previous_actions : ndarray, shape (n, 2)
        In [-1, 1].
    measures : mapping of str to ndarray, shape (n,)
        What the task tells of a vehicle in ``info``, such as ``cross_track_error``, in SI units.
    terms : mapping of str to ndarray, shape (n,)
        Of the task's own reward, such as ``progress``, weighted; 0 where the simulation broke off.
    reward : ndarray, shape (n,)
        The task's own.
    terminated, truncated : ndarray of bool, shape (n,)
        Whether the episode ends.
    broken_off : ndarray of bool, shape (n,)
        Whether it ends because the simulation diverged or left the map.
    """

    x: FloatArray
    y: FloatArray
    heading: FloatArray
    vx: FloatArray
    vy: FloatArray
    yaw_rate: FloatArray
    v_left: FloatArray
    v_right: FloatArray
    time: FloatArray
    forces: FloatArray
    actions: FloatArray
    previous_actions: FloatArray
    measures: Mapping[str, FloatArray]
    terms: Mapping[str, FloatArray]
    reward: FloatArray
    terminated: _Flags
    truncated: _Flags
    broken_off: _Flags


#: Fields of a view that are those of a vehicle's state.
VIEWED_STATES: Final = ("x", "y", "heading", "vx", "vy", "yaw_rate", "v_left", "v_right", "time")

#: Returns the reward of each vehicle, shape (n,), from its own row alone.
RewardFunction = Callable[[StepView], ArrayLike]


def evaluate_reward(function: RewardFunction, view: StepView) -> FloatArray:
    """Return what a reward function says of a control period, shape (n,).

    Raises
    ------
    InvalidInputError
        If it returns another shape, or what is no finite number.
    """
    rewards = np.asarray(function(view))
    if rewards.shape != view.reward.shape or rewards.dtype.kind not in "fiub":
        raise InvalidInputError(
            f"a reward function returns numbers of shape {view.reward.shape}, one for each vehicle, got "
            f"{rewards.dtype} of shape {rewards.shape}"
        )
    finite = np.isfinite(rewards)
    if not finite.all():
        index = int(np.argmin(finite))
        raise InvalidInputError(f"a reward function returns finite numbers, got {rewards[index]} for vehicle {index}")
    return rewards.astype(np.float64)


class Outcome(NamedTuple):
    """What a control period of one vehicle came to; fields as of :class:`StepView`, forces of shape (3,)."""

    forces: FloatArray
    measures: Mapping[str, float]
    terms: Mapping[str, float]
    reward: float
    terminated: bool
    truncated: bool
    broken_off: bool


def single_view(state: VehicleState, action: FloatArray, previous_action: FloatArray, outcome: Outcome) -> StepView:
    """Return the view of one vehicle, n = 1."""
    return StepView(
        **{name: np.array([getattr(state, name)]) for name in VIEWED_STATES},
        forces=outcome.forces[None].copy(),
        actions=action[None].copy(),
        previous_actions=previous_action[None].copy(),
        measures={name: np.array([value]) for name, value in outcome.measures.items()},
        terms={name: np.array([value]) for name, value in outcome.terms.items()},
        reward=np.array([outcome.reward]),
        terminated=np.array([outcome.terminated]),
        truncated=np.array([outcome.truncated]),
        broken_off=np.array([outcome.broken_off]),
    )


def columns(names: tuple[str, ...], values: FloatArray) -> dict[str, FloatArray]:
    """Return the columns of values, shape (n, k), by name, each contiguous."""
    return dict(zip(names, np.array(values.T, order="C"), strict=True))
