"""``grouser rl tune``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from .._console import StageBars, print_facts
from .._options import Artifact, Backend, Seed
from ._options import (
    Algorithm,
    Environment,
    EvaluationEpisodes,
    Overrides,
    PathOrFile,
    RecipeFile,
    Settings,
    Steps,
    Terrain,
    Threads,
    Vehicle,
    chosen_recipe,
    environment_arguments,
)


def tune(
    environment: Environment,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FOLDER", help="Gets study.db and best.json.")],
    algorithm: Algorithm = "ppo",
    trials: Annotated[int, typer.Option(min=1, help="Finished trials in all, those of earlier calls included.")] = 20,
    backend: Backend = "native",
    vehicle: Vehicle = None,
    terrain: Terrain = None,
    path: PathOrFile = None,
    artifact: Artifact = None,
    recipe: RecipeFile = None,
    param: Overrides = None,
    env_param: Settings = None,
    steps: Steps = None,
    threads: Threads = 1,
    seed: Seed = 0,
    eval_episodes: EvaluationEpisodes = 20,
) -> None:
    """Search for better hyper-parameters with Optuna; called again, the search goes on.

    Every trial is a training of its own, judged by its mean return once it is over. best.json holds what to set with
    -p, or to write into a recipe.
    """
    from ...controllers import TrainingPlan
    from ...controllers.rl import tune as search
    from ...terrain import write_json

    plan = TrainingPlan(
        chosen_recipe(algorithm, environment, recipe, param, n_timesteps=steps),
        environment_arguments(backend, artifact, env_param, vehicle=vehicle, terrain=terrain, path=path),
        seed=seed,
        threads=threads,
        eval_episodes=eval_episodes,
    )
    with StageBars() as tell:
        found = search(
            plan,
            output,
            trials=trials,
            progress=lambda done, total, best: tell("trials", done, total, f"best return {best:.2f}"),
        )
    file = write_json(output / "best.json", {"overrides": dict(found.overrides), "return_mean": found.return_mean})
    print_facts(
        {
            "best return": f"{found.return_mean:.2f} of {found.trials} trials",
            **{f"-p {key}": json.dumps(value) for key, value in found.overrides.items()},
            "written": file,
        }
    )
