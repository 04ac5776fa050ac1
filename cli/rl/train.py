"""``grouser rl train``."""

from __future__ import annotations

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


def train(
    environment: Environment,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FOLDER", help="Gets policies, curve, checkpoint.")],
    algorithm: Algorithm = "ppo",
    backend: Backend = "native",
    vehicle: Vehicle = None,
    terrain: Terrain = None,
    path: PathOrFile = None,
    artifact: Artifact = None,
    recipe: RecipeFile = None,
    param: Overrides = None,
    env_param: Settings = None,
    steps: Steps = None,
    envs: Annotated[
        int | None, typer.Option(help="Environments that are stepped together.", show_default="the recipe's")
    ] = None,
    threads: Threads = 1,
    seed: Seed = 0,
    eval_backend: Annotated[
        str | None, typer.Option(metavar="NAME", help="Judge the policy on this backend.", show_default="the same")
    ] = None,
    eval_every: Annotated[
        int | None, typer.Option(min=0, help="Steps between evaluations; 0: none.", show_default="a tenth of all")
    ] = None,
    eval_episodes: EvaluationEpisodes = 20,
    checkpoint_every: Annotated[
        int | None, typer.Option(min=0, help="Steps between checkpoints; 0: none.", show_default="a tenth of all")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on from the folder's checkpoint, to the same weights.")
    ] = False,
) -> None:
    """Train a policy: ENV is learned on one backend, and judged on another while it is.

    A recipe says everything that is not typed: `grouser rl recipes` lists those that are shipped, -p sets a key. The
    folder gets policy.safetensors (the last), best.safetensors (the best judged), policies/ (one a checkpoint),
    evaluations.jsonl (the curve), run.json, and tensorboard/. Weights do not depend on --threads; equal arguments give
    equal weights. Interrupted, the same command with --resume ends at the same weights; environments start anew at
    every checkpoint for that, whether interrupted or not.
    """
    from ...controllers import TrainingPlan, train_policy

    chosen = chosen_recipe(algorithm, environment, recipe, param, n_timesteps=steps, n_envs=envs)
    tenth = max(1, chosen.n_timesteps // 10)
    judged = {} if eval_backend is None else environment_arguments(eval_backend, artifact)
    if eval_backend is not None:
        judged.setdefault("backend_options", None)
    plan = TrainingPlan(
        chosen,
        environment_arguments(backend, artifact, env_param, vehicle=vehicle, terrain=terrain, path=path),
        seed=seed,
        threads=threads,
        checkpoint_every=tenth if checkpoint_every is None else checkpoint_every,
        eval_every=tenth if eval_every is None else eval_every,
        eval_environment=judged,
        eval_episodes=eval_episodes,
    )
    with StageBars() as tell:
        result = train_policy(
            plan, output, resume=resume, progress=lambda done, total, note: tell("steps", done, total, note)
        )
    best = output / ("policy.safetensors" if result.best is None else "best.safetensors")
    print_facts(
        {
            "policy": output / "policy.safetensors",
            **({} if result.best is None else {"best policy": best}),
            "content hash": result.policy.content_hash,
            "time": f"{result.seconds:.1f} s, {result.steps_per_second:.0f} steps/s between evaluations",
            "judge it": f"grouser rl eval {best} --backend physics --episodes 100",
        }
    )
