"""An environment as data: its id and its arguments, from which single, batched and stable-baselines3 ones are made."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import closing
from dataclasses import asdict, dataclass, field, replace
from inspect import signature
from typing import TYPE_CHECKING, Any, Final

import gymnasium
from gymnasium.vector import AutoresetMode
from numpy.typing import ArrayLike

from ...envs.batch import Batch
from ...envs.disturbances import Delay
from ...envs.sb3 import make_sb3_vec_env
from ...envs.tracked_env import TrackedVehicleEnv
from ...envs.vector import TrackedVehicleVectorEnv
from ...envs.wrappers import ActionDelay, ObservationNoise
from ...terrain import (
    ConfigurationError,
    GrouserError,
    InvalidInputError,
    TrackedVehicle,
    missing_extra,
    resolve_vehicle,
    unknown_name,
)

if TYPE_CHECKING:
    from stable_baselines3.common.vec_env import VecEnv

_NAMESPACE: Final = "grouser/"
_DEFAULTED: Final = ("backend", "vehicle", "terrain", "path")
#: Settings that say what an observation or an action means.
_MEANING: Final = (
    "action_mode",
    "control_period",
    "maximum_cross_track",
    "observe_terrain",
    "reference_speed",
    "top_speed",
    "yaw_rate_scale",
)


def environment_ids() -> tuple[str, ...]:
    """Ids of grouser's environments, sorted."""
    return tuple(sorted(id for id in gymnasium.registry if id.startswith(_NAMESPACE)))


def short_name(id: str) -> str:
    """Return an id as files are called after: ``path-tracking`` for ``grouser/PathTracking-v0``."""
    name = id.removeprefix(_NAMESPACE).rsplit("-v", 1)[0]
    return "".join(f"-{letter.lower()}" if letter.isupper() else letter for letter in name).lstrip("-")


def environment_id(name: str) -> str:
    """Return the id of an environment that is given by its id, ``PathTracking-v0`` or ``path-tracking``.

    Raises
    ------
    ConfigurationError
        If there is none of that name.
    """
    for id in environment_ids():
        if name in (id, id.removeprefix(_NAMESPACE), short_name(id)):
            return id
    raise unknown_name("environment", name, [short_name(id) for id in environment_ids()])


@dataclass(frozen=True)
class EnvironmentSpec:
    """An environment and its arguments.

    Parameters
    ----------
    id : str
        Such as ``"grouser/PathTracking-v0"``.
    arguments : mapping
        Keyword arguments of the environment: ``backend``, ``vehicle``, ``terrain``, settings, ``backend_options``.
    """

    id: str
    arguments: Mapping[str, Any] = field(default_factory=dict)

    def changed(self, **changes: Any) -> EnvironmentSpec:
        """Return the same environment with other arguments."""
        return replace(self, arguments={**self.arguments, **changes})

    def make(self, render_mode: str | None = None) -> gymnasium.Env[Any, Any]:
        """Return a single environment."""
        return gymnasium.make(self.id, render_mode=render_mode, disable_env_checker=True, **self.arguments)

    def make_batch(self, count: int, threads: int = 1) -> Batch[Any, Any] | None:
        """Return the compiled batch of this environment; None where the task, backend or ground has none."""
        if not _has_vector_class(self.id):
            return None
        try:
            vector = gymnasium.make_vec(
                self.id,
                num_envs=count,
                vectorization_mode="vector_entry_point",
                autoreset_mode=AutoresetMode.SAME_STEP,
                threads=threads,
                **self.arguments,
            )
        except ConfigurationError:
            self.make().close()
            return None
        return vector.batch if isinstance(vector, TrackedVehicleVectorEnv) else None

    def make_disturbed(
        self, observation_noise: ArrayLike | None = None, action_delay: Delay | None = None
    ) -> gymnasium.Env[Any, Any]:
        """Return a single environment with noise on what is observed and delay of what is commanded, where given.

        Raises
        ------
        ConfigurationError
            If its spaces take none.
        InvalidInputError
            If the noise or the delay is impossible.
        """
        made = self.make()
        if action_delay is not None:
            made = ActionDelay(made, action_delay)
        return made if observation_noise is None else ObservationNoise(made, observation_noise)

    def make_vec_env(
        self,
        count: int,
        threads: int = 1,
        *,
        observation_noise: ArrayLike | None = None,
        action_delay: Delay | None = None,
    ) -> VecEnv:
        """Return stable-baselines3's environment: the compiled batch, or single environments stepped in turn.

        Parameters
        ----------
        count : int
            Number of environments.
        threads : int
            That share the batch.
        observation_noise, action_delay : optional
            As :class:`~grouser.envs.ObservationNoise` and :class:`~grouser.envs.ActionDelay` take them.

        Raises
        ------
        ConfigurationError
            If stable-baselines3 is not installed, a name or setting is unknown, or the spaces take no noise or delay.
        InvalidInputError
            If the noise or the delay is impossible.
        """
        try:
            from stable_baselines3.common.monitor import Monitor
            from stable_baselines3.common.vec_env import DummyVecEnv
        except ImportError as error:
            raise missing_extra("stable-baselines3", "rl") from error
        if _has_vector_class(self.id):
            try:
                return make_sb3_vec_env(
                    self.id,
                    count,
                    observation_noise=observation_noise,
                    action_delay=action_delay,
                    threads=threads,
                    **self.arguments,
                )
            except ConfigurationError:
                # What is wrong with the arguments is wrong for a single environment too; what is not compiled is not.
                self.make().close()
        return DummyVecEnv(
            [lambda: Monitor(self.make_disturbed(observation_noise, action_delay)) for _ in range(count)]
        )

    def facts(self) -> dict[str, Any]:
        """Return what a policy has to know of the environment that it was trained in, as JSON can hold it.

        ``id``, ``arguments`` with those of ground, path, vehicle and backend that were left out and without
        ``backend_options``, and of grouser's environments the resolved ``settings``,
        ``vehicle``, ground ``mode``, and ``backend`` as it describes itself.

        Raises
        ------
        InvalidInputError
            If JSON cannot hold an argument.
        """
        with closing(self.make()) as environment:
            facts = _facts_of(self, environment.unwrapped)
        try:
            return dict(json.loads(json.dumps(facts, allow_nan=False)))
        except (TypeError, ValueError) as error:
            raise InvalidInputError(
                f"arguments of the environment must be names, files and numbers, but for backend_options: {error}"
            ) from error


