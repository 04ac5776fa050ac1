"""The batched environments as stable-baselines3 takes them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, Final

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import ArrayLike, NDArray

from ..terrain import ConfigurationError, missing_extra
from .disturbances import Delay, DelayLine, GaussianNoise, Rows
from .step_info import drawn_info
from .vector import TrackedVehicleVectorEnv

if TYPE_CHECKING:
    from stable_baselines3.common.vec_env import VecEnv

Indices = int | Iterable[int] | None


def make_sb3_vec_env(
    id: str,
    num_envs: int,
    *,
    seed: int | None = None,
    observation_noise: ArrayLike | None = None,
    action_delay: Delay | None = None,
    **kwargs: Any,
) -> VecEnv:
    """Make a batched environment for stable-baselines3.

    It counts the episodes as ``VecMonitor`` does: the ``info`` of an episode's last step holds ``episode`` with its
    return ``r``, length ``l`` and the time ``t`` in s since the environment was made, ``terminal_observation``, and
    ``TimeLimit.truncated``. Every other ``info`` is one shared empty dict. What a reset tells is in ``reset_infos``.

    Parameters
    ----------
    id : str
        Such as ``"grouser/PathTracking-v0"``.
    num_envs : int
        Number of sub-environments.
    seed : int, optional
        Of the first reset: sub-environment i takes ``seed + i``.
    observation_noise : array_like, optional
        Standard deviations, as :class:`~grouser.envs.ObservationNoise` takes them; the same noise, terminal
        observations included.
    action_delay : int or pair of int, optional
        As :class:`~grouser.envs.ActionDelay` takes it.
    **kwargs
        Of the vector environment: ``backend``, ``vehicle``, ``terrain``, ``threads``, settings.

    Returns
    -------
    stable_baselines3.common.vec_env.VecEnv

    Raises
    ------
    ConfigurationError
        If stable-baselines3 is not installed, or the environment is not one of grouser's batched ones.
    InvalidInputError
        If the noise or the delay is impossible.

    Examples
    --------
    >>> make_sb3_vec_env("grouser/PathTracking-v0", 8, backend="physics").num_envs
    8
    """
    kind = _adapter()
    vector = gymnasium.make_vec(
        id,
        num_envs=num_envs,
        vectorization_mode="vector_entry_point",
        autoreset_mode=AutoresetMode.SAME_STEP,
        **kwargs,
    )
    if not isinstance(vector, TrackedVehicleVectorEnv):
        raise ConfigurationError(f"{id!r} is none of grouser's batched environments: wrap it in DummyVecEnv")
    space, actions = vector.single_observation_space, vector.single_action_space
    noise = None if observation_noise is None else GaussianNoise(observation_noise, space, num_envs)
    delay = None if action_delay is None else DelayLine(action_delay, actions, num_envs)
    adapter = kind(vector, noise, delay)
    if seed is not None:
        adapter.seed(seed)
    return adapter


@cache
def _adapter() -> Callable[[TrackedVehicleVectorEnv[Any, Any], GaussianNoise | None, DelayLine | None], VecEnv]:
    """Return the adapter's class, which can only be made once stable-baselines3 is there."""
    try:
        from stable_baselines3.common.monitor import Monitor
        from stable_baselines3.common.vec_env import VecEnv
    except ImportError as error:
        raise missing_extra("stable-baselines3", "rl") from error

    class BatchedVecEnv(VecEnv):
        """A batch of vehicles at one task.

        Parameters
        ----------
        vector : TrackedVehicleVectorEnv
            Whose batch is stepped; it is not to be used beside this.
        noise : GaussianNoise or None
            On what is observed.
        delay : DelayLine or None
            Of what is commanded.
        """

        def __init__(
            self, vector: TrackedVehicleVectorEnv[Any, Any], noise: GaussianNoise | None, delay: DelayLine | None
        ) -> None:
            self.vector: Final = vector
            self._noise, self._delay = noise, delay
            self._batch = vector.batch
            self._actions: Any = None
            self._nothing: dict[str, Any] = {}
            self._everyone = np.arange(vector.num_envs)
            self._returns = np.zeros(vector.num_envs)
            self._lengths = np.zeros(vector.num_envs, np.int64)
            self._made = time.perf_counter()
            super().__init__(vector.num_envs, vector.single_observation_space, vector.single_action_space)

        def reset(self) -> NDArray[np.float32]:
            """Start every sub-environment, with the seeds and options that were set since the last reset."""
            for index in range(self.num_envs):
                if (seed := self._seeds[index]) is not None:
                    for drawn in (self._batch, self._noise, self._delay):
                        if drawn is not None:
                            drawn.seed(index, seed)
                self._begin(index, self._options[index])
            self._reset_seeds()
            self._reset_options()
            self._returns[:] = 0.0
            self._lengths[:] = 0
            return self._observed(self._everyone)

        def _begin(self, index: int, options: dict[str, Any] | None = None) -> None:
            """Start an episode of a sub-environment."""
            batch = self._batch
            batch.restart(index, options)
            info = dict(zip(batch.task.measures, batch.measures[index].tolist(), strict=True))
            info |= drawn_info(batch.task.mode, batch.drawn[index].tolist() if batch.randomized[index] else None)
            if self._delay is not None:
                self._delay.begin(np.array([index]))
                info["action_delay"] = int(self._delay.delays[index])
            self.reset_infos[index] = info

        def _observed(self, rows: Rows) -> NDArray[np.float32]:
            """Return what some sub-environments observe; each call makes noise of its own."""
            observations: NDArray[np.float32] = self._batch.observations[rows]
            return observations if self._noise is None else self._noise.add(observations, rows)

        def step_async(self, actions: NDArray[Any]) -> None:
            """Take the actions of the next step."""
            self._actions = actions

        def step_wait(
            self,
        ) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.bool_], list[dict[str, Any]]]:
            """Step, and start the next episode of every sub-environment whose last one ended."""
            batch = self._batch
            batch.step(self._actions if self._delay is None else self._delay.shift(self._actions))
            rewards, dones = batch.rewards.copy(), batch.terminated | batch.truncated
            self._returns += rewards
            self._lengths += 1
            infos = [self._nothing] * self.num_envs
            for index in np.flatnonzero(dones).tolist():
                infos[index] = self._end(index)
            return self._observed(self._everyone), rewards, dones, infos

        def _end(self, index: int) -> dict[str, Any]:
            """Start a sub-environment's next episode and return what there is to say of the last."""
            batch, fleet = self._batch, self._batch.fleet
            info = dict(zip(batch.task.measures, batch.measures[index].tolist(), strict=True))
            info |= {name: True for name in ("diverged", "off_map") if getattr(fleet, name)[index]}
            info["TimeLimit.truncated"] = bool(batch.truncated[index])
            info["terminal_observation"] = self._observed(np.array([index]))[0]
            info["episode"] = {
                "r": float(self._returns[index]),
                "l": int(self._lengths[index]),
                "t": round(time.perf_counter() - self._made, 6),
            }
            self._returns[index] = self._lengths[index] = 0
            self._begin(index)
            return info

        def close(self) -> None:
            """Release the vector environment."""
            self.vector.close()

        def get_attr(self, attr_name: str, indices: Indices = None) -> list[Any]:
            """Return an attribute that all sub-environments share, of the task or the vector environment."""
            for owner in (self._batch.task, self.vector):
                if hasattr(owner, attr_name):
                    return [getattr(owner, attr_name) for _ in self._get_indices(indices)]
            raise AttributeError(f"no sub-environment has the attribute {attr_name!r}")

        def set_attr(self, attr_name: str, value: Any, indices: Indices = None) -> None:
            """Refuse: sub-environments have no attributes of their own."""
            raise AttributeError(f"{attr_name!r} cannot be set: the sub-environments are rows of one batch")

        def env_method(
            self, method_name: str, *method_args: Any, indices: Indices = None, **method_kwargs: Any
        ) -> list[Any]:
            """Call a method of the task, once for each sub-environment; ``reconfigure`` once for all of them."""
            (method, *_) = self.get_attr(method_name, 0)
            chosen = list(self._get_indices(indices))
            if method_name == "reconfigure":
                if sorted(chosen) != list(range(self.num_envs)):
                    raise ConfigurationError("reconfigure is for all sub-environments: they share one task")
                return [method(*method_args, **method_kwargs)] * self.num_envs
            return [method(*method_args, **method_kwargs) for _ in chosen]

        def env_is_wrapped(
            self, wrapper_class: type[gymnasium.Wrapper[Any, Any, Any, Any]], indices: Indices = None
        ) -> list[bool]:
            """Whether each sub-environment does what a wrapper would: it counts episodes, as ``Monitor`` does."""
            return [issubclass(Monitor, wrapper_class) for _ in self._get_indices(indices)]

        def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
            """Return a frame of each sub-environment that is rendered, or none without a render mode."""
            frames = None if self.render_mode is None else self.vector.render()
            return frames or [None] * self.num_envs

    return BatchedVecEnv
