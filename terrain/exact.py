"""The exact-path reference: the compiled block with the belt point's whole path over the ground."""

from __future__ import annotations

from typing import ClassVar

from .block import ShearPath
from .physics import PhysicsBackend


class ExactBackend(PhysicsBackend):
    """The block of :class:`PhysicsBackend` with the shear displacement of the exact path (Wong & Chiang, 2001).

    The soft block takes the slip velocity of this moment for the whole time that a belt point has been on the ground;
    here the point's path is followed back to where it entered, with the vehicle's rotation on the way. Forces oppose
    the sliding velocity of this moment, so that they jump where a cell's sliding changes its sign while the ground
    under it is sheared: the block is dearer, and less smooth, than the soft one. Both agree on straight runs.

    Parameters are those of :class:`PhysicsBackend`; with ``soft_speed`` 0 it is the published model.

    Examples
    --------
    The golden state of the documentation, at the default grid:

    >>> import numpy as np
    >>> from grouser.terrain import make_backend
    >>> exact = make_backend("exact", mode="rigid", vehicle="m113", soft_speed=0.0)
    >>> np.round(exact.forces(np.array([3, 0.2, 0.3, 0, 0, 2.5, 3.8, 0.7, 0, 0.05])))
    array([  7439., -23592.,  38767.])
    """

    name: ClassVar[str] = "exact"
    shear_path: ClassVar[ShearPath] = "exact"
