"""What a policy is worth: whole episodes without exploration, one a seed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Final

import gymnasium
import numpy as np

from ...terrain import FloatArray, InvalidInputError
from ...terrain.parameters import require_whole
from .environment import EnvironmentSpec
from .episode import Agent, drive_episode

#: Episodes that are driven at once.
_BLOCK: Final = 128
#: Of the standard normal distribution, 97.5 %.
_Z: Final = 1.959964
_BROKEN_OFF: Final = ("diverged", "off_map")
_ERROR: Final = "_error"

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class EpisodeResult:
    """One episode.

    Parameters
    ----------
    seed : int
        Of its reset.
    episode_return : float
        Sum of its rewards.
    length : int
        Its steps.
    ended : str
        ``terminated`` or ``truncated``, or ``diverged`` or ``off_map`` where the simulation broke off.
    success : bool or None
        Whether the goal was reached, where the task has one.
    measures : mapping
        RMSE over the episode of what the task calls an error, as ``..._rmse``, and the last value of what else it
        tells.
    """

    seed: int
    episode_return: float
    length: int
    ended: str
    success: bool | None = None
    measures: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Evaluation:
    """Episodes of one policy in one environment.

    Parameters
    ----------
    episodes : tuple of EpisodeResult
        One a seed.
    """

    episodes: tuple[EpisodeResult, ...]

    @property
    def return_mean(self) -> float:
        """Mean of the returns."""
        return float(np.mean([episode.episode_return for episode in self.episodes]))

    @property
    def return_margin(self) -> float:
        """Half the 95 % confidence interval of the mean return, from the normal distribution; NaN of one episode."""
        returns = [episode.episode_return for episode in self.episodes]
        if len(returns) < 2:
            return math.nan
        return float(_Z * np.std(returns, ddof=1) / math.sqrt(len(returns)))

    @property
    def success_rate(self) -> float | None:
        """Share of the episodes that reached their goal; None where the task has none."""
        found = [episode.success for episode in self.episodes if episode.success is not None]
        return sum(found) / len(found) if found else None

    @property
    def success_interval(self) -> tuple[float, float] | None:
        """Wilson's 95 % interval of the success rate."""
        rate, count = self.success_rate, len(self.episodes)
        if rate is None:
            return None
        centre = (rate + _Z**2 / (2 * count)) / (1 + _Z**2 / count)
        half = _Z / (1 + _Z**2 / count) * math.sqrt(rate * (1 - rate) / count + _Z**2 / (4 * count**2))
        return max(0.0, centre - half), min(1.0, centre + half)

    @property
    def measures(self) -> dict[str, float]:
        """Means over the episodes; of an RMSE, the root of the mean square over all steps."""
        names = sorted({name for episode in self.episodes for name in episode.measures})
        lengths = np.array([episode.length for episode in self.episodes], np.float64)
        found = {}
        for name in names:
            values = np.array([episode.measures.get(name, math.nan) for episode in self.episodes])
            pooled = name.endswith("_rmse")
            found[name] = float(np.sqrt(np.sum(lengths * values**2) / np.sum(lengths)) if pooled else np.mean(values))
        return found

    def summary(self) -> dict[str, Any]:
        """Return the figures over all episodes, as JSON can hold them."""
        content: dict[str, Any] = {
            "episodes": len(self.episodes),
            "return_mean": self.return_mean,
            "return_margin_95": None if math.isnan(self.return_margin) else self.return_margin,
            "length_mean": float(np.mean([episode.length for episode in self.episodes])),
            **self.measures,
        }
        if self.success_rate is not None:
            content |= {"success_rate": self.success_rate, "success_interval_95": list(self.success_interval or ())}
        return content

    def rows(self) -> list[dict[str, Any]]:
        """Return one mapping an episode, as JSON can hold it."""
        return [asdict(episode) for episode in self.episodes]


