"""What a vector environment is asked for, checked: backend, numbers, seeds and masks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from ..terrain import (
    ConfigurationError,
    ForceBackend,
    GuardedBackend,
    InvalidInputError,
    make_backend,
    unknown_name,
)
from ..terrain.parameters import require_whole
from .batch import Batch
from .engine import compiled_ground, compiled_guard, compiled_kernel
from .reward import RewardFunction
from .task import ConfigT, EpisodeT, Task

#: When an episode that ended is followed by the next one.
AUTORESET_MODES: Final = (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP)


def make_batch(
    task: Task[ConfigT, EpisodeT],
    backend: str | ForceBackend,
    num_envs: int,
    *,
    threads: int,
    backend_options: Mapping[str, Any] | None,
    reward: RewardFunction | None,
) -> Batch[ConfigT, EpisodeT]:
    """Return the batch of a vector environment.

    Raises
    ------
    ConfigurationError
        If the backend or the ground is not compiled.
    InvalidInputError
        If there is no sub-environment or no thread.
    """
    for name, value in (("num_envs", num_envs), ("threads", threads)):
        require_whole(name, value, 1)
    built = make_backend(backend, mode=task.mode, vehicle=task.vehicle, **(backend_options or {}))
    try:
        compiled_kernel(built.primary if isinstance(built, GuardedBackend) else built)
        compiled_guard(built)
        for ground in task.grounds:
            compiled_ground(ground, {})
    except ConfigurationError as error:
        raise ConfigurationError(
            f"{error}. In gymnasium.make_vec, vectorization_mode='sync' steps single environments in turn"
        ) from error
    return Batch(task, built, num_envs, threads=threads, reward=reward)


def check_rendered_envs(count: int | None, num_envs: int) -> int:
    """Return the number of sub-environments that frames are made of; all by default.

    Raises
    ------
    InvalidInputError
        If there are not as many.
    """
    if count is None:
        return num_envs
    if isinstance(count, bool) or not isinstance(count, int) or not 1 <= count <= num_envs:
        raise InvalidInputError(f"rendered_envs must be a whole number from 1 to num_envs = {num_envs}, got {count!r}")
    return count


def check_track_forces(wanted: bool, backend: ForceBackend) -> bool:
    """Return whether infos tell track forces.

    Raises
    ------
    ConfigurationError
        If they are wanted of a backend that does not know the tracks apart.
    """
    if wanted and not backend.has_track_forces:
        raise ConfigurationError(
            f"track_forces=True needs a backend with has_track_forces, such as 'physics'; {backend.name!r} gives the "
            "force of the whole vehicle"
        )
    return wanted


def resolve_autoreset_mode(mode: AutoresetMode | str) -> AutoresetMode:
    """Return an autoreset mode given as one or by name.

    Raises
    ------
    ConfigurationError
        If it is none of ``AUTORESET_MODES``.
    """
    for known in AUTORESET_MODES:
        if mode in (known, known.value, known.name):
            return known
    raise unknown_name("autoreset mode", getattr(mode, "value", mode), [known.value for known in AUTORESET_MODES])


def sub_seeds(seed: int | Sequence[int | None] | None, count: int) -> Sequence[int | None]:
    """Return the seed of each sub-environment; one number s stands for s, s + 1, s + 2, ...

    Raises
    ------
    InvalidInputError
        If there are not as many seeds as sub-environments.
    """
    if seed is None:
        return [None] * count
    if isinstance(seed, int | np.integer):
        return range(int(seed), int(seed) + count)
    if len(seed) != count:
        raise InvalidInputError(f"a seed for all or for each of {count} sub-environments, got {len(seed)}")
    return seed


def check_reset_mask(mask: Any, count: int) -> NDArray[np.bool_]:
    """Return a mask of sub-environments, once it is seen to be one.

    Raises
    ------
    InvalidInputError
        If it is not, or holds nowhere.
    """
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (count,) or not mask.any():
        raise InvalidInputError(f"reset_mask is a bool array of shape ({count},) that holds somewhere, got {mask!r}")
    return mask
