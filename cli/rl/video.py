"""``grouser rl video``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .._console import print_facts
from .._options import Artifact, Backend, Seed
from ._options import Episodes, PathOrFile, PolicyFile, Settings, Terrain, judged_where


def video(
    policy: PolicyFile,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE.mp4", help="The film.")],
    backend: Backend = "physics",
    terrain: Terrain = None,
    path: PathOrFile = None,
    episodes: Episodes = 1,
    seed: Seed = 0,
    artifact: Artifact = None,
    env_param: Settings = None,
) -> None:
    """Film a policy from above, in real time, one frame a control period."""
    from ...controllers import load_policy
    from ...controllers.rl import film

    loaded = load_policy(policy)
    environment = judged_where(loaded, backend, artifact, env_param, terrain, path)
    frames = film(loaded, environment, output, episodes=episodes, seed=seed)
    print_facts({"film": output, "frames": frames})
