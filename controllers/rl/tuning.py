"""A search for hyper-parameters, which goes on where it was left."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Final

from ...terrain import ConfigurationError, InvalidInputError, missing_extra
from ...terrain.parameters import require_whole
from .plan import TrainingPlan
from .recipe import Recipe
from .training import train_policy

if TYPE_CHECKING:
    import optuna

#: Called with trials done, trials in all, and the best mean return so far.
Progress = Callable[[int, int, float], None]

_STUDY: Final = "study.db"
_WIDTHS: Final = {"64x64": [64, 64], "128x128": [128, 128], "256x256": [256, 256]}
_STEPS: Final = (8, 16, 32, 64, 128, 256)
_BATCHES: Final = (64, 128, 256, 512, 1024, 2048, 4096)


@dataclass(frozen=True)
class TuningResult:
    """What a search found.

    Parameters
    ----------
    recipe : Recipe
        The best.
    overrides : mapping
        What it sets otherwise than the recipe that the search began with.
    return_mean : float
        Of its last evaluation.
    trials : int
        Finished trials, those of earlier calls included.
    """

    recipe: Recipe
    overrides: Mapping[str, Any]
    return_mean: float
    trials: int


def tune(plan: TrainingPlan, folder: FilePath, *, trials: int, progress: Progress | None = None) -> TuningResult:
    """Train with other hyper-parameters again and again, and keep what leads to the highest mean return.

    Every trial is a whole training of the plan's steps, judged at the end over ``plan.eval_episodes`` episodes where
    the plan says; one that diverges is pruned. The study is a SQLite file in the folder: called again, the search goes
    on, until there are ``trials`` trials in all.

    Parameters
    ----------
    plan : TrainingPlan
        The recipe to begin with, and how a policy is judged.
    folder : Path
        Gets ``study.db``.
    trials : int
        Finished trials in all.
    progress : callable, optional
        Called after each trial.

    Raises
    ------
    ConfigurationError
        If Optuna is not installed, the study in the folder is of another plan, or every trial diverged.
    InvalidInputError
        If there is no trial.
    """
    require_whole("trials", trials, 1)
    try:
        import optuna
    except ImportError as error:
        raise missing_extra("optuna", "tune") from error
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    folder.mkdir(parents=True, exist_ok=True)
    study = optuna.create_study(
        storage=f"sqlite:///{folder / _STUDY}",
        study_name=plan.recipe.name,
        sampler=optuna.samplers.TPESampler(seed=plan.seed),
        direction="maximize",
        load_if_exists=True,
    )
    _claim(study, plan, folder)
    judged_at_its_end = replace(plan, checkpoint_every=0, eval_every=plan.recipe.n_timesteps)

    def objective(trial: optuna.Trial) -> float:
        overrides = suggest(trial, plan.recipe)
        trial.set_user_attr("overrides", overrides)
        try:
            result = train_policy(replace(judged_at_its_end, recipe=plan.recipe.changed(overrides)))
        except (ConfigurationError, InvalidInputError):
            raise
        except ValueError as error:
            # Of the library or of the policy: weights that are no numbers any more.
            raise optuna.TrialPruned(str(error)) from error
        return float(result.curve[-1]["return_mean"])

    while (finished := _finished(study)) < trials:
        # A sampler begins anew with every call: the seed moves on with the trials, so that the search does too.
        study.sampler = optuna.samplers.TPESampler(seed=plan.seed + len(study.trials))
        study.optimize(objective, n_trials=1)
        if progress is not None:
            progress(finished + 1, trials, _best_value(study))
    if math.isinf(_best_value(study)):
        raise ConfigurationError(f"each of {_finished(study)} trials diverged: begin with another recipe")
    best = study.best_trial
    overrides = dict(best.user_attrs["overrides"])
    return TuningResult(plan.recipe.changed(overrides), overrides, study.best_value, _finished(study))


def suggest(trial: optuna.Trial, recipe: Recipe) -> dict[str, Any]:
    """Return what a trial sets, by the keys of a recipe."""
    widths = trial.suggest_categorical("policy_kwargs.net_arch", sorted(_WIDTHS))
    chosen: dict[str, Any] = {
        "policy_kwargs.net_arch": _WIDTHS[widths],
        "gamma": 1.0 - trial.suggest_float("1 - gamma", 0.005, 0.2, log=True),
    }
    rate = trial.suggest_float("learning_rate", 1e-4, 1e-2, log=True)
    if recipe.kind.on_policy:
        n_steps = trial.suggest_categorical("n_steps", _STEPS)
        batch_size = trial.suggest_categorical("batch_size", _BATCHES)
        chosen |= {
            "learning_rate": f"lin_{rate:.6g}",
            "n_steps": n_steps,
            # A minibatch is at most the rollout.
            "batch_size": min(batch_size, n_steps * recipe.n_envs),
            "n_epochs": trial.suggest_int("n_epochs", 2, 20),
            "gae_lambda": trial.suggest_float("gae_lambda", 0.8, 1.0),
            "clip_range": trial.suggest_float("clip_range", 0.1, 0.4),
            "ent_coef": trial.suggest_float("ent_coef", 1e-8, 1e-2, log=True),
            "policy_kwargs.log_std_init": trial.suggest_float("log_std_init", -2.5, 0.0),
        }
    else:
        chosen |= {
            "learning_rate": float(f"{rate:.6g}"),
            "batch_size": trial.suggest_categorical("batch_size", _BATCHES[1:5]),
            "tau": trial.suggest_float("tau", 0.005, 0.1, log=True),
            "gradient_steps": trial.suggest_int("gradient_steps", 1, 8),
        }
    return chosen


def _finished(study: optuna.Study) -> int:
    import optuna

    ended = (optuna.trial.TrialState.COMPLETE, optuna.trial.TrialState.PRUNED)
    return len(study.get_trials(deepcopy=False, states=ended))


def _best_value(study: optuna.Study) -> float:
    import optuna

    done = study.get_trials(deepcopy=False, states=(optuna.trial.TrialState.COMPLETE,))
    return max((trial.value for trial in done if trial.value is not None), default=-math.inf)


def _claim(study: optuna.Study, plan: TrainingPlan, folder: FilePath) -> None:
    """Write what is searched for into the study, or see that it is what it was."""
    identity = {
        "recipe": json.loads(json.dumps(plan.recipe.to_json())),
        "environment": plan.training.facts(),
        "judged": plan.judging.facts(),
        "episodes": plan.eval_episodes,
        "seed": plan.seed,
    }
    found = study.user_attrs.get("plan")
    if found is None:
        study.set_user_attr("plan", identity)
        return
    differing = [key for key, value in identity.items() if found.get(key) != value]
    if differing:
        raise ConfigurationError(
            f"{folder / _STUDY} holds a search with another {', '.join(differing)}: choose another folder"
        )