def evaluate(
    policy: Agent,
    environment: EnvironmentSpec,
    *,
    episodes: int,
    seed: int = 0,
    threads: int = 1,
    progress: Progress | None = None,
) -> Evaluation:
    """Drive whole episodes, of seeds ``seed``, ``seed + 1``, ...; compiled tasks many at once, to the same bits.

    Parameters
    ----------
    policy : Agent
        A :class:`~grouser.controllers.rl.Policy`, or anything else with ``act``.
    environment : EnvironmentSpec
        Where it drives.
    episodes : int
        How many.
    seed : int
        Of the first.
    threads : int
        That share a compiled batch.
    progress : callable, optional
        Called with episodes done and episodes in all.

    Raises
    ------
    InvalidInputError
        If there is no episode, or the policy's observations or actions are others.
    """
    require_whole("episodes", episodes, 1)
    require_whole("threads", threads, 1)
    seeds = range(seed, seed + episodes)
    blocks = [seeds[start : start + _BLOCK] for start in range(0, episodes, _BLOCK)]
    found: list[EpisodeResult] = []
    if environment.make_batch(1) is not None:
        for block in blocks:
            found += _batched(policy, environment, block, threads)
            if progress is not None:
                progress(len(found), episodes)
    else:
        for episode in _single(policy, environment, seeds):
            found.append(episode)
            if progress is not None:
                progress(len(found), episodes)
    return Evaluation(tuple(found))


def _batched(policy: Agent, environment: EnvironmentSpec, seeds: range, threads: int) -> list[EpisodeResult]:
    """Drive one episode a seed in a compiled batch; who has ended sits out the others' steps."""
    count = len(seeds)
    batch = environment.make_batch(count, threads)
    if batch is None:
        raise InvalidInputError(f"{environment.id} has no compiled batch")
    for index, seed in enumerate(seeds):
        batch.seed(index, seed)
        batch.restart(index)
    running = np.ones(count, np.bool_)
    returns, squares = np.zeros(count), np.zeros((count, len(batch.task.measures)))
    length = 0
    found: dict[int, EpisodeResult] = {}
    while running.any():
        batch.idle[:] = ~running
        batch.step(policy.act(batch.observations))
        length += 1
        returns[running] += batch.rewards[running]
        squares[running] += batch.measures[running] ** 2
        ended = running & (batch.terminated | batch.truncated)
        for index in np.flatnonzero(ended).tolist():
            lost = next((name for name in _BROKEN_OFF if getattr(batch.fleet, name)[index]), None)
            found[index] = EpisodeResult(
                seeds[index],
                float(returns[index]),
                length,
                lost or _end(bool(batch.terminated[index])),
                measures=_summed(batch.task.measures, squares[index], batch.measures[index], length),
            )
        running &= ~ended
    return [found[index] for index in range(count)]


def _single(policy: Agent, environment: EnvironmentSpec, seeds: range) -> Iterator[EpisodeResult]:
    """Drive one episode a seed, one after the other."""
    made = environment.make()
    try:
        for seed in seeds:
            yield judge_episode(policy, made, seed)
    finally:
        made.close()


def judge_episode(agent: Agent, environment: gymnasium.Env[Any, Any], seed: int) -> EpisodeResult:
    """Drive one episode, and return what it came to.

    Parameters
    ----------
    agent : Agent
        That drives; one that needs more than the observation may look into the environment.
    environment : gymnasium.Env
        Where it drives.
    seed : int
        Of the reset.
    """
    instants = drive_episode(agent, environment, seed)
    last = next(instants)
    names = tuple(name for name, value in last.info.items() if isinstance(value, float))
    total, length, squares = 0.0, 0, np.zeros(len(names))
    for last in instants:
        total += last.reward
        length += 1
        squares += _told(last.info, names) ** 2
    return EpisodeResult(
        seed,
        total,
        length,
        next((name for name in _BROKEN_OFF if last.info.get(name)), _end(last.terminated)),
        bool(last.info["is_success"]) if "is_success" in last.info else None,
        _summed(names, squares, _told(last.info, names), length),
    )


def _told(info: Mapping[str, Any], names: tuple[str, ...]) -> FloatArray:
    return np.array([info[name] for name in names])


def _summed(names: tuple[str, ...], squares: FloatArray, last: FloatArray, length: int) -> dict[str, float]:
    return {
        f"{name}_rmse" if name.endswith(_ERROR) else name: float(
            math.sqrt(squares[place] / length) if name.endswith(_ERROR) else last[place]
        )
        for place, name in enumerate(names)
    }


def _end(terminated: bool) -> str:
    return "terminated" if terminated else "truncated"
