"""How to train a policy, as data: one YAML file an algorithm and task, in the manner of rl-zoo."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from importlib.resources import files
from pathlib import Path as FilePath
from typing import Any, Final

from ...terrain import ConfigurationError, InvalidInputError, missing_extra, unknown_name
from .algorithms import Algorithm, Architecture, algorithm_named
from .curriculum import Stage, read_stages
from .environment import environment_id, short_name

_LINEAR: Final = re.compile(r"lin_(.+)")
_SCHEDULED: Final = ("learning_rate", "clip_range")
_POSITIVE: Final = (
    "learning_rate", "clip_range", "n_steps", "batch_size", "n_epochs", "buffer_size", "max_grad_norm", "tau",
)  # fmt: skip
_SHARES: Final = ("gamma", "gae_lambda", "tau")
_NORMALIZE: Final = ("norm_obs", "norm_reward", "clip_obs", "clip_reward", "gamma", "epsilon")


@dataclass(frozen=True)
class Recipe:
    """What is trained, by which algorithm, with which settings.

    Parameters
    ----------
    algorithm : str
        ``ppo``, ``sac``, ``tqc``, ``her-sac`` or ``her-tqc``.
    environment : str
        Id or short name of the environment.
    n_timesteps : int
        Environment steps in all; rounded up to whole rollouts.
    n_envs : int
        Environments that are stepped together.
    normalize : bool or mapping
        Whether observations and rewards are normalized by running statistics; or arguments of ``VecNormalize``.
    env_kwargs : mapping
        Settings of the environment in training.
    eval_env_kwargs : mapping
        What of them is otherwise where the policy is judged.
    curriculum : sequence of mapping
        Stages ``{"at": 0.3, "settings": {...}}``: from that share of the steps on, episodes that begin have these
        settings. Policies are judged in those of ``env_kwargs`` and ``eval_env_kwargs`` all along.
    observation_noise : float or sequence of float, optional
        Standard deviations of the noise on observations in training, as :class:`~grouser.envs.ObservationNoise` takes
        them.
    action_delay : int or pair of int, optional
        Delay of actions in training, as :class:`~grouser.envs.ActionDelay` takes it.
    policy_kwargs : mapping
        ``net_arch``, ``activation`` and further arguments of stable-baselines3's policy.
    hyperparameters : mapping
        Arguments of the algorithm; ``lin_3e-4`` as a learning rate or clip range falls from there to zero.

    Raises
    ------
    ConfigurationError
        If a name is unknown.
    InvalidInputError
        If a number is impossible.
    """

    algorithm: str
    environment: str
    n_timesteps: int
    n_envs: int = 1
    normalize: bool | Mapping[str, Any] = False
    env_kwargs: Mapping[str, Any] = field(default_factory=dict)
    eval_env_kwargs: Mapping[str, Any] = field(default_factory=dict)
    curriculum: Sequence[Mapping[str, Any]] = ()
    observation_noise: float | Sequence[float] | None = None
    action_delay: int | Sequence[int] | None = None
    policy_kwargs: Mapping[str, Any] = field(default_factory=dict)
    hyperparameters: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        kind = algorithm_named(self.algorithm)
        object.__setattr__(self, "environment", environment_id(self.environment))
        for name in ("n_timesteps", "n_envs"):
            _require_whole(name, getattr(self, name))
        for name in ("env_kwargs", "eval_env_kwargs", "policy_kwargs", "hyperparameters"):
            _require_mapping(name, getattr(self, name))
        if not isinstance(self.normalize, bool):
            _require_mapping("normalize", self.normalize)
            for key in self.normalize:
                if key not in _NORMALIZE:
                    raise unknown_name("key of normalize", key, _NORMALIZE)
        known = kind.hyperparameters()
        for name, value in self.hyperparameters.items():
            if name not in known:
                raise unknown_name(f"hyper-parameter of {self.algorithm}", name, known)
            _require_possible(name, value)
        _ = self.architecture, self.stages

    @property
    def kind(self) -> Algorithm:
        """The algorithm."""
        return algorithm_named(self.algorithm)

    @property
    def name(self) -> str:
        """Algorithm and task, as the file of the shipped recipe is called."""
        return f"{self.algorithm}-{short_name(self.environment)}"

    @property
    def stages(self) -> tuple[Stage, ...]:
        """The curriculum."""
        return read_stages(self.curriculum)

    @property
    def disturbances(self) -> dict[str, Any]:
        """Noise and delay, as :meth:`EnvironmentSpec.make_vec_env` takes them."""
        delay = self.action_delay
        return {
            "observation_noise": self.observation_noise,
            "action_delay": tuple(delay) if isinstance(delay, Sequence) and not isinstance(delay, str) else delay,
        }

    @property
    def architecture(self) -> Architecture:
        """Layers of actor and critics."""
        options = dict(self.policy_kwargs)
        widths = options.pop("net_arch", (64, 64))
        if not isinstance(widths, Sequence) or isinstance(widths, str):
            raise InvalidInputError(f"net_arch must be a list of widths such as [64, 64], got {widths!r}")
        for width in widths:
            _require_whole("every width of net_arch", width)
        return Architecture(self.algorithm, tuple(widths), options.pop("activation", "tanh"), options)

    def arguments(self) -> dict[str, Any]:
        """Return the algorithm's arguments as stable-baselines3 takes them."""
        taken = dict(self.hyperparameters)
        for name in _SCHEDULED:
            if isinstance(taken.get(name), str):
                taken[name] = _linear(_schedule_start(name, taken[name]))
        if isinstance(taken.get("train_freq"), list):
            taken["train_freq"] = tuple(taken["train_freq"])
        return taken

    def changed(self, overrides: Mapping[str, Any]) -> Recipe:
        """Return the recipe with other values: ``{"learning_rate": 3e-4, "policy_kwargs.net_arch": [128, 128]}``.

        Raises
        ------
        ConfigurationError
            If a key is unknown.
        InvalidInputError
            If a value is impossible.
        """
        own = {entry.name for entry in fields(self)} - {"hyperparameters"}
        whole: dict[str, Any] = {}
        inner: dict[str, dict[str, Any]] = {"hyperparameters": dict(self.hyperparameters)}
        for key, value in overrides.items():
            name, dot, rest = key.partition(".")
            if dot and name in own:
                inner.setdefault(name, dict(_require_mapping(name, getattr(self, name))))[rest] = value
            elif name in own:
                whole[name] = value
            elif dot:
                raise unknown_name("key of a recipe", name, own)
            else:
                inner["hyperparameters"][name] = value
        known = {*own, *self.kind.hyperparameters()}
        for name in inner["hyperparameters"]:
            if name not in known:
                raise unknown_name(f"key of a {self.algorithm} recipe", name, known)
        return replace(self, **{**inner, **whole})

    def to_json(self) -> dict[str, Any]:
        """Return the recipe as JSON can hold it."""
        return asdict(self)

    @classmethod
    def from_mapping(cls, content: Mapping[str, Any]) -> Recipe:
        """Build a recipe from one flat mapping: its own keys, and hyper-parameters of its algorithm.

        Raises
        ------
        ConfigurationError
            If a key is unknown or one that is needed is missing.
        InvalidInputError
            If a value is impossible.
        """
        content = {str(key): _read_number(value) for key, value in content.items()}
        own = {entry.name for entry in fields(cls)} - {"hyperparameters"}
        for name in ("algorithm", "environment", "n_timesteps"):
            if name not in content:
                raise ConfigurationError(f"a recipe says {name}, got only {', '.join(content) or 'nothing'}")
        given = {name: content[name] for name in own if name in content}
        bare = cls(**given)
        return bare.changed({key: value for key, value in content.items() if key not in own})

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Recipe:
        """Read a recipe from a YAML file.

        Raises
        ------
        ConfigurationError
            If a key is unknown, or PyYAML is not installed.
        InvalidInputError
            If the file is not there or not YAML, or a value is impossible.
        """
        try:
            text = FilePath(path).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise InvalidInputError(f"cannot read recipe {os.fspath(path)!r}: {error}") from error
        return _parse(text, os.fspath(path))

    @classmethod
    def shipped(cls, algorithm: str, environment: str) -> Recipe:
        """Return the recipe that is shipped for an algorithm and an environment.

        Raises
        ------
        ConfigurationError
            If there is none, or PyYAML is not installed.
        """
        wanted = f"{algorithm_named(algorithm).name}-{short_name(environment_id(environment))}"
        if wanted not in shipped_recipes():
            raise ConfigurationError(
                f"no recipe is shipped for {algorithm} on {environment} (there are {', '.join(shipped_recipes())}): "
                "give one of your own"
            )
        return _parse(recipe_text(wanted), f"{wanted}.yml")


