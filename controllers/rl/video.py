"""An episode of a policy as a film."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path as FilePath
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ...terrain import ConfigurationError, InvalidInputError, missing_extra
from .environment import EnvironmentSpec
from .episode import Agent, drive_episode

_SUFFIXES: Final = (".mp4",)
# H.264 takes heights and widths that this divides.
_BLOCK: Final = 2


def film(
    policy: Agent,
    environment: EnvironmentSpec,
    target: FilePath,
    *,
    episodes: int = 1,
    seed: int = 0,
    progress: Callable[[int], None] | None = None,
) -> int:
    """Write episodes of a policy, one after the other, as an .mp4 file; return its frames.

    Parameters
    ----------
    policy : Agent
        That drives, without exploration.
    environment : EnvironmentSpec
        Where it drives; its frames are those of ``render_mode="rgb_array"``, one a control period.
    target : Path
        The file.
    episodes : int
        How many.
    seed : int
        Of the first.
    progress : callable, optional
        Called with the number of frames so far.

    Raises
    ------
    InvalidInputError
        If the file's name does not end in .mp4.
    ConfigurationError
        If imageio or its ffmpeg is not installed, or the environment draws no frames.
    """
    if target.suffix.lower() not in _SUFFIXES:
        raise InvalidInputError(f"a film's name ends in .mp4, got {target.name!r}")
    try:
        import imageio.v2
        import imageio_ffmpeg  # noqa: F401 - imageio misses it only at the first frame
    except ImportError as error:
        raise missing_extra("imageio[ffmpeg]", "render") from error
    made = environment.make(render_mode="rgb_array")
    target.parent.mkdir(parents=True, exist_ok=True)
    count = 0
    with tempfile.TemporaryDirectory(prefix=".film-", dir=target.parent) as folder, closing(made):
        # Under its own name: the encoder takes the container from the suffix.
        aside = FilePath(folder) / target.name
        writer = imageio.v2.get_writer(
            aside, fps=made.metadata["render_fps"], macro_block_size=_BLOCK, ffmpeg_log_level="error"
        )
        with writer:
            for index in range(episodes):
                for frame in _frames(policy, made, seed + index):
                    writer.append_data(frame)
                    count += 1
                    if progress is not None:
                        progress(count)
        aside.replace(target)
    return count


def _frames(policy: Agent, environment: Any, seed: int) -> Iterator[NDArray[np.uint8]]:
    for _ in drive_episode(policy, environment, seed):
        frame = environment.render()
        if not isinstance(frame, np.ndarray):
            raise ConfigurationError(f"{environment.spec.id} draws no frames")
        yield frame
