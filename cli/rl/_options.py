"""Options that the verbs of ``grouser rl`` share, and what they add up to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from ...envs import path_names
from ...terrain import InvalidInputError, resolve_ground, terrain_names, vehicle_names
from .._drivers import artifact_options
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


def chosen_recipe(algorithm: str, environment: str, file: Path | None, overrides: Mapping[str, Any]) -> Recipe:
    """Return the recipe of an algorithm and environment, with what was typed in place of what it says.

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
    return recipe.changed(overrides)


def environment_arguments(backend: str | None, artifact: Path | None, **named: str | None) -> dict[str, Any]:
    """Return the arguments of an environment that were typed."""
    arguments: dict[str, Any] = {name: value for name, value in named.items() if value is not None}
    if backend is not None:
        arguments["backend"] = backend
        if artifact is not None:
            mode = resolve_ground(named.get("terrain") or "asphalt").mode
            arguments["backend_options"] = artifact_options(backend, [artifact], mode)
    return arguments


def judged_where(
    policy: Policy,
    backend: str,
    artifact: Path | None,
    settings: Sequence[str] | None,
    terrain: str | None,
    path: str | None,
) -> EnvironmentSpec:
    """Return where a policy is judged: its own environment, with what was typed."""
    ground = terrain or policy.environment["arguments"].get("terrain")
    arguments = environment_arguments(backend, artifact, terrain=ground, path=path)
    return policy.environment_spec(**arguments, **read_pairs(settings, "-e"))
