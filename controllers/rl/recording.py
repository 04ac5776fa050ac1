"""Episodes of a policy as a Minari dataset, which says what ground and which backend they were driven on."""

from __future__ import annotations

import os
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path as FilePath
from typing import Any, Final

import gymnasium
import numpy as np

from ...terrain import ConfigurationError, InvalidInputError, missing_extra, resolve_ground
from ...terrain.parameters import require_whole
from .environment import EnvironmentSpec
from .episode import drive_episode
from .policy import Policy

Progress = Callable[[int, int], None]

_ROOT: Final = "MINARI_DATASETS_PATH"
_KEY: Final = "grouser"
_PACKAGES: Final = ("grouser", "minari", "gymnasium", "numpy")


def record_dataset(
    policy: Policy,
    environment: EnvironmentSpec,
    name: str,
    *,
    episodes: int,
    seed: int = 0,
    root: FilePath | None = None,
    progress: Progress | None = None,
) -> FilePath:
    """Drive whole episodes without exploration and keep them as a Minari dataset, in its Arrow format.

    Its metadata has, under ``grouser``, what :meth:`EnvironmentSpec.facts` tells, with backend and artifact hash, the
    parameters of a uniform ground, the policy's content hash, and versions. ``infos`` are the numbers that the task
    tells of every step.

    Parameters
    ----------
    policy : Policy
        That drives.
    environment : EnvironmentSpec
        Where it drives.
    name : str
        Minari's id, such as ``grouser/path-tracking/ppo-v0``.
    episodes : int
        How many, of seeds ``seed``, ``seed + 1``, ...
    seed : int
        Of the first.
    root : Path, optional
        Folder of all datasets; by default Minari's own, which the variable MINARI_DATASETS_PATH names.
    progress : callable, optional
        Called with episodes done and episodes in all.

    Returns
    -------
    Path
        Of the dataset: ``minari.MinariDataset(path / "data")``, or ``minari.load_dataset(name)`` with that variable.

    Raises
    ------
    ConfigurationError
        If Minari is not installed, or there is such a dataset.
    InvalidInputError
        If the name is not one of Minari's, or there is no episode.
    """
    require_whole("episodes", episodes, 1)
    try:
        import minari
        import pyarrow  # noqa: F401 - Minari misses it only when it writes
        from minari.dataset.minari_dataset import parse_dataset_id
        from minari.namespace import create_namespace, list_local_namespaces
        from minari.storage.datasets_root_dir import get_dataset_path
    except ImportError as error:
        raise missing_extra("minari[arrow]", "offline") from error
    try:
        namespace, _, _ = parse_dataset_id(name)
    except ValueError as error:
        raise InvalidInputError(
            f"a dataset is called after the manner of grouser/path-tracking/ppo-v0, got {name!r}"
        ) from error
    with _datasets_in(root):
        target: FilePath = get_dataset_path(name)
    if target.exists():
        raise ConfigurationError(f"there is a dataset {target}: choose another version")
    facts = environment.facts()
    policy.require(facts)
    driven = environment.make()
    try:
        buffers = [*_episodes(policy, driven, range(seed, seed + episodes), progress)]
    finally:
        driven.close()
    # As JSON, without the artifact itself: whoever recovers the environment gets the shipped one.
    spec = replace(gymnasium.spec(environment.id), kwargs=dict(facts["arguments"]))
    folder = _root(root)
    with tempfile.TemporaryDirectory(prefix=".recording-", dir=folder) as aside, warnings.catch_warnings():
        # Minari warns of every field that is not given.
        warnings.simplefilter("ignore", UserWarning)
        with _datasets_in(FilePath(aside)):
            dataset = minari.create_dataset_from_buffers(
                name,
                buffers,
                env=spec,
                observation_space=policy.observation_space,
                action_space=policy.action_space,
                algorithm_name=str(policy.architecture.algorithm),
                description=f"{episodes} episodes of {environment.id}, without exploration",
                requirements=[f"grouser=={version('grouser')}"],
                data_format="arrow",
            )
            dataset.storage.update_metadata({_KEY: _metadata(policy, facts, seed)})
        with _datasets_in(root):
            if namespace is not None and namespace not in list_local_namespaces():
                create_namespace(namespace)
        target.parent.mkdir(parents=True, exist_ok=True)
        (FilePath(aside) / name).replace(target)
    return target


def _root(root: FilePath | None) -> FilePath:
    """Return the folder of all datasets, which is made where it is missing."""
    from minari.storage.datasets_root_dir import get_dataset_path

    with _datasets_in(root):
        folder: FilePath = get_dataset_path()
    return folder


def _metadata(policy: Policy, facts: Mapping[str, Any], seed: int) -> dict[str, Any]:
    parameters = getattr(resolve_ground(facts["arguments"]["terrain"]), "parameters", None)
    return {
        "environment": dict(facts),
        "terrain_parameters": None if parameters is None else np.asarray(parameters).tolist(),
        "artifact": facts["backend"].get("artifact"),
        "policy": policy.content_hash,
        "seed": seed,
        "versions": {package: version(package) for package in _PACKAGES},
    }


def _episodes(policy: Policy, environment: Any, seeds: range, progress: Progress | None) -> Iterator[Any]:
    from minari.data_collector.episode_buffer import EpisodeBuffer

    for index, seed in enumerate(seeds):
        start, *steps = drive_episode(policy, environment, seed)
        names = tuple(name for name, value in start.info.items() if isinstance(value, float))
        instants = (start, *steps)
        yield EpisodeBuffer(
            id=index,
            seed=seed,
            observations=_stacked([instant.observation for instant in instants]),
            actions=np.array([step.action for step in steps]),
            rewards=[step.reward for step in steps],
            terminations=[step.terminated for step in steps],
            truncations=[step.truncated for step in steps],
            infos={name: [instant.info[name] for instant in instants] for name in names},
        )
        if progress is not None:
            progress(index + 1, len(seeds))


def _stacked(observations: list[Any]) -> Any:
    if isinstance(observations[0], Mapping):
        return {key: np.array([observation[key] for observation in observations]) for key in observations[0]}
    return np.array(observations)


@contextmanager
def _datasets_in(root: FilePath | None) -> Iterator[None]:
    """Let Minari, which asks the environment variable at every call, look for datasets in a folder."""
    if root is None:
        yield
        return
    before = os.environ.get(_ROOT)
    os.environ[_ROOT] = str(root)
    try:
        yield
    finally:
        if before is None:
            del os.environ[_ROOT]
        else:
            os.environ[_ROOT] = before