def _facts_of(spec: EnvironmentSpec, inner: Any) -> dict[str, Any]:
    parameters = signature(type(inner).__init__).parameters
    arguments = {name: parameters[name].default for name in _DEFAULTED if name in parameters}
    arguments |= {key: value for key, value in spec.arguments.items() if key != "backend_options"}
    vehicle = arguments.get("vehicle")
    if isinstance(vehicle, TrackedVehicle):
        arguments["vehicle"] = vehicle.name
    facts: dict[str, Any] = {"id": spec.id, "arguments": arguments}
    if spec.id.startswith(_NAMESPACE):
        backend = inner.simulator.backend if isinstance(inner, TrackedVehicleEnv) else inner.backend
        facts |= {
            "settings": asdict(inner.config),
            "vehicle": inner.vehicle.to_dict(),
            "mode": backend.mode,
            "backend": backend.describe(),
        }
    return facts


def require_same_task(trained: Mapping[str, Any], facts: Mapping[str, Any]) -> None:
    """Check that what is observed and what is acted on in an environment mean what they meant in training.

    Parameters
    ----------
    trained, facts : mapping
        :meth:`EnvironmentSpec.facts` of both.

    Raises
    ------
    ConfigurationError
        If the environment is another, or differs in a setting that scales observations or actions.
    """
    if trained["id"] != facts["id"]:
        raise ConfigurationError(f"the policy was trained in {trained['id']}, not in {facts['id']}")
    before, now = trained.get("settings", {}), facts.get("settings", {})
    differing = [
        f"{name} {before[name]!r}, here {now[name]!r}"
        for name in _MEANING
        if name in before and name in now and before[name] != now[name]
    ]
    if differing:
        raise ConfigurationError(f"the policy was trained with {'; '.join(differing)}")
    if before.get("observe_terrain") and trained["mode"] != facts["mode"]:
        raise ConfigurationError(
            f"the policy observes the terrain and was trained on another mode than {facts['mode']}: {trained['mode']}"
        )


def trained_vehicle(facts: Mapping[str, Any]) -> TrackedVehicle:
    """Return the vehicle of a training: the preset where it is still the same, which knows its hull too.

    Parameters
    ----------
    facts : mapping
        :meth:`EnvironmentSpec.facts` of the training.
    """
    rebuilt = TrackedVehicle.from_dict(facts["vehicle"])
    try:
        preset = resolve_vehicle(facts["arguments"]["vehicle"])
    except (KeyError, GrouserError):
        return rebuilt
    return preset if preset == rebuilt else rebuilt


def _has_vector_class(id: str) -> bool:
    return gymnasium.spec(id).vector_entry_point is not None
