"""A trained tracking policy as data: driven without the library that trained it, loaded without pickle."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path as FilePath
from typing import Any, Final

import numpy as np

from ..envs.observation import Observation, belt_command, observation_size, observe
from ..envs.path import Path
from ..envs.state import BeltCommand, VehicleState
from ..envs.tracking_config import TrackingConfig, tracking_config
from ..surrogate import NUMPY_NETWORK, DenseNetwork
from ..surrogate.container import pack, unpack
from ..terrain import (
    MODES,
    ArtifactError,
    ConfigurationError,
    FloatArray,
    Ground,
    GrouserError,
    Mode,
    TrackedVehicle,
    write_aside,
)

FORMAT_VERSION: Final = 1
_KIND: Final = "path-tracking policy"


@dataclass(frozen=True, eq=False)
class TrackingPolicy:
    """The deterministic actor of a trained path-tracking policy.

    Parameters
    ----------
    network : DenseNetwork
        Observation to action, before clipping to [-1, 1].
    vehicle : TrackedVehicle
        Vehicle that it was trained on.
    config : TrackingConfig
        Settings of the task: how observations and actions are scaled.
    recipe : Mapping
        How it was trained, as JSON can hold it.

    Raises
    ------
    ArtifactError
        If the network has other inputs or outputs than the task.
    """

    network: DenseNetwork
    vehicle: TrackedVehicle
    config: TrackingConfig
    recipe: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        inputs, outputs = self.network.widths[0], self.network.widths[-1]
        expected = sorted({observation_size(mode, self.config) for mode in MODES})
        if inputs not in expected or outputs != 2:
            raise ArtifactError(
                f"a path-tracking policy of these settings takes {' or '.join(map(str, expected))} numbers and returns "
                f"2, got {inputs} and {outputs}"
            )

    def act(self, observation: Observation) -> FloatArray:
        """Return the action in [-1, 1]², shape (2,), for an observation."""
        action: FloatArray = self.network.forward(NUMPY_NETWORK, observation.astype(np.float64))
        return np.clip(action, -1.0, 1.0)

    def require(self, mode: Mode) -> TrackingPolicy:
        """Return the policy itself, if it sees on ground of this mode what it was trained to see.

        Raises
        ------
        ConfigurationError
            If it observes terrain parameters of the other mode.
        """
        takes, given = self.network.widths[0], observation_size(mode, self.config)
        if takes != given:
            raise ConfigurationError(
                f"the policy observes the terrain and was trained on another mode than {mode}: "
                f"it takes {takes} numbers, this ground gives {given}"
            )
        return self

    def save(self, path: str | os.PathLike[str]) -> FilePath:
        """Write the policy as one sealed ``.safetensors`` file."""
        tensors: dict[str, Any] = {}
        for layer, (weights, bias) in enumerate(zip(self.network.weights, self.network.biases, strict=True)):
            tensors |= {f"actor.{layer}.weights": weights, f"actor.{layer}.biases": bias}
        return write_aside(FilePath(path), pack(tensors, self._metadata()))

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> TrackingPolicy:
        """Read a policy, checking that it is whole and unaltered.

        Raises
        ------
        ArtifactError
            If there is no such file, or it is truncated, altered, or not a policy.
        """
        try:
            data = FilePath(path).read_bytes()
        except OSError as error:
            raise ArtifactError(f"cannot read policy {str(path)!r}: {error.strerror}") from error
        tensors, metadata = unpack(data, str(path), FORMAT_VERSION)
        try:
            if metadata["kind"] != _KIND:
                raise ArtifactError(f"it is a {metadata['kind']}")
            layers = range(metadata["actor"]["layers"])
            return cls(
                DenseNetwork(
                    metadata["actor"]["activation"],
                    tuple(tensors[f"actor.{i}.weights"] for i in layers),
                    tuple(tensors[f"actor.{i}.biases"] for i in layers),
                ),
                TrackedVehicle.from_dict(metadata["vehicle"]),
                tracking_config(metadata["config"]),
                metadata["recipe"],
            )
        except (KeyError, TypeError, GrouserError) as error:
            raise ArtifactError(f"{str(path)!r} does not hold a path-tracking policy: {error}") from error

    def _metadata(self) -> dict[str, Any]:
        return {
            "format_version": FORMAT_VERSION,
            "kind": _KIND,
            "actor": {"activation": self.network.activation, "layers": len(self.network.weights)},
            "vehicle": self.vehicle.to_dict(),
            "config": asdict(self.config),
            "recipe": dict(self.recipe),
        }


class PolicyDriver:
    """Lets a policy drive a bare simulator: a :class:`~grouser.envs.Driver`.

    Parameters
    ----------
    policy : TrackingPolicy
        Called once a control period of its own task.
    path : Path
        The path.
    ground : Ground
        Looked at only by a policy that observes the terrain.

    Raises
    ------
    ConfigurationError
        If the policy observes the terrain and was trained in the other mode.
    """

    def __init__(self, policy: TrackingPolicy, path: Path, ground: Ground) -> None:
        self.policy: Final = policy.require(ground.mode)
        self.path: Final = path
        self.ground: Final = ground
        self.reset()

    @property
    def period(self) -> float:
        """The control period in s that the policy was trained at."""
        return self.policy.config.control_period

    def reset(self) -> None:
        """Forget the last drive."""
        self._near: float | None = None
        self._action: FloatArray = np.zeros(2)

    def command(self, state: VehicleState) -> BeltCommand:
        """Return the belt-speed command for the state."""
        foot = self.path.project(state.x, state.y, near=self._near, heading=state.heading)
        self._near = foot.arc_length
        observation = observe(
            state,
            foot,
            self._action,
            vehicle=self.policy.vehicle,
            path=self.path,
            config=self.policy.config,
            ground=self.ground,
        )
        self._action = self.policy.act(observation)
        return belt_command(self._action, self.policy.vehicle, self.policy.config)
