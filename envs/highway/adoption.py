"""Let highway-env's own environments drive a tracked vehicle."""

from __future__ import annotations

from functools import cache
from typing import Any, TypeVar

from ...terrain import ConfigurationError
from .dependency import import_highway_env
from .vehicle import TrackedHighwayVehicle

EnvT = TypeVar("EnvT")


def use_tracked_vehicle(env: EnvT, vehicle_class: type[TrackedHighwayVehicle] = TrackedHighwayVehicle) -> EnvT:
    """Let an environment of highway-env make its controlled vehicles of a tracked class, from the next reset on.

    highway-env chooses the class of a controlled vehicle by the name of the action type, in a closed list, so that no
    configuration can name another; the vehicles beside it are named by ``config["other_vehicles_type"]``, which takes
    ``"grouser.envs.highway.TrackedHighwayVehicle"`` as it is. What ``env.action_space.seed`` set survives resets here.

    Parameters
    ----------
    env : gymnasium.Env
        Of highway-env, wrapped or not; its action type is ``ContinuousAction``, ``DiscreteAction``, or
        ``MultiAgentAction`` of either.
    vehicle_class : type
        Of :func:`tracked_vehicle_class`.

    Returns
    -------
    gymnasium.Env
        The same environment.

    Raises
    ------
    ConfigurationError
        If it is no environment of highway-env, or its actions are meta-actions.
    """
    inner: Any = getattr(env, "unwrapped", env)
    # A class whose base is unknown to mypy is not known to be hashable either.
    kind: Any = type(inner)
    tracked: Any = vehicle_class
    if not isinstance(inner, import_highway_env("envs.common.abstract").AbstractEnv):
        raise ConfigurationError(f"expected an environment of highway-env, got {env!r}")
    _tracked_actions(inner.action_type, tracked)
    inner.__class__ = _tracked_kind(kind, tracked)
    return env


@cache
def _tracked_kind(kind: Any, vehicle_class: Any) -> Any:
    class Tracked(kind):  # type: ignore[misc]
        """With a tracked vehicle."""

        action_space: Any

        def define_spaces(self) -> None:
            before = self.action_space
            super().define_spaces()
            if before == self.action_space:
                self.action_space = before
            self.action_type.__class__ = _tracked_actions(self.action_type, vehicle_class)

    Tracked.__name__ = kind.__name__
    return Tracked


def _tracked_actions(action_type: Any, vehicle_class: Any) -> Any:
    """Return the class of an action type whose vehicles are tracked.

    Raises
    ------
    ConfigurationError
        If the actions are none that a tracked vehicle takes.
    """
    actions = import_highway_env("envs.common.action")
    config = getattr(action_type, "action_config", None)
    name = type(action_type).__name__ if config is None else config["type"]
    if name not in ("ContinuousAction", "DiscreteAction"):
        raise ConfigurationError(
            f"a tracked vehicle is driven by ContinuousAction or DiscreteAction, not by {name}: pass "
            'config={"action": {"type": "ContinuousAction"}} to gymnasium.make'
        )
    return _actions_of(getattr(actions, type(action_type).__name__), vehicle_class)


@cache
def _actions_of(kind: Any, vehicle_class: Any) -> Any:
    tracked = type(kind.__name__, (kind,), {"vehicle_class": property(lambda self: vehicle_class)})
    tracked.__doc__ = f"{kind.__name__} of tracked vehicles."
    return tracked
