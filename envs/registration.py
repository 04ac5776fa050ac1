"""The environments' ids in Gymnasium's registry."""

from __future__ import annotations

import gymnasium


def register_environments() -> None:
    """Register every ``grouser/...`` id; a second call changes nothing."""
    if "grouser/PathTracking-v0" not in gymnasium.registry:
        gymnasium.register("grouser/PathTracking-v0", entry_point="grouser.envs.tracking:PathTrackingEnv")
