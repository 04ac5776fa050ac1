"""What an interrupted training of stable-baselines3 needs to go on to the same weights, as safetensors and JSON."""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ...surrogate.container import Tensors, pack, unpack
from ...terrain import ArtifactError, write_aside
from .hindsight import InfoColumns

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm
    from stable_baselines3.common.vec_env import VecNormalize

FORMAT_VERSION: Final = 1
_KIND: Final = "reinforcement-learning checkpoint"
_COUNTERS: Final = ("num_timesteps", "_n_updates", "_episode_num", "_current_progress_remaining")
_BUFFER: Final = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")
_EPISODES: Final = ("ep_start", "ep_length")


def save_checkpoint(path: FilePath, model: BaseAlgorithm) -> FilePath:
    """Write weights, optimizers, counters, statistics, replay buffer and generators as one sealed file.

    The environments are not in it: a training starts them anew at every checkpoint, whether it goes on or is resumed.
    """
    import torch

    tensors: Tensors = {}
    metadata: dict[str, Any] = {"format_version": FORMAT_VERSION, "kind": _KIND, "steps": model.num_timesteps}
    state_names, variables = model._get_torch_save_params()
    groups: dict[str, Any] = {}
    for name in state_names:
        owner = _attribute(model, name)
        if isinstance(owner, torch.optim.Optimizer):
            state = owner.state_dict()
            groups[name] = state["param_groups"]
            for index, entry in state["state"].items():
                tensors |= {f"optimizer/{name}/{index}/{key}": value.numpy() for key, value in entry.items()}
        else:
            tensors |= {f"module/{name}/{key}": value.numpy() for key, value in owner.state_dict().items()}
    tensors |= {f"variable/{name}": _attribute(model, name).detach().numpy() for name in variables}
    tensors["generator/torch"] = torch.get_rng_state().numpy()
    _, keys, position, has_gauss, gauss = np.random.get_state(legacy=True)  # noqa: NPY002 - the library draws from it
    tensors["generator/numpy"] = np.asarray(keys)
    metadata |= {
        "optimizers": groups,
        "counters": {name: getattr(model, name) for name in _COUNTERS if hasattr(model, name)},
        "generators": {
            "numpy": [int(position), int(has_gauss), float(gauss)],
            "actions": model.action_space.np_random.bit_generator.state,
        },
    }
    wrapper = model.get_vec_normalize_env()
    if wrapper is not None:
        for name, statistics in _statistics(wrapper).items():
            tensors |= {
                f"statistics/{name}/{part}": np.asarray(getattr(statistics, part), np.float64)
                for part in ("mean", "var", "count")
            }
    buffer = getattr(model, "replay_buffer", None)
    if buffer is not None:
        filled = buffer.buffer_size if buffer.full else buffer.pos
        for name, array in _buffer_arrays(buffer).items():
            tensors[f"buffer/{name}"] = array[:filled]
        metadata["buffer"] = {"position": int(buffer.pos), "full": bool(buffer.full)}
        if isinstance(getattr(buffer, "infos", None), InfoColumns):
            tensors["episodes"] = buffer._current_ep_start
            tensors |= {f"infos/{name}": column[:filled] for name, column in buffer.infos.columns.items()}
    return write_aside(path, pack(tensors, metadata))


def load_checkpoint(path: FilePath, model: BaseAlgorithm) -> None:
    """Restore a model that was built from the same recipe.

    Raises
    ------
    ArtifactError
        If the checkpoint is missing, truncated or altered, or of another recipe.
    """
    tensors, metadata = read_checkpoint(path)
    try:
        _restore(tensors, metadata, model)
    except (KeyError, TypeError, ValueError, RuntimeError, AttributeError) as error:
        raise ArtifactError(f"{path} is not a checkpoint of this training: {error}") from error


