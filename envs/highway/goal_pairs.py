"""Goals in pairs with the infos of the steps between them, as hindsight replay hands them over."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...terrain import FloatArray, InvalidInputError
from .goal import GOAL_NAMES, as_goals
from .scene import is_lost

Info = Mapping[str, Any]
#: Of one step, or of many.
Infos = Info | Sequence[Info] | NDArray[Any]


def goal_pairs(
    achieved_goal: ArrayLike, desired_goal: ArrayLike, info: Infos
) -> tuple[FloatArray, FloatArray, Sequence[Info]]:
    """Return goals of shape (n, 6) and n infos.

    Raises
    ------
    InvalidInputError
        If there are not as many of each, or an info is not that of a step.
    """
    achieved, desired = as_goals(achieved_goal), as_goals(desired_goal)
    infos = [info] if isinstance(info, Mapping) else list(info)
    if not achieved.shape == desired.shape == (len(infos), len(GOAL_NAMES)):
        raise InvalidInputError(
            f"one info for each pair of goals: got goals of shapes {np.shape(achieved_goal)} and "
            f"{np.shape(desired_goal)}, and {len(infos)} infos"
        )
    if any("crashed" not in each or "reward_terms" not in each for each in infos):
        raise InvalidInputError(
            "the reward has terms of the step itself, and needs its info with 'crashed' and 'reward_terms': "
            "make HerReplayBuffer with copy_info_dict=True"
        )
    return achieved, desired, infos


def crashed_or_lost(infos: Sequence[Info]) -> NDArray[np.bool_]:
    """Return which steps ended in a collision or broke off, shape (n,)."""
    return np.array([bool(info["crashed"]) or is_lost(info) for info in infos], dtype=np.bool_)
