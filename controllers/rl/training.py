"""Train a policy in a folder: checkpoints, curve, best policy; interrupted, it goes on to the same weights."""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path as FilePath
from time import perf_counter
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ...surrogate.threads import torch_threads
from ...terrain import ArtifactError, ConfigurationError, InvalidInputError, missing_extra, write_aside, write_json
from .checkpoint import load_checkpoint, read_checkpoint, save_checkpoint
from .environment import EnvironmentSpec
from .evaluation import evaluate
from .model import build_model, policy_of
from .policy import Policy, load_policy
from .recipe import Recipe

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm

#: Called with steps done, steps in all, and a word on how it goes.
Progress = Callable[[int, int, str], None]

_RUN: Final = "run.json"
_CHECKPOINT: Final = "checkpoint.safetensors"
_CURVE: Final = "evaluations.jsonl"
_POLICY: Final = "policy.safetensors"
_BEST: Final = "best.safetensors"
_POLICIES: Final = "policies"
_BOARD: Final = "tensorboard"
#: Most reports to who waits.
_REPORTS: Final = 100


@dataclass(frozen=True)
class TrainingPlan:
    """A training: what, where, and what is kept of it.

    Parameters
    ----------
    recipe : Recipe
        Algorithm, task and settings.
    environment : mapping
        Arguments of the environment beside the recipe's ``env_kwargs``: ``backend``, ``vehicle``, ``terrain``,
        ``path``, ``backend_options``.
    seed : int
        Of environments, weights and noise. With equal plans, weights are equal to the bit.
    threads : int
        That share the compiled environments; the weights do not depend on their number.
    checkpoint_every : int
        Steps between two checkpoints, rounded up to whole rollouts; 0 for none. At a checkpoint the environments start
        anew, with seeds of their own, whether the training goes on or is resumed there.
    eval_every : int
        Steps between two evaluations, rounded up to whole rollouts; 0 for none.
    eval_environment : mapping
        What of the environment is otherwise where the policy is judged, such as ``{"backend": "physics"}``.
    eval_episodes : int
        Episodes of an evaluation, the same starts every time.

    Raises
    ------
    InvalidInputError
        If a number is impossible.
    """

    recipe: Recipe
    environment: Mapping[str, Any] = field(default_factory=dict)
    seed: int = 0
    threads: int = 1
    checkpoint_every: int = 0
    eval_every: int = 0
    eval_environment: Mapping[str, Any] = field(default_factory=dict)
    eval_episodes: int = 20

    def __post_init__(self) -> None:
        lowest = {"seed": 0, "threads": 1, "checkpoint_every": 0, "eval_every": 0, "eval_episodes": 1}
        for name, least in lowest.items():
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < least:
                raise InvalidInputError(f"{name} must be a whole number of at least {least}, got {value!r}")

    @property
    def training(self) -> EnvironmentSpec:
        """Where the policy learns."""
        return EnvironmentSpec(self.recipe.environment, {**self.recipe.env_kwargs, **self.environment})

    @property
    def judging(self) -> EnvironmentSpec:
        """Where the policy is judged."""
        return self.training.changed(**self.recipe.eval_env_kwargs).changed(**self.eval_environment)


@dataclass(frozen=True, eq=False)
class TrainingResult:
    """What a training leaves.

    Parameters
    ----------
    policy : Policy
        After the last step.
    best : Policy or None
        Of the highest mean return at an evaluation.
    curve : tuple of mapping
        One evaluation each: ``steps`` and :meth:`Evaluation.summary`.
    steps : int
        Environment steps in all.
    seconds : float
        Of this call, evaluations included.
    steps_per_second : float
        Of this call, without evaluations and checkpoints.
    """

    policy: Policy
    best: Policy | None
    curve: tuple[Mapping[str, Any], ...]
    steps: int
    seconds: float
    steps_per_second: float


