"""A path-tracking policy at the wheel of a bare simulator."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from ...envs.observation import belt_command, observe
from ...envs.path import Path
from ...envs.state import BeltCommand, VehicleState
from ...envs.tracking_config import TrackingConfig, tracking_config
from ...terrain import FloatArray, Ground, TrackedVehicle
from .policy import Policy

_TASK: Final = "grouser/PathTracking-v0"


class PolicyDriver:
    """Lets a policy drive a bare simulator: a :class:`~grouser.envs.Driver`.

    Parameters
    ----------
    policy : Policy
        Of ``grouser/PathTracking-v0``; called once a control period of its own task.
    path : Path
        The path.
    ground : Ground
        Looked at only by a policy that observes the terrain.

    Raises
    ------
    ConfigurationError
        If the policy is of another task, or observes the terrain and was trained in the other mode.
    """

    def __init__(self, policy: Policy, path: Path, ground: Ground) -> None:
        facts: dict[str, Any] = dict(policy.environment)
        self.policy: Final = policy.require(facts | {"id": _TASK, "mode": ground.mode})
        self.path: Final = path
        self.ground: Final = ground
        self.vehicle: Final = TrackedVehicle.from_dict(facts["vehicle"])
        self.config: Final[TrackingConfig] = tracking_config(facts["settings"])
        self.reset()

    @property
    def period(self) -> float:
        """The control period in s that the policy was trained at."""
        return self.config.control_period

    def reset(self) -> None:
        """Forget the last drive."""
        self._near: float | None = None
        self._action: FloatArray = np.zeros(2)

    def command(self, state: VehicleState) -> BeltCommand:
        """Return the belt-speed command for the state."""
        foot = self.path.project(state.x, state.y, near=self._near, heading=state.heading)
        self._near = foot.arc_length
        observation = observe(
            state, foot, self._action, vehicle=self.vehicle, path=self.path, config=self.config, ground=self.ground
        )
        self._action = self.policy.act(observation).astype(np.float64)
        return belt_command(self._action, self.vehicle, self.config)
