"""How every figure looks: colours that the colour-blind tell apart, one size of type, PNGs that are equal where they are."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from typing import Any, Final

from ...errors import missing_extra

#: Okabe-Ito.
BLACK, BLUE, ORANGE, GREEN = "#000000", "#0072B2", "#E69F00", "#009E73"
VERMILION, PURPLE, SKY, GREY = "#D55E00", "#CC79A7", "#56B4E9", "#7F7F7F"
CYCLE: Final = (BLUE, ORANGE, GREEN, VERMILION, PURPLE, SKY, BLACK, GREY)
#: Qx, Qy, Mz.
OUTPUT_COLORS: Final = (BLUE, VERMILION, GREEN)
OUTPUT_LABELS: Final = ("$Q_x$", "$Q_y$", "$M_z$")
_RESOLUTION: Final = 110


def new_figure(width: float, height: float) -> Any:
    """Return an empty matplotlib figure of this size in inches, with a constrained layout.

    Raises
    ------
    ConfigurationError
        If matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise missing_extra("matplotlib", "plot") from error
    return Figure(figsize=(width, height), layout="constrained")


def label(axis: Any, *, x: str = "", y: str = "", title: str = "") -> None:
    """Set the labels and a fine grid."""
    axis.set(xlabel=x, ylabel=y)
    axis.set_title(title, fontsize=10)
    axis.grid(alpha=0.3, linewidth=0.6)
    axis.set_axisbelow(True)


def plain_ticks(axis: Any, ticks: Sequence[float]) -> None:
    """Label a logarithmic matplotlib axis (``axes.xaxis``) with plain numbers at these ticks only."""
    axis.set_ticks(list(ticks), labels=[f"{tick:g}" for tick in ticks])
    axis.set_ticks([], minor=True)


def png(figure: Any) -> bytes:
    """Return a figure as PNG, without metadata, so that equal figures are equal files."""
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=_RESOLUTION, metadata={"Software": None})
    return buffer.getvalue()
