"""A training under way: what is done between rollouts, which is all that is done beside the library's own work."""

from __future__ import annotations

import math
import warnings
from collections import deque
from collections.abc import Callable, Mapping
from importlib.metadata import version
from pathlib import Path as FilePath
from time import perf_counter
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from .checkpoint import load_checkpoint, read_checkpoint, save_checkpoint
from .curriculum import Stage
from .evaluation import evaluate
from .model import policy_of
from .plan import TrainingPlan
from .policy import Policy, load_policy
from .run_folder import BEST, CHECKPOINT, POLICIES, read_curve, write_curve

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm

#: Called with steps done, steps in all, and a word on how it goes.
Progress = Callable[[int, int, str], None]

# Most reports to who waits.
_REPORTS: Final = 100


class Run:
    """What is done between rollouts: stages, evaluations, checkpoints, fresh environments, a word to who waits.

    Parameters
    ----------
    plan : TrainingPlan
        Of the training.
    facts : mapping
        Of its environment.
    model : BaseAlgorithm
        That learns.
    folder : Path or None
        Gets what is kept.
    progress : callable or None
        Called now and then.

    Attributes
    ----------
    first : int
        Steps that were done before this call.
    due : float
        Steps after which there is something to do.
    best : Policy or None
        Of the highest mean return so far.
    curve : list of dict
        The evaluations so far.
    steps_per_second : float
        Of this call, without evaluations and checkpoints, once it is finished.
    """

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
            self._checkpoint: plan.checkpoint_every,
            self._report: max(1, plan.recipe.n_timesteps // _REPORTS) if progress is not None else 0,
        }
        self._next: dict[Callable[[int], None], int] = {}
        self._coming = deque(plan.recipe.stages)
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
        self._from = folder / CHECKPOINT
        self.first = self._model.num_timesteps = int(read_checkpoint(self._from)[1]["steps"])
        self.curve = [entry for entry in read_curve(folder) if entry["steps"] <= self.first]
        if self.curve:
            self.best = load_policy(folder / BEST)

    def start(self) -> None:
        """Restore the model, now that the library has reset all that it resets, and begin the first episodes."""
        if self._from is not None:
            load_checkpoint(self._from, self._model)
        self._enter_stages(self.first)
        self._schedule(self.first)
        self._begin_episodes()
        self._began = perf_counter()

    def attend(self) -> None:
        """Do what is due."""
        began = perf_counter()
        steps = self._model.num_timesteps
        # First, so that the episodes that begin at a checkpoint are those that a resumed training begins there.
        self._enter_stages(steps)
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
        stage = [self._first_step(self._coming[0])] if self._coming else []
        self.due = min([*self._next.values(), *stage], default=math.inf)

    def _first_step(self, stage: Stage) -> int:
        return stage.first_step(self._plan.recipe.n_timesteps)

    def _enter_stages(self, steps: int) -> None:
        """Give the environments the settings of all stages that have come."""
        environment = self._model.get_env()
        while environment is not None and self._coming and self._first_step(self._coming[0]) <= steps:
            environment.env_method("reconfigure", **self._coming.popleft().settings)

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
            policy.save(self._folder / BEST)
        write_curve(self._folder, self.curve)
        for name, value in found.summary().items():
            if isinstance(value, int | float):
                self._model.logger.record(f"evaluation/{name}", value)
        self._model.logger.dump(steps)

    def _checkpoint(self, steps: int) -> None:
        buffer: Any = getattr(self._model, "replay_buffer", None)
        if hasattr(buffer, "truncate_last_trajectory"):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)
                buffer.truncate_last_trajectory()
        if self._folder is not None:
            save_checkpoint(self._folder / CHECKPOINT, self._model)
            self.policy().save(self._folder / POLICIES / f"{steps:09d}.safetensors")
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


def _versions() -> dict[str, str]:
    packages = ("grouser", "stable-baselines3", "torch", "numpy", "gymnasium")
    return {package: version(package) for package in packages}
