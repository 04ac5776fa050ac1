"""A finished drive, seen from above: in a window, as its last frame, or as a film."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path as FilePath
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..envs import STATE_NAMES, InterfaceLog, Path, VehicleState
from ..terrain import InvalidInputError, TrackedVehicle, missing_extra

_FORMATS: Final = {".png": "PNG", ".gif": "GIF"}
_WINDOW: Final = "human"
# A film of a whole drive in full size is larger than people like to share.
_FILM_SIZE: Final = (640, 360)
_STILL_SIZE: Final = (960, 540)
_PALETTE_FRAMES: Final = 8


def check_target(target: str) -> None:
    """See that a drive can be shown so, before it is driven.

    Raises
    ------
    InvalidInputError
        If it cannot.
    """
    if target and target != _WINDOW and FilePath(target).suffix.lower() not in _FORMATS:
        raise InvalidInputError(f"--render takes human, FILE.png or FILE.gif, got {target!r}")


def replay(log: InterfaceLog, path: Path, vehicle: TrackedVehicle, label: str, target: str, period: float) -> None:
    """Show a drive, one frame a control period.

    Parameters
    ----------
    log : InterfaceLog
        The drive.
    path : Path
        That was followed.
    vehicle : TrackedVehicle
        That drove.
    label : str
        For the panel.
    target : str
        ``human``, ``FILE.png`` or ``FILE.gif``.
    period : float
        Of a frame, in s.

    Raises
    ------
    ConfigurationError
        If pygame, or pillow for a file, is not installed.
    """
    from ..envs.rendering import Renderer

    states = [VehicleState(**dict(zip(STATE_NAMES, row, strict=True))) for row in log.states.tolist()]
    ticks = round(period / log.meta["tick"])
    shown = [*states[:-1:ticks], states[-1]]
    if target == _WINDOW:
        window = Renderer(path, vehicle, "human", fps=1 / period)
        for state in shown:
            window.draw(state, label=label)
        window.close()
        return
    kind = _FORMATS[FilePath(target).suffix.lower()]
    canvas = Renderer(path, vehicle, size=_FILM_SIZE if kind == "GIF" else _STILL_SIZE)
    drawn = (canvas.draw(state, label=label) for state in shown)
    frames = [frame for frame in drawn if frame is not None]
    canvas.close()
    _write(FilePath(target), kind, frames, period)


def _write(target: FilePath, kind: str, frames: list[NDArray[np.uint8]], period: float) -> None:
    from ..terrain import write_aside

    try:
        from PIL import Image
    except ImportError as error:
        raise missing_extra("pillow", "plot") from error
    buffer = BytesIO()
    if kind == "PNG":
        Image.fromarray(frames[-1]).save(buffer, format=kind)
    else:
        # One palette for all frames: faster than one each, and the ground does not flicker.
        sample = np.concatenate(frames[:: max(1, len(frames) // _PALETTE_FRAMES)])
        palette = Image.fromarray(sample).quantize()
        first, *others = (
            Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames
        )
        first.save(buffer, format=kind, save_all=True, append_images=others, duration=round(1000 * period), loop=0)
    write_aside(target, buffer.getvalue())
