"""``grouser rl record``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .._console import StageBars, print_facts
from .._options import Artifact, Backend, Seed
from ._options import Episodes, PathOrFile, PolicyFile, Settings, Terrain, judged_where


def record(
    policy: PolicyFile,
    output: Annotated[str, typer.Option("--output", "-o", metavar="DATASET", help="Minari's id: space/name-v0.")],
    backend: Backend = "physics",
    terrain: Terrain = None,
    path: PathOrFile = None,
    episodes: Episodes = 100,
    seed: Seed = 0,
    artifact: Artifact = None,
    env_param: Settings = None,
    root: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER", help="Of all datasets.", show_default="$MINARI_DATASETS_PATH, or ~/.minari/datasets"
        ),
    ] = None,
) -> None:
    """Keep a policy's episodes as a Minari dataset, for learning without a simulator.

    Its metadata say which backend, artifact, terrain, vehicle and versions the episodes come from. It is read by
    `minari.load_dataset(DATASET)`, with MINARI_DATASETS_PATH set to the root.
    """
    from ...controllers import load_policy
    from ...controllers.rl import record_dataset

    loaded = load_policy(policy)
    environment = judged_where(loaded, backend, artifact, env_param, terrain, path)
    with StageBars() as tell:
        folder = record_dataset(
            loaded,
            environment,
            output,
            episodes=episodes,
            seed=seed,
            root=root,
            progress=lambda done, total: tell("episodes", done, total),
        )
    print_facts({"dataset": output, "folder": folder})
