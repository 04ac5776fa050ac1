"""Options that the verbs of ``grouser rl`` share, and what they add up to."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from ...envs import path_names
from ...terrain import InvalidInputError, terrain_names, vehicle_names
from .._drivers import takes_artifact
from .._options import starting_with

if TYPE_CHECKING:
    from ...controllers import EnvironmentSpec, Policy, Recipe

Algorithm = Annotated[
    Literal["ppo", "sac", "tqc", "her-sac", "her-tqc"],
    typer.Option("--algo", help="ppo on many vehicles at once; sac, tqc from a replay buffer; her-* for goals."),
]
Environment = Annotated[
    str, typer.Argument(metavar="ENV", help="Id or short name: path-tracking, PathTracking-v0, parking, ...")
]
PolicyFile = Annotated[
    Path,
    typer.Argument(
        metavar="POLICY",
        help="Policy that grouser rl train made, or the name of a shipped one: see grouser list policies.",
    ),
]
RecipeFile = Annotated[
    Path | None,
    typer.Option(
        "--recipe", metavar="FILE.yml", help="Recipe of your own.", show_default="the one that is shipped for both"
    ),
]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--param", "-p", metavar="KEY=VALUE", help="Key of the recipe: learning_rate=3e-4. Repeatable."),
]
Settings = Annotated[
    list[str] | None,
    typer.Option("--env-param", "-e", metavar="KEY=VALUE", help="Setting of the environment. Repeatable."),
]
Vehicle = Annotated[
    str | None,
    typer.Option(metavar="NAME|FILE.toml", help="Vehicle.", autocompletion=starting_with(vehicle_names)),
]
Terrain = Annotated[
    str | None,
    typer.Option(metavar="NAME|FILE", help="Ground.", autocompletion=starting_with(terrain_names)),
]
PathOrFile = Annotated[
    str | None,
    typer.Option("--path", metavar="NAME|FILE.csv", help="Path.", autocompletion=starting_with(path_names)),
]
Steps = Annotated[
    int | None, typer.Option("--steps", help="Environment steps of a training.", show_default="the recipe's")
]
Episodes = Annotated[int, typer.Option("--episodes", min=1, help="Episodes, each of a seed of its own.")]
EvaluationEpisodes = Annotated[
    int, typer.Option("--eval-episodes", min=1, help="Episodes that a policy is judged by in a training.")
]
Threads = Annotated[int, typer.Option(min=1, help="Threads of compiled environments; results do not depend on it.")]


def read_pairs(pairs: Sequence[str] | None, option: str) -> dict[str, Any]:
    """Read ``key=value`` pairs, values as a recipe has them.

    Raises
    ------
    InvalidInputError
        If one is not a pair.
    """
    from ...controllers.rl import read_value

    found = {}
    for pair in pairs or ():
        key, equals, value = pair.partition("=")
        if not (equals and key):
            raise InvalidInputError(f"{option} takes KEY=VALUE, got {pair!r}")
        found[key.strip()] = read_value(value)
    return found


def chosen_recipe(
    algorithm: str, environment: str, file: Path | None, param: Sequence[str] | None, **typed: int | None
) -> Recipe:
    """Return the recipe of an algorithm and environment, with what was typed in place of what it says.

    Parameters
    ----------
    algorithm, environment : str
        By name.
    file : Path or None
        Recipe; the shipped one by default.
    param : sequence of str or None
        What ``-p`` got.
    **typed
        Keys of a recipe that have options of their own; None where such an option was not typed.

    Raises
    ------
    InvalidInputError
        If a recipe's file is of another algorithm or environment.
    """
    from ...controllers import Recipe
    from ...controllers.rl import environment_id

    recipe = Recipe.shipped(algorithm, environment) if file is None else Recipe.load(file)
    if (recipe.algorithm, recipe.environment) != (algorithm, environment_id(environment)):
        raise InvalidInputError(
            f"{file} is a recipe for {recipe.algorithm} on {recipe.environment}, asked for {algorithm} on {environment}"
        )
    overrides = {name: value for name, value in typed.items() if value is not None}
    return recipe.changed(read_pairs(param, "-p") | overrides)


def environment_arguments(
    backend: str | None, artifact: Path | None, settings: Sequence[str] | None = None, **named: str | None
) -> dict[str, Any]:
    """Return the arguments of an environment that were typed.

    Parameters
    ----------
    backend : str or None
        By name.
    artifact : Path or None
        Of the backend.
    settings : sequence of str or None
        What ``-e`` got; takes the place of what has an option of its own.
    **named
        Vehicle, terrain and path; None where one was not typed.
    """
    from ...surrogate import Surrogate

    arguments: dict[str, Any] = {name: value for name, value in named.items() if value is not None}
    if backend is not None:
        arguments["backend"] = backend
        if artifact is not None:
            arguments["backend_options"] = {"artifact": Surrogate.load(artifact)} if takes_artifact(backend) else {}
    return arguments | read_pairs(settings, "-e")


def judged_where(
    policy: Policy,
    backend: str,
    artifact: Path | None,
    settings: Sequence[str] | None,
    terrain: str | None,
    path: str | None,
) -> EnvironmentSpec:
    """Return where a policy is judged: its own environment, with what was typed."""
    return policy.environment_spec(**environment_arguments(backend, artifact, settings, terrain=terrain, path=path))
