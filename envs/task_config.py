"""The settings that every task of a tracked vehicle has, validated and frozen."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Final, Literal, TypedDict, TypeVar, cast

from ..terrain import ConfigurationError, Ground, InvalidInputError, resolve_ground, unknown_name
from ..terrain.parameters import require_in
from .footing import GROUND_SAMPLINGS, GroundSampling
from .randomization import Randomization
from .state import VehicleState
from .tick import INTEGRATORS, Integrator

ActionMode = Literal["belts", "twist"]
ACTION_MODES: Final[tuple[ActionMode, ...]] = ("belts", "twist")


@dataclass(frozen=True)
class TaskConfig:
    """Settings that the tasks share.

    Parameters
    ----------
    action_mode : {"belts", "twist"}
        Whether an action is left and right belt speed, or speed and yaw rate.
    control_period : float
        In s, a multiple of the tick.
    tick : float
        T_s in s.
    integrator : str
        Of the simulator.
    ground_sampling : {"vehicle", "tracks"}
        Whether θ is taken at the CG or at each track; see :class:`~grouser.envs.Simulator`.
    grade, bank : float
        Slope of the plane in rad, along its x and y axes, positive uphill; added to the ground's own.
    yaw_rate_scale : float
        Yaw rate of a full ``twist`` action, in rad/s.
    observe_terrain : bool
        Whether the observation ends with the terrain parameters.
    time_limit : float
        Length of an episode in s, after which it is truncated.
    lowest_start_speed : float
        Initial speed is drawn from this share of the reference speed up to all of it.
    action_change_weight, slip_power_weight : float
        Weights of the reward's terms.

    Raises
    ------
    InvalidInputError
        If a number is impossible.
    ConfigurationError
        If the action mode, the integrator or the ground sampling is unknown.
    """

    action_mode: ActionMode = "belts"
    control_period: float = 0.1
    tick: float = 0.01
    integrator: Integrator = "implicit"
    ground_sampling: GroundSampling = "vehicle"
    grade: float = 0.0
    bank: float = 0.0
    yaw_rate_scale: float = 1.0
    observe_terrain: bool = False
    time_limit: float = 40.0
    lowest_start_speed: float = 0.5
    action_change_weight: float = 0.05
    slip_power_weight: float = 0.1

    def __post_init__(self) -> None:
        if self.action_mode not in ACTION_MODES:
            raise unknown_name("action mode", self.action_mode, ACTION_MODES)
        if self.integrator not in INTEGRATORS:
            raise unknown_name("integrator", self.integrator, INTEGRATORS)
        if self.ground_sampling not in GROUND_SAMPLINGS:
            raise unknown_name("ground sampling", self.ground_sampling, GROUND_SAMPLINGS)
        for name in ("grade", "bank"):
            require_in(name, getattr(self, name), -math.pi / 4, math.pi / 4)
        self._require_flag("observe_terrain")
        for name in ("control_period", "tick", "yaw_rate_scale", "time_limit"):
            require_in(name, getattr(self, name), 0.0, 1e4, low_open=True)
        require_in("lowest_start_speed", self.lowest_start_speed, 0.0, 1.0)
        for field in fields(self):
            if field.name.endswith("_weight"):
                require_in(field.name, getattr(self, field.name), 0.0, 1e6)

    def _require_flag(self, name: str) -> None:
        if not isinstance(getattr(self, name), bool):
            raise InvalidInputError(f"{name} must be True or False, got {getattr(self, name)!r}")

    def _require_positive(self, *names: str) -> None:
        """Check settings in (0, 100] in SI units, or None where the task has a value of its own."""
        for name in names:
            if getattr(self, name) is not None:
                require_in(name, getattr(self, name), 0.0, 1e2, low_open=True)


@dataclass(frozen=True)
class RandomizedTaskConfig(TaskConfig):
    """Settings of tasks whose ground and vehicle may differ from episode to episode, after those of :class:`TaskConfig`.

    Parameters
    ----------
    randomize : Randomization or mapping of its fields, optional
        What differs from episode to episode beside the start.

    Raises
    ------
    InvalidInputError
        If a number is impossible.
    ConfigurationError
        If the action mode, the integrator, the ground sampling or what to randomize is unknown.
    """

    #: Settings that every episode takes anew when it begins, and so may change between two of them.
    changeable: ClassVar[frozenset[str]] = frozenset({"lowest_start_speed", "randomize"})

    randomize: Randomization | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "randomize", Randomization.of(self.randomize))


class StartOptions(TypedDict, total=False):
    """What ``reset(options=...)`` takes of every task; each says what they are to it, and adds its own."""

    state: VehicleState
    terrain: str | os.PathLike[str] | Ground


_Config = TypeVar("_Config", bound=TaskConfig)
_Randomized = TypeVar("_Randomized", bound=RandomizedTaskConfig)
_Options = TypeVar("_Options", bound=StartOptions)


def build_config(kind: type[_Config], task: str, settings: Mapping[str, Any]) -> _Config:
    """Build a task's settings from keyword arguments.

    Raises
    ------
    ConfigurationError
        If a key is unknown, with the nearest one that exists.
    """
    known = {field.name for field in fields(kind)}
    for key in settings:
        if key not in known:
            raise unknown_name(f"{task} setting", key, known)
    return kind(**settings)


def changed_config(config: _Randomized, settings: Mapping[str, Any]) -> _Randomized:
    """Return settings with some changed, as is possible between episodes.

    Raises
    ------
    ConfigurationError
        If a key is unknown, or its setting holds for the life of an environment.
    InvalidInputError
        If a value is impossible.
    """
    known = {field.name for field in fields(config)}
    for key in settings:
        if key not in known:
            raise unknown_name("setting", key, known)
        if key not in config.changeable:
            raise ConfigurationError(
                f"{key} holds for the life of an environment, whose spaces, engine and reward are made with it: make "
                f"another environment. Between episodes these can change: {', '.join(sorted(config.changeable))}"
            )
    return replace(config, **settings)


def check_options(
    kind: type[_Options], options: Mapping[str, Any], classes: Mapping[str, type] | None = None
) -> _Options:
    """Return reset options, once every key is seen to be one of a task's and every value to be of its kind.

    Parameters
    ----------
    kind : type
        The task's options: ``terrain``, ``state``, those in ``classes``, and else finite numbers.
    options : mapping
        As ``reset`` received them.
    classes : mapping, optional
        Of the values of further keys.

    Raises
    ------
    ConfigurationError
        If a key is unknown, or the terrain's name is.
    InvalidInputError
        If a number is not finite or a value is of another kind.
    """
    known = kind.__annotations__
    classes = {"state": VehicleState} | dict(classes or {})
    checked: dict[str, Any] = {}
    for key, value in options.items():
        if key not in known:
            raise unknown_name("reset option", key, known)
        if key == "terrain":
            checked[key] = resolve_ground(value)
        elif key in classes:
            if not isinstance(value, classes[key]):
                raise InvalidInputError(f"the reset option {key} takes a {classes[key].__name__}, got {value!r}")
            checked[key] = value
        else:
            try:
                checked[key] = float(value)
            except (TypeError, ValueError):
                checked[key] = math.nan
            if not math.isfinite(checked[key]):
                raise InvalidInputError(f"the reset option {key} takes a finite number, got {value!r}")
    return cast(_Options, checked)
