"""Train a policy in a folder: checkpoints, curve, best policy; interrupted, it goes on to the same weights."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path as FilePath
from time import perf_counter
from typing import TYPE_CHECKING, Any

from ...surrogate.threads import torch_threads
from ...terrain import ConfigurationError, missing_extra
from .curriculum import rehearse
from .model import build_model
from .plan import TrainingPlan
from .policy import Policy
from .recipe import Recipe
from .run import Progress, Run
from .run_folder import BOARD, POLICY, claim, identity_of

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm


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
        ``evaluations.jsonl``, ``policies/`` with one a checkpoint, and TensorBoard's ``tensorboard/``. Without it
        nothing is written, and the weights are the same.
    resume : bool
        Go on from the checkpoint in the folder. All that a step depends on is in it; what is not are the library's
        means over the last hundred episodes, which only the board shows.
    progress : callable, optional
        Called after rollouts, a hundred times in all at most.

    Raises
    ------
    ConfigurationError
        If the folder holds a training and ``resume`` is not given, or that of another plan, a package is missing, or
        the environment takes a stage of the curriculum, the noise or the delay not.
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
    rehearse(plan.training, plan.recipe.stages)
    plan.training.make_disturbed(**plan.recipe.disturbances).close()
    if folder is not None:
        claim(folder, identity_of(plan, facts), resume=resume)
    began = perf_counter()
    with torch_threads(1):
        environment = plan.training.make_vec_env(plan.recipe.n_envs, plan.threads, **plan.recipe.disturbances)
        try:
            model = build_model(plan.recipe, environment, plan.seed)
            run = Run(plan, facts, model, folder, progress)
            if folder is not None and resume:
                run.resume(folder)
            _learn(model, plan.recipe, run, folder)
        finally:
            environment.close()
    policy = run.policy()
    if folder is not None:
        policy.save(folder / POLICY)
    seconds = perf_counter() - began
    return TrainingResult(policy, run.best, tuple(run.curve), model.num_timesteps, seconds, run.steps_per_second)


def _learn(model: BaseAlgorithm, recipe: Recipe, run: Run, folder: FilePath | None) -> None:
    """Let the library learn, with what happens between rollouts hung on its callback."""
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.logger import Logger, configure

    class BetweenRollouts(BaseCallback):
        def _on_training_start(self) -> None:
            run.start()

        def _on_rollout_start(self) -> None:
            if model.num_timesteps >= run.due:
                run.attend()

        def _on_step(self) -> bool:
            return True

    # The library's own logger makes itself a folder among the temporary files, even where it writes nothing.
    model.set_logger(Logger(None, []) if folder is None else configure(str(folder / BOARD), ["tensorboard"]))
    left = recipe.n_timesteps - run.first
    model.learn(left, callback=BetweenRollouts(), reset_num_timesteps=run.first == 0, log_interval=10)
    run.finish()
