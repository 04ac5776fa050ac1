"""The environments' ids in Gymnasium's registry."""

from __future__ import annotations

from typing import Final

import gymnasium

#: Class and vector class, where there is one, of every id, each "module:name" in :mod:`grouser.envs`.
_ENVIRONMENTS: Final[dict[str, tuple[str, str | None]]] = {
    "grouser/PathTracking-v0": ("tracking:PathTrackingEnv", "vector:PathTrackingVectorEnv"),
    "grouser/SpeedTracking-v0": ("speed_tracking:SpeedTrackingEnv", "vector:SpeedTrackingVectorEnv"),
    "grouser/Parking-v0": ("highway:ParkingEnv", None),
    "grouser/OffRoad-v0": ("highway:OffRoadEnv", None),
}


def register_environments() -> None:
    """Register every ``grouser/...`` id; a second call changes nothing."""
    for name, (single, vector) in _ENVIRONMENTS.items():
        if name not in gymnasium.registry:
            gymnasium.register(
                name,
                entry_point=f"grouser.envs.{single}",
                vector_entry_point=None if vector is None else f"grouser.envs.{vector}",
            )
