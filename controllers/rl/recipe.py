"""How to train a policy, as data: one YAML file an algorithm and task, in the manner of rl-zoo."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path as FilePath
from typing import Any, Final

from ...terrain import ConfigurationError, InvalidInputError, unknown_name
from ...terrain.parameters import require_whole
from .algorithms import Algorithm, Architecture, algorithm_named
from .curriculum import Stage, read_stages
from .environment import environment_id, short_name
from .hyperparameters import library_arguments, require_possible
from .recipe_file import load_yaml, read_number, recipe_text, shipped_recipes

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
            require_whole(name, getattr(self, name), 1)
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
            require_possible(name, value)
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
            require_whole("every width of net_arch", width, 1)
        return Architecture(self.algorithm, tuple(widths), options.pop("activation", "tanh"), options)

    def arguments(self) -> dict[str, Any]:
        """Return the algorithm's arguments as stable-baselines3 takes them."""
        return library_arguments(self.hyperparameters)

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
        content = {str(key): read_number(value) for key, value in content.items()}
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


def _parse(text: str, source: str) -> Recipe:
    content = load_yaml(text, source)
    if not isinstance(content, dict):
        raise InvalidInputError(f"{source}: a recipe is a mapping of keys to values, got {type(content).__name__}")
    try:
        return Recipe.from_mapping(content)
    except (ConfigurationError, InvalidInputError) as error:
        raise type(error)(f"{source}: {error}") from error


def _require_mapping(name: str, value: Any) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise InvalidInputError(f"{name} must be a mapping of names to values, got {value!r}")
    return value
