"""The environments' ids in Gymnasium's registry."""

from __future__ import annotations

from typing import Final

import gymnasium

#: Class and vector class of every id, each "module:name" in :mod:`grouser.envs`.
_ENVIRONMENTS: Final = {
    "grouser/PathTracking-v0": ("tracking:PathTrackingEnv", "vector:PathTrackingVectorEnv"),
    "grouser/SpeedTracking-v0": ("speed_tracking:SpeedTrackingEnv", "vector:SpeedTrackingVectorEnv"),
}


def register_environments() -> None:
    """Register every ``grouser/...`` id; a second call changes nothing."""
    for name, (single, vector) in _ENVIRONMENTS.items():
        if name not in gymnasium.registry:
            gymnasium.register(name, entry_point=f"grouser.envs.{single}", vector_entry_point=f"grouser.envs.{vector}")