def shipped_recipes() -> tuple[str, ...]:
    """Names of the shipped recipes, algorithm and environment, sorted."""
    folder = files(__package__) / "recipes"
    return tuple(sorted(item.name.removesuffix(".yml") for item in folder.iterdir() if item.name.endswith(".yml")))


def recipe_text(name: str) -> str:
    """Return the YAML file of a shipped recipe.

    Raises
    ------
    ConfigurationError
        If there is none of that name.
    """
    if name not in shipped_recipes():
        raise unknown_name("recipe", name, shipped_recipes())
    return (files(__package__) / "recipes" / f"{name}.yml").read_text(encoding="utf-8")


def read_value(text: str) -> Any:
    """Read a value as a recipe has it: ``3e-4``, ``true``, ``[64, 64]``, ``lin_1e-3``.

    Raises
    ------
    ConfigurationError
        If PyYAML is not installed.
    InvalidInputError
        If it is not YAML.
    """
    return _read_number(_load_yaml(text, text))


def _parse(text: str, source: str) -> Recipe:
    content = _load_yaml(text, source)
    if not isinstance(content, dict):
        raise InvalidInputError(f"{source}: a recipe is a mapping of keys to values, got {type(content).__name__}")
    try:
        return Recipe.from_mapping(content)
    except (ConfigurationError, InvalidInputError) as error:
        raise type(error)(f"{source}: {error}") from error