def read_checkpoint(path: FilePath) -> tuple[Tensors, dict[str, Any]]:
    """Return tensors and metadata of a checkpoint.

    Raises
    ------
    ArtifactError
        If it is missing, truncated or altered.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ArtifactError(f"cannot read checkpoint {str(path)!r}: {error.strerror}") from error
    tensors, metadata = unpack(data, str(path), FORMAT_VERSION)
    if metadata.get("kind") != _KIND:
        raise ArtifactError(f"{path} is not a {_KIND}")
    return tensors, metadata


def _restore(tensors: Tensors, metadata: dict[str, Any], model: BaseAlgorithm) -> None:
    import torch

    held = {
        name: torch.from_numpy(array.copy())
        for name, array in tensors.items()
        if not name.startswith(("buffer/", "infos/"))
    }
    state_names, variables = model._get_torch_save_params()
    for name in state_names:
        owner = _attribute(model, name)
        if isinstance(owner, torch.optim.Optimizer):
            moments: dict[int, dict[str, Any]] = {}
            for key, value in _below(held, f"optimizer/{name}/").items():
                index, _, part = key.partition("/")
                moments.setdefault(int(index), {})[part] = value
            owner.load_state_dict({"state": moments, "param_groups": metadata["optimizers"][name]})
        else:
            owner.load_state_dict(_below(held, f"module/{name}/"))
    for name in variables:
        with torch.no_grad():
            _attribute(model, name).copy_(held[f"variable/{name}"])
    for name, value in metadata["counters"].items():
        setattr(model, name, value)
    wrapper = model.get_vec_normalize_env()
    if wrapper is not None:
        for name, statistics in _statistics(wrapper).items():
            statistics.mean, statistics.var = (tensors[f"statistics/{name}/{part}"].copy() for part in ("mean", "var"))
            statistics.count = float(tensors[f"statistics/{name}/count"])
    buffer = getattr(model, "replay_buffer", None)
    if buffer is not None:
        for name, array in _buffer_arrays(buffer).items():
            saved = tensors[f"buffer/{name}"]
            array[: len(saved)] = saved
        buffer.pos, buffer.full = metadata["buffer"]["position"], metadata["buffer"]["full"]
        if isinstance(getattr(buffer, "infos", None), InfoColumns):
            buffer._current_ep_start[:] = tensors["episodes"]
            buffer.infos.restore(_below(tensors, "infos/"))
    position, has_gauss, gauss = metadata["generators"]["numpy"]
    np.random.set_state(("MT19937", tensors["generator/numpy"], position, has_gauss, gauss))  # noqa: NPY002
    torch.set_rng_state(held["generator/torch"])
    model.action_space.np_random.bit_generator.state = metadata["generators"]["actions"]


def _attribute(model: BaseAlgorithm, name: str) -> Any:
    found: Any = model
    for part in name.split("."):
        found = getattr(found, part)
    return found


def _below(held: dict[str, Any], prefix: str) -> dict[str, Any]:
    return {name.removeprefix(prefix): value for name, value in held.items() if name.startswith(prefix)}


def _statistics(wrapper: VecNormalize) -> dict[str, Any]:
    """Return the running statistics of a wrapper by name."""
    found: dict[str, Any] = {"returns": wrapper.ret_rms}
    if wrapper.norm_obs:
        parts = wrapper.obs_rms if isinstance(wrapper.obs_rms, dict) else {"": wrapper.obs_rms}
        found |= {f"observations/{key}": part for key, part in parts.items()}
    return found


def _buffer_arrays(buffer: Any) -> dict[str, Any]:
    """Return the arrays of a replay buffer, those of a dictionary by ``name/key``."""
    arrays: dict[str, Any] = {}
    for name in (*_BUFFER, *(name for name in _EPISODES if hasattr(buffer, name))):
        array = getattr(buffer, name)
        arrays |= {f"{name}/{key}": part for key, part in array.items()} if isinstance(array, dict) else {name: array}
    return arrays