def train_policy(
    plan: TrainingPlan, folder: FilePath | None = None, *, resume: bool = False, progress: Progress | None = None
) -> TrainingResult:
    """Train a policy.

    Parameters
    ----------
    plan : TrainingPlan
        What and where.
    folder : Path, optional
        Gets ``run.json``, ``policy.safetensors``, ``best.safetensors``, ``checkpoint.safetensors``, the curve
        ``evaluations.jsonl``, ``policies/`` with one a checkpoint, and TensorBoard's ``tensorboard/``. Without it nothing
        is written.
    resume : bool
        Go on from the checkpoint in the folder. All that a step depends on is in it; what is not are the library's
        means over the last hundred episodes, which only the board shows.
    progress : callable, optional
        Called after rollouts, a hundred times in all at most.

    Raises
    ------
    ConfigurationError
        If the folder holds a training and ``resume`` is not given, or that of another plan, or a package is missing.
    ArtifactError
        If the checkpoint is missing, truncated or altered.
    """
    try:
        import stable_baselines3  # noqa: F401 - to be missed here rather than halfway
    except ImportError as error:
        raise missing_extra("stable-baselines3", "rl") from error
    if resume and folder is None:
        raise ConfigurationError("only a training in a folder can be resumed")
    facts = plan.training.facts()
    if folder is not None:
        _claim(folder, _identity(plan, facts), resume)
    began = perf_counter()
    with torch_threads(1):
        environment = plan.training.make_vec_env(plan.recipe.n_envs, plan.threads)
        try:
            model = build_model(plan.recipe, environment, plan.seed)
            run = _Run(plan, facts, model, folder, progress)
            if folder is not None and resume:
                run.resume(folder)
            _learn(model, plan.recipe, run, folder)
        finally:
            environment.close()
    policy = run.policy()
    if folder is not None:
        policy.save(folder / _POLICY)
    seconds = perf_counter() - began
    return TrainingResult(policy, run.best, tuple(run.curve), model.num_timesteps, seconds, run.steps_per_second)


def _learn(model: BaseAlgorithm, recipe: Recipe, run: _Run, folder: FilePath | None) -> None:
    """Let the library learn, with what happens between rollouts hung on its callback."""
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.logger import configure

    class BetweenRollouts(BaseCallback):
        def _on_training_start(self) -> None:
            run.start()

        def _on_rollout_start(self) -> None:
            if model.num_timesteps >= run.due:
                run.attend()

        def _on_step(self) -> bool:
            return True

    model.set_logger(
        configure(None if folder is None else str(folder / _BOARD), [] if folder is None else ["tensorboard"])
    )
    left = recipe.n_timesteps - run.first
    model.learn(left, callback=BetweenRollouts(), reset_num_timesteps=run.first == 0, log_interval=10)
    run.finish()


