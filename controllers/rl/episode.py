"""One whole episode of an agent, instant by instant: what evaluations, films and datasets are made of."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, Protocol

import gymnasium
import numpy as np
from numpy.typing import NDArray


class Agent(Protocol):
    """What can be judged: anything that acts on observations, of one environment or of many at once."""

    def act(self, observation: Any, /) -> NDArray[np.float32]:
        """Return the action."""


class Instant(NamedTuple):
    """An instant of an episode: its start, or what a step led to.

    Parameters
    ----------
    observation : ndarray or mapping of str to ndarray
        As the environment returned it.
    info : mapping
        As the environment returned it.
    action : ndarray, shape (a,), or None
        That led here; None at the start.
    reward : float
        Of that step; 0 at the start.
    terminated, truncated : bool
        Whether the episode ends here.
    """

    observation: Any
    info: Mapping[str, Any]
    action: NDArray[np.float32] | None = None
    reward: float = 0.0
    terminated: bool = False
    truncated: bool = False


def drive_episode(agent: Agent, environment: gymnasium.Env[Any, Any], seed: int) -> Iterator[Instant]:
    """Drive one episode, and yield its start and every step when it is asked for.

    The environment stands where the last instant says, so that it may be rendered or looked into between two of them.

    Parameters
    ----------
    agent : Agent
        That drives.
    environment : gymnasium.Env
        Where it drives.
    seed : int
        Of the reset.
    """
    observation, info = environment.reset(seed=seed)
    instant = Instant(observation, info)
    yield instant
    while not (instant.terminated or instant.truncated):
        action = agent.act(instant.observation)
        observation, reward, terminated, truncated, info = environment.step(action)
        instant = Instant(observation, info, action, float(reward), bool(terminated), bool(truncated))
        yield instant
