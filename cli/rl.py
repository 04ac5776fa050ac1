"""``grouser rl``: train a path-tracking policy, and judge one."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import typer

from ..envs import PathTrackingEnv
from ..terrain import InvalidInputError, resolve_ground
from ._console import StageBars, out, print_facts
from ._drivers import artifact_options
from ._options import Artifact, Backend, PathOrFile, Seed, Terrain, Vehicle, label_of, whole_numbers
from ._tables import table

if TYPE_CHECKING:
    from ..controllers import TrackingPolicy

rl = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="markdown",
    help="Train a path-tracking policy on any backend, and judge it on any other.",
)


@rl.command(
    epilog="Example: grouser rl train build/policy.safetensors --backend native --artifact build/m113-rigid.safetensors"
)
def train(
    output: Annotated[Path, typer.Argument(metavar="OUTPUT.safetensors", help="The policy.")],
    backend: Backend = "native",
    terrain: Terrain = "asphalt",
    path: PathOrFile = "iso-3888-1",
    vehicle: Vehicle = "m113",
    speed: Annotated[float, typer.Option(metavar="M/S", help="Speed at which progress earns most, in m/s.")] = 5.0,
    steps: Annotated[int, typer.Option(help="Environment steps of 0.1 s, rounded up to whole rollouts.")] = 36_864,
    environments: Annotated[int, typer.Option(help="Environments that are stepped in turn.")] = 4,
    rollout_steps: Annotated[int, typer.Option(help="Steps of each environment between two updates.")] = 256,
    batch_size: Annotated[int, typer.Option(help="Steps a minibatch of an update.")] = 256,
    epochs: Annotated[int, typer.Option(help="Passes over a rollout in an update.")] = 10,
    learning_rate: Annotated[float, typer.Option(help="Of Adam, falling to zero.")] = 2e-3,
    discount: Annotated[float, typer.Option(help="What a reward one step later is worth.")] = 0.9,
    hidden: Annotated[str, typer.Option(metavar="N,N", help="Widths of actor and critic.")] = "64,64",
    initial_log_std: Annotated[float, typer.Option(help="Logarithm of the exploration noise at the start.")] = -1.5,
    action_mode: Annotated[
        Literal["belts", "twist"], typer.Option(help="What an action is: two belt speeds, or speed and yaw rate.")
    ] = "twist",
    observe_terrain: Annotated[
        bool, typer.Option("--observe-terrain", help="Show the policy the terrain parameters.")
    ] = False,
    episode: Annotated[float, typer.Option(metavar="S", help="Length of an episode, in s.")] = 8.0,
    cross_track_weight: Annotated[float, typer.Option(help="Weight of the distance from the path.")] = 2.0,
    seed: Seed = 0,
    artifact: Artifact = None,
    tensorboard: Annotated[Path | None, typer.Option(metavar="FOLDER", help="Gets the learning curves.")] = None,
) -> None:
    """Train a policy by proximal policy optimization on grouser/PathTracking-v0.

    Episodes start anywhere along the path. The policy is kept as data, its deterministic actor with the scales of
    its task, and drives without the library that trained it: pass its file as --controller.
    """
    from ..controllers import PPOConfig, train_policy

    if output.suffix != ".safetensors":
        raise InvalidInputError(f"a policy's name ends in .safetensors, got {output.name!r}")
    config = PPOConfig(
        steps=steps,
        environments=environments,
        rollout_steps=rollout_steps,
        batch_size=batch_size,
        epochs=epochs,
        learning_rate=learning_rate,
        discount=discount,
        hidden=whole_numbers(hidden, "--hidden"),
        initial_log_std=initial_log_std,
        seed=seed,
    )
    environment = {
        "backend": backend,
        "vehicle": vehicle,
        "terrain": terrain,
        "path": path,
        "action_mode": action_mode,
        "reference_speed": speed,
        "observe_terrain": observe_terrain,
        "random_start": True,
        "time_limit": episode,
        "cross_track_weight": cross_track_weight,
        "backend_options": _backend_options(backend, artifact, terrain),
    }
    began = perf_counter()
    with StageBars() as tell:
        policy = train_policy(
            config,
            environment,
            progress=lambda done, total: tell("steps", done, total),
            tensorboard=None if tensorboard is None else str(tensorboard),
        )
    policy.save(output)
    print_facts(
        {
            "policy": output,
            "task": f"{label_of(vehicle)} on {label_of(terrain)} along {path} at {speed:g} m/s, {backend} backend",
            "time": f"{perf_counter() - began:.1f} s",
            "judge it": f"grouser rl evaluate {output} --backend physics --terrain {terrain} --path {path}",
        }
    )


@rl.command(epilog="Example: grouser rl evaluate build/policy.safetensors --backend physics --episodes 5")
def evaluate(
    policy: Annotated[Path, typer.Argument(metavar="POLICY", help="Policy that grouser rl train made.")],
    backend: Backend = "physics",
    terrain: Terrain = "asphalt",
    path: PathOrFile = "iso-3888-1",
    episodes: Annotated[int, typer.Option(min=1, help="Episodes, each from a start of its own.")] = 5,
    time_limit: Annotated[float, typer.Option(metavar="S", help="Of an episode, in s.")] = 60.0,
    seed: Seed = 0,
    artifact: Artifact = None,
) -> None:
    """Let a policy, without exploration, drive whole episodes from the path's start, and sum its rewards.

    Vehicle and task are those that it was trained on, save that episodes run from the path's start to its end. The
    backend, the ground and the path may be others: a policy trained on a surrogate is worth what it does on physics.
    """
    from ..controllers import TrackingPolicy

    loaded = TrackingPolicy.load(policy).require(resolve_ground(terrain).mode)
    settings = asdict(loaded.config) | {"random_start": False, "time_limit": time_limit}
    environment = PathTrackingEnv(
        backend, loaded.vehicle, terrain, path, backend_options=_backend_options(backend, artifact, terrain), **settings
    )
    listed = table(
        f"{policy.stem} on {backend}, {label_of(terrain)}, {environment.path.name}",
        ["ended", "seed", "return", "steps", "driven, m", "cross-track RMSE, m", "max, m"],
    )
    returns = []
    with StageBars() as tell:
        for index in range(episodes):
            row, total = _episode(environment, loaded, seed + index)
            listed.add_row(row[0], str(seed + index), f"{total:.2f}", *row[1:])
            returns.append(total)
            tell("episodes", index + 1, episodes)
    environment.close()
    out.print(listed)
    print_facts({"return": f"{np.mean(returns):.2f} ± {np.std(returns):.2f} over {episodes} episodes"})


def _episode(environment: PathTrackingEnv, policy: TrackingPolicy, seed: int) -> tuple[tuple[str, ...], float]:
    """Return how an episode ended, its steps, distance and errors as text, and its return."""
    observation, _ = environment.reset(seed=seed)
    total, errors, terminated, truncated = 0.0, [], False, False
    info: dict[str, Any] = {}
    while not (terminated or truncated):
        action = policy.act(observation).astype(np.float32)
        observation, reward, terminated, truncated, info = environment.step(action)
        total += reward
        errors.append(info["cross_track_error"])
    cross_track = np.array(errors)
    off = abs(cross_track[-1]) > environment.config.maximum_cross_track
    ended = "time ran out" if truncated else "off the path" if off else "at the end"
    rmse = float(np.sqrt(np.mean(cross_track**2)))
    return (
        ended, str(len(errors)), f"{info['progress']:.1f}", f"{rmse:.3f}", f"{abs(cross_track).max():.3f}"
    ), total  # fmt: skip


def _backend_options(backend: str, artifact: Path | None, terrain: str) -> dict[str, Any]:
    return artifact_options(backend, [artifact] if artifact else [], resolve_ground(terrain).mode)