class _Run:
    """What is done between rollouts: evaluations, checkpoints, fresh environments, a word to who waits."""

    def __init__(
        self,
        plan: TrainingPlan,
        facts: Mapping[str, Any],
        model: BaseAlgorithm,
        folder: FilePath | None,
        progress: Progress | None,
    ) -> None:
        self._plan = plan
        self._facts = facts
        self._model = model
        self._folder = folder
        self._progress = progress
        self._from: FilePath | None = None
        self._every = {
            self._evaluate: plan.eval_every,
            self._checkpoint: plan.checkpoint_every if folder is not None else 0,
            self._report: max(1, plan.recipe.n_timesteps // _REPORTS) if progress is not None else 0,
        }
        self._next: dict[Callable[[int], None], int] = {}
        self._began = perf_counter()
        self._evaluated = -1
        self.first = 0
        self.due: float = 0
        self.steps_per_second = 0.0
        self._aside = 0.0
        self.best: Policy | None = None
        self.curve: list[dict[str, Any]] = []

    def resume(self, folder: FilePath) -> None:
        """Take up where a checkpoint stands; its weights follow once the library has set itself up."""
        self._from = folder / _CHECKPOINT
        self.first = self._model.num_timesteps = int(read_checkpoint(self._from)[1]["steps"])
        self.curve = [entry for entry in read_curve(folder) if entry["steps"] <= self.first]
        if self.curve:
            self.best = load_policy(folder / _BEST)

    def start(self) -> None:
        """Restore the model, now that the library has reset all that it resets, and begin the first episodes."""
        if self._from is not None:
            load_checkpoint(self._from, self._model)
        self._schedule(self.first)
        self._begin_episodes()
        self._began = perf_counter()

    def attend(self) -> None:
        """Do what is due."""
        began = perf_counter()
        steps = self._model.num_timesteps
        for action, step in self._next.items():
            if steps >= step:
                action(steps)
        self._schedule(steps)
        self._aside += perf_counter() - began

    def finish(self) -> None:
        """Judge the last policy, unless that was just done."""
        steps = self._model.num_timesteps
        self.steps_per_second = self._rate(steps)
        if self._plan.eval_every and self._evaluated != steps:
            self._evaluate(steps)
        if self._progress is not None:
            self._report(steps)

    def policy(self) -> Policy:
        """Return the policy as it is now."""
        trained = {"seed": self._plan.seed, "steps": self._model.num_timesteps, "versions": _versions()}
        return policy_of(self._model, self._plan.recipe, self._facts, trained)

    def _schedule(self, steps: int) -> None:
        self._next = {action: (steps // every + 1) * every for action, every in self._every.items() if every}
        self.due = min(self._next.values(), default=math.inf)

    def _begin_episodes(self) -> None:
        model, environment = self._model, self._model.get_env()
        if environment is None:
            return
        steps = model.num_timesteps
        environment.seed(int(np.random.SeedSequence((self._plan.seed, steps)).generate_state(1)[0]))
        model._last_obs = environment.reset()  # type: ignore[assignment]
        model._last_episode_starts = np.ones(environment.num_envs, np.bool_)
        wrapper = model.get_vec_normalize_env()
        if wrapper is not None:
            model._last_original_obs = wrapper.get_original_obs()

    def _evaluate(self, steps: int) -> None:
        plan, policy = self._plan, self.policy()
        found = evaluate(policy, plan.judging, episodes=plan.eval_episodes, seed=plan.seed, threads=plan.threads)
        highest = max((entry["return_mean"] for entry in self.curve), default=-math.inf)
        self.curve.append({"steps": steps, **found.summary()})
        self._evaluated = steps
        if found.return_mean > highest:
            self.best = policy
        if self._folder is None:
            return
        if found.return_mean > highest:
            policy.save(self._folder / _BEST)
        lines = "".join(f"{json.dumps(entry, sort_keys=True)}\n" for entry in self.curve)
        write_aside(self._folder / _CURVE, lines.encode())
        for name, value in found.summary().items():
            if isinstance(value, int | float):
                self._model.logger.record(f"evaluation/{name}", value)
        self._model.logger.dump(steps)

    def _checkpoint(self, steps: int) -> None:
        if self._folder is None:
            return
        buffer: Any = getattr(self._model, "replay_buffer", None)
        if hasattr(buffer, "truncate_last_trajectory"):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)
                buffer.truncate_last_trajectory()
        save_checkpoint(self._folder / _CHECKPOINT, self._model)
        self.policy().save(self._folder / _POLICIES / f"{steps:09d}.safetensors")
        self._begin_episodes()

    def _rate(self, steps: int) -> float:
        """Return steps a second of this call, without evaluations and checkpoints."""
        return (steps - self.first) / max(perf_counter() - self._began - self._aside, 1e-9)

    def _report(self, steps: int) -> None:
        if self._progress is None:
            return
        total = self._plan.recipe.n_timesteps
        note = f"{self._rate(steps):.0f} steps/s"
        episodes = self._model.ep_info_buffer
        if episodes:
            note += f", return {np.mean([episode['r'] for episode in episodes]):.2f}"
        if self.curve:
            note += f", judged {self.curve[-1]['return_mean']:.2f}"
        self._progress(min(steps, total), total, note)


def read_curve(folder: FilePath) -> list[dict[str, Any]]:
    """Return the evaluations of a training, in their order; none where there is no curve.

    Raises
    ------
    ArtifactError
        If the file is damaged.
    """
    file = folder / _CURVE
    if not file.exists():
        return []
    try:
        return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
    except ValueError as error:
        raise ArtifactError(f"{file} is damaged: {error}") from error


def _identity(plan: TrainingPlan, facts: Mapping[str, Any]) -> dict[str, Any]:
    """Return what two trainings have to share for one to go on where the other stopped, as JSON holds it."""
    content = {
        "recipe": plan.recipe.to_json(),
        "environment": dict(facts),
        "seed": plan.seed,
        "checkpoint_every": plan.checkpoint_every,
        "eval_every": plan.eval_every,
        "eval_episodes": plan.eval_episodes,
        "eval_environment": plan.judging.facts() if plan.eval_every else None,
    }
    return dict(json.loads(json.dumps(content)))


def _claim(folder: FilePath, identity: Mapping[str, Any], resume: bool) -> None:
    """Write the training's identity into its folder, or see that it is the one that is there."""
    file = folder / _RUN
    if not file.exists():
        if resume:
            raise ConfigurationError(f"{folder} holds no training to resume")
        write_json(file, identity)
        return
    if not resume:
        raise ConfigurationError(f"{folder} holds a training: resume it, or choose another folder")
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ArtifactError(f"{file} is damaged: {error}") from error
    differing = list(_differences(found, identity))
    if differing:
        raise ConfigurationError(f"{folder} holds another training: {'; '.join(differing)}")


def _differences(there: Any, asked: Any, name: str = "") -> Iterator[str]:
    if isinstance(there, dict) and isinstance(asked, dict):
        for key in sorted(there.keys() | asked.keys()):
            yield from _differences(there.get(key), asked.get(key), f"{name}.{key}" if name else key)
    elif there != asked:
        yield f"{name} {json.dumps(there)} there, {json.dumps(asked)} asked"


def _versions() -> dict[str, str]:
    packages = ("grouser", "stable-baselines3", "torch", "numpy", "gymnasium")
    return {package: version(package) for package in packages}
