"""``grouser rl eval``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .._console import StageBars, out, print_facts
from .._options import Artifact, Backend, Seed
from .._tables import table
from ._options import Episodes, PathOrFile, PolicyFile, Settings, Terrain, Threads, judged_where

if TYPE_CHECKING:
    from ...controllers import Evaluation

_MOST_ROWS = 20


def evaluate(
    policy: PolicyFile,
    backend: Backend = "physics",
    terrain: Terrain = None,
    path: PathOrFile = None,
    episodes: Episodes = 100,
    seed: Seed = 0,
    artifact: Artifact = None,
    env_param: Settings = None,
    threads: Threads = 1,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE.json", help="Gets figures and a row a seed.")
    ] = None,
) -> None:
    """Let a policy, without exploration, drive whole episodes, and say what they earn.

    Vehicle and task are those that it was trained on, starts and length those that its recipe has for judging. The
    backend, the ground and the path may be others: a policy trained on a surrogate is worth what it does on physics.
    Compiled tasks are driven many at once, to the same bits. Returns come with the 95 % interval of their mean, rates
    of success with Wilson's.
    """
    from ...controllers import evaluate as evaluate_policy
    from ...controllers import load_policy
    from ...terrain import write_json

    loaded = load_policy(policy)
    environment = judged_where(loaded, backend, artifact, env_param, terrain, path)
    with StageBars() as tell:
        found = evaluate_policy(
            loaded,
            environment,
            episodes=episodes,
            seed=seed,
            threads=threads,
            progress=lambda done, total: tell("episodes", done, total),
        )
    if episodes <= _MOST_ROWS:
        _print_rows(found, f"{policy.stem} on {backend}, {environment.id}")
    facts: dict[str, object] = {"return": f"{found.return_mean:.2f} ± {found.return_margin:.2f}, {episodes} episodes"}
    if found.success_rate is not None and found.success_interval is not None:
        low, high = found.success_interval
        facts["success"] = f"{100 * found.success_rate:.1f} % ({100 * low:.1f} to {100 * high:.1f} %)"
    facts |= {name.replace("_", " "): f"{value:.4g}" for name, value in found.measures.items()}
    broken = sum(episode.ended in ("diverged", "off_map") for episode in found.episodes)
    if broken:
        facts["broken off"] = f"{broken} episodes"
    if output is not None:
        content = {"policy": loaded.content_hash, "environment": environment.facts(), "summary": found.summary()}
        facts["written"] = write_json(output, content | {"rows": found.rows()})
    print_facts(facts)


def _print_rows(found: Evaluation, title: str) -> None:
    names = list(found.measures)
    listed = table(title, ["ended", "seed", "return", "steps", *(name.replace("_", " ") for name in names)])
    for episode in found.episodes:
        ended = "success" if episode.success else episode.ended
        measures = [f"{episode.measures[name]:.3f}" for name in names]
        listed.add_row(ended, str(episode.seed), f"{episode.episode_return:.2f}", str(episode.length), *measures)
    out.print(listed)
