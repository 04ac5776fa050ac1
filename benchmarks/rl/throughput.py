"""Frames a second of PPO, and how much of the time is the environment's, one learner a kind of environment."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from time import perf_counter
from typing import Any, Final

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecEnvWrapper

from grouser.envs.sb3 import make_sb3_vec_env

_HIDDEN: Final = (64, 64)


@dataclass(frozen=True)
class Setting:
    """Hyper-parameters that every learner has.

    Parameters
    ----------
    environments, rollout_steps, batch_size, epochs : int
        Of PPO.
    """

    environments: int = 256
    rollout_steps: int = 32
    batch_size: int = 2048
    epochs: int = 10


class FreeVecEnv(VecEnv):
    """An environment that costs nothing, so that only the learner is measured: the same arrays at every step."""

    def __init__(self, environments: int, observations: int, actions: int) -> None:
        box = gymnasium.spaces.Box(-10, 10, (observations,), np.float32)
        super().__init__(environments, box, gymnasium.spaces.Box(-1, 1, (actions,), np.float32))
        generator = np.random.default_rng(0)
        self._observations = generator.normal(size=(environments, observations)).astype(np.float32)
        self._rewards = generator.normal(size=environments).astype(np.float32)
        self._dones = np.zeros(environments, np.bool_)
        self._infos: list[dict[str, Any]] = [{}] * environments

    def reset(self) -> np.ndarray:
        return self._observations

    def step_async(self, actions: np.ndarray) -> None:
        pass

    def step_wait(self) -> Any:
        return self._observations, self._rewards, self._dones, self._infos

    def close(self) -> None:
        pass

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        return [None] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        raise AttributeError(attr_name)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        raise AttributeError(method_name)

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        return [False] * self.num_envs


class Stopwatch(VecEnvWrapper):
    """Adds up the time that an environment takes."""

    def __init__(self, environment: VecEnv) -> None:
        super().__init__(environment)
        self.seconds = 0.0

    def reset(self) -> Any:
        return self.venv.reset()

    def step_async(self, actions: np.ndarray) -> None:
        self.venv.step_async(actions)

    def step_wait(self) -> Any:
        began = perf_counter()
        stepped = self.venv.step_wait()
        self.seconds += perf_counter() - began
        return stepped


def path_tracking(backend: str, threads: int) -> Callable[[int], VecEnv]:
    """Return a maker of the batched ``grouser/PathTracking-v0`` on the M113, as it is shipped."""
    return lambda count: make_sb3_vec_env(
        "grouser/PathTracking-v0", count, seed=0, backend=backend, threads=threads, random_start=True
    )


def free(observations: int = 19, actions: int = 2) -> Callable[[int], VecEnv]:
    """Return a maker of the environment that costs nothing, of the sizes of path tracking."""
    return lambda count: FreeVecEnv(count, observations, actions)


def parking() -> Callable[[int], VecEnv]:
    """Return a maker of highway-env's ``parking-v0``, its kinematic vehicle, its observation flattened for PPO."""

    def make_one() -> gymnasium.Env[Any, Any]:
        import highway_env  # noqa: F401  registers its environments

        return gymnasium.wrappers.FlattenObservation(gymnasium.make("parking-v0"))

    return lambda count: DummyVecEnv([make_one] * count)


class Learner:
    """PPO on one environment, a rollout and its update at a time.

    Parameters
    ----------
    make : callable
        Returns the environment of so many vehicles.
    setting : Setting
        Hyper-parameters.
    """

    def __init__(self, make: Callable[[int], VecEnv], setting: Setting) -> None:
        self._setting: Final = setting
        self._watch = Stopwatch(make(setting.environments))
        self._model = PPO(
            "MlpPolicy",
            self._watch,
            n_steps=setting.rollout_steps,
            batch_size=setting.batch_size,
            n_epochs=setting.epochs,
            policy_kwargs={"net_arch": list(_HIDDEN), "activation_fn": torch.nn.Tanh},
            seed=0,
            device="cpu",
        )
        # The library's own logger makes itself a folder among the temporary files.
        self._model.set_logger(Logger(None, []))
        self._rounds: list[tuple[float, float]] = []

    def round(self, rollouts: int) -> None:
        """Learn from some rollouts, and note frames a second and the environment's share of the time."""
        frames = rollouts * self._setting.environments * self._setting.rollout_steps
        self._watch.seconds = 0.0
        began = perf_counter()
        self._model.learn(frames, reset_num_timesteps=False)
        elapsed = perf_counter() - began
        self._rounds.append((frames / elapsed, self._watch.seconds / elapsed))

    def figures(self) -> dict[str, float]:
        """Return the medians over the rounds after the first, which warms up, and the spread of the rate."""
        rates = [rate for rate, _ in self._rounds[1:]]
        return {
            "fps": median(rates),
            "lowest fps": min(rates),
            "highest fps": max(rates),
            "environment's share": median(share for _, share in self._rounds[1:]),
        }