def _load_yaml(text: str, source: str) -> Any:
    try:
        import yaml
    except ImportError as error:
        raise missing_extra("pyyaml", "rl") from error
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise InvalidInputError(f"{source} is not YAML: {error}") from error


def _read_number(value: Any) -> Any:
    """Read what YAML 1.1 leaves as text, such as 3e-4, as the number that it is."""
    if isinstance(value, dict):
        return {str(key): _read_number(part) for key, part in value.items()}
    if isinstance(value, list):
        return [_read_number(part) for part in value]
    if isinstance(value, str) and re.fullmatch(r"[+-]?\d+(\.\d*)?[eE][+-]?\d+", value):
        return float(value)
    return value


def _linear(start: float) -> Callable[[float], float]:
    return lambda remaining: start * remaining


def _schedule_start(name: str, text: str) -> float:
    match = _LINEAR.fullmatch(text)
    try:
        return float(match[1]) if match else math.nan
    except ValueError:
        return math.nan


def _require_possible(name: str, value: Any) -> None:
    if isinstance(value, str) and name in _SCHEDULED:
        value = _schedule_start(name, value)
        if math.isnan(value):
            raise InvalidInputError(f"{name} must be a number, or lin_ and one, such as lin_3e-4")
    if isinstance(value, bool) or not isinstance(value, int | float):
        if name in (*_POSITIVE, *_SHARES):
            raise InvalidInputError(f"{name} must be a number, got {value!r}")
        return
    if not math.isfinite(value) or (name in _POSITIVE and value <= 0):
        raise InvalidInputError(f"{name} must be positive and finite, got {value!r}")
    if name in _SHARES and not 0 <= value <= 1:
        raise InvalidInputError(f"{name} must lie in [0, 1], got {value!r}")


def _require_whole(name: str, value: Any) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise InvalidInputError(f"{name} must be a positive whole number, got {value!r}")


def _require_mapping(name: str, value: Any) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise InvalidInputError(f"{name} must be a mapping of names to values, got {value!r}")
    return value
