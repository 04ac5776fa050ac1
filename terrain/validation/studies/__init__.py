"""Studies of the block: what is known of tracked vehicles, asked of it, and plotted."""

from typing import Final

from . import (
    drawbar_pull,
    friction_ellipse,
    grid_convergence,
    soft_exact,
    thrust_slip,
    turning_radius,
    turning_resistance,
)
from .study import Study
from .style import png

#: In the order of the report.
STUDIES: Final[tuple[Study, ...]] = (
    thrust_slip.STUDY,
    drawbar_pull.STUDY,
    turning_resistance.STUDY,
    friction_ellipse.STUDY,
    turning_radius.STUDY,
    soft_exact.STUDY,
    grid_convergence.STUDY,
)

__all__ = ["STUDIES", "Study", "png"]
