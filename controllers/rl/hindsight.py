"""A hindsight replay buffer that keeps what a reward is computed from as columns, not as a dictionary a step."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from ...terrain import missing_extra

if TYPE_CHECKING:
    from stable_baselines3 import HerReplayBuffer

# What ``Monitor`` adds holds the time of day.
_LEFT_OUT: Final = "episode"
_SEPARATOR: Final = "/"


class InfoColumns:
    """The infos of every step in a ring: numbers, and flags as 0 and 1, one level of dictionaries deep.

    Takes the place of the array of dictionaries in stable-baselines3's buffer: a checkpoint can hold columns, they need
    less memory, and nothing is copied deeply for an update.

    Parameters
    ----------
    size, count : int
        Steps in the ring, and environments.
    """

    def __init__(self, size: int, count: int) -> None:
        self._shape: Final = (size, count)
        self.columns: Final[dict[str, NDArray[np.float64]]] = {}

    def __setitem__(self, position: int, infos: Sequence[Mapping[str, Any]]) -> None:
        """Keep the infos of a step, one an environment."""
        for column in self.columns.values():
            column[position] = np.nan
        for environment, info in enumerate(infos):
            for name, value in _numbers(info):
                self._column(name)[position, environment] = value

    def __getitem__(self, places: tuple[NDArray[np.int64], NDArray[np.int64]]) -> Infos:
        """Return the infos of steps and environments, paired."""
        groups: dict[str, dict[str, NDArray[np.float64]]] = {}
        for name, column in self.columns.items():
            outer, _, inner = name.rpartition(_SEPARATOR)
            groups.setdefault(outer, {})[inner] = column[places]
        infos = Infos({} for _ in range(len(places[0])))
        for outer, columns in groups.items():
            for info, part in zip(infos, _rows(columns), strict=True):
                if not outer:
                    info.update(part)
                elif part:
                    info[outer] = part
        return infos

    def restore(self, columns: Mapping[str, NDArray[np.float64]]) -> None:
        """Take up the columns of a checkpoint, each from the ring's start."""
        for name, values in columns.items():
            self._column(name)[: len(values)] = values

    def _column(self, name: str) -> NDArray[np.float64]:
        if name not in self.columns:
            self.columns[name] = np.full(self._shape, np.nan)
        return self.columns[name]


class Infos(list[dict[str, Any]]):
    """Infos made for one use: a deep copy of them is they themselves."""

    def __deepcopy__(self, memo: dict[int, Any]) -> Infos:
        return self


@cache
def hindsight_buffer() -> type[HerReplayBuffer]:
    """Return the buffer's class.

    Raises
    ------
    ConfigurationError
        If stable-baselines3 is not installed.
    """
    try:
        from stable_baselines3 import HerReplayBuffer
    except ImportError as error:
        raise missing_extra("stable-baselines3", "rl") from error

    class HindsightBuffer(HerReplayBuffer):
        """Goals relabelled, with the infos of the steps at hand where rewards are computed."""

        def __init__(self, *args: Any, **kwargs: Any) -> None:
            super().__init__(*args, **(kwargs | {"copy_info_dict": True}))
            self.infos: Any = InfoColumns(self.buffer_size, self.n_envs)

    return HindsightBuffer


def _numbers(info: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield numbers and flags by name, those of inner dictionaries by ``outer/inner``."""
    for name, value in info.items():
        if isinstance(value, Mapping):
            if name != _LEFT_OUT:
                for inner, part in value.items():
                    if _is_number(part):
                        yield f"{name}{_SEPARATOR}{inner}", part
        elif _is_number(value):
            yield name, value


def _is_number(value: Any) -> bool:
    return isinstance(value, bool | int | float | np.bool_ | np.number)


def _rows(columns: Mapping[str, NDArray[np.float64]]) -> list[dict[str, Any]]:
    """Return columns as a dictionary a row, without what a row does not have."""
    whole = {name: column for name, column in columns.items() if not np.isnan(column).any()}
    rows = (
        [dict(zip(whole, row, strict=True)) for row in np.column_stack(list(whole.values())).tolist()]
        if whole
        else [{} for _ in next(iter(columns.values()))]
    )
    for name in columns.keys() - whole.keys():
        for place in np.flatnonzero(~np.isnan(columns[name])).tolist():
            rows[place][name] = float(columns[name][place])
    return rows
