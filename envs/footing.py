"""What the ground is to one tick: θ under the vehicle or under each track, and gravity on the slope there."""

from __future__ import annotations

import math
from typing import Final, Literal, NamedTuple

import numpy as np

from ..terrain import (
    MOTION_SIZE,
    FloatArray,
    ForceBackend,
    ForceFunction,
    Gravity,
    Ground,
    InvalidInputError,
    SlopedGround,
    TerrainField,
    TrackedVehicle,
    body_gravity,
    level_equivalent,
    on_slope,
)
from .path import Path

#: Where the ground's parameters are taken: at the CG, or at the middle of each track.
GroundSampling = Literal["vehicle", "tracks"]
GROUND_SAMPLINGS: Final[tuple[GroundSampling, ...]] = ("vehicle", "tracks")


class Footing(NamedTuple):
    """Ground and gravity of one tick.

    Parameters
    ----------
    theta : ndarray, shape (p,)
        Terrain parameters under the vehicle, or under its left track.
    right_theta : ndarray, shape (p,)
        Under the right track; ``theta`` itself where the ground is sampled at the vehicle.
    gravity : Gravity
        In body axes.
    """

    theta: FloatArray
    right_theta: FloatArray
    gravity: Gravity

    @property
    def split(self) -> bool:
        """Whether each track has its own ground."""
        return self.right_theta is not self.theta

    def right_row(self, row: FloatArray) -> FloatArray:
        """Return the interface row of the right track, given the left one's."""
        if not self.split:
            return row
        right = row.copy()
        right[MOTION_SIZE:] = self.right_theta
        return right


def sample_ground(
    ground: Ground, vehicle: TrackedVehicle, sampling: GroundSampling, *, x: float, y: float, heading: float
) -> Footing:
    """Return the footing of a vehicle whose CG is at (x, y) in m; the slope is that at the CG."""
    gravity = body_gravity(ground.gradient_at(x, y), heading)
    if sampling == "vehicle":
        theta = ground.parameters_at(x, y)
        return Footing(theta, theta, gravity)
    ahead, aside = vehicle.contact_center, vehicle.tread / 2
    cosine, sine = math.cos(heading), math.sin(heading)
    middle_x, middle_y = x + ahead * cosine, y + ahead * sine
    left = ground.parameters_at(middle_x - aside * sine, middle_y + aside * cosine)
    right = ground.parameters_at(middle_x + aside * sine, middle_y - aside * cosine)
    return Footing(left, right, gravity)


def require_covered(ground: Ground, path: Path, margin: float) -> None:
    """Raise unless a map that refuses positions beyond it reaches ``margin`` m around a path.

    Raises
    ------
    InvalidInputError
        If a vehicle that keeps to the task could leave the map.
    """
    while isinstance(ground, SlopedGround):
        ground = ground.ground
    if not isinstance(ground, TerrainField) or ground.outside != "refuse":
        return
    x, y, _, _ = path.sample(np.linspace(0.0, path.length, 1 + math.ceil(path.length)))
    x_min, x_max, y_min, y_max = ground.extent
    least = (float(x.min()) - margin, float(x.max()) + margin, float(y.min()) - margin, float(y.max()) + margin)
    if not (x_min <= least[0] and least[1] <= x_max and y_min <= least[2] and least[3] <= y_max):
        raise InvalidInputError(
            "the terrain field's map, x {:g} to {:g} and y {:g} to {:g} m, must reach x {:.1f} to {:.1f} and y {:.1f} "
            "to {:.1f} m on this path; make it larger, or let its borders go on with outside='extend'".format(
                *ground.extent, *least
            )
        )


def forces_on(footing: Footing, backend: ForceBackend, evaluate: ForceFunction) -> ForceFunction:
    """Return the force function of one tick.

    Parameters
    ----------
    footing : Footing
        Ground and gravity.
    backend : ForceBackend
        Asked track by track where the ground is split.
    evaluate : callable
        Forces and Jacobian of one row on level ground that is the same under both tracks.
    """
    ratio = footing.gravity.load_ratio
    if not footing.split:
        return on_slope(backend.interface, evaluate, ratio)

    # The slope rule scales the row that it is given, which holds the left track's θ alone.
    level_right = level_equivalent(
        backend.interface, np.concatenate([np.zeros(MOTION_SIZE), footing.right_theta]), ratio
    )

    def split(row: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Jacobian columns of θ are those of a change under both tracks."""
        right = row.copy()
        right[MOTION_SIZE:] = level_right[MOTION_SIZE:]
        forces, jacobian = backend.track_forces_and_jacobian(row, right)
        return forces[0].sum(axis=0), jacobian[0].sum(axis=0)

    return on_slope(backend.interface, split, ratio)


def track_forces_on(footing: Footing, backend: ForceBackend, row: FloatArray, *, rolling: bool = True) -> FloatArray:
    """Return [Fx, Fy, M] of each track, shape (2, 3), for the row of an accepted evaluation.

    Without ``rolling`` they are the shear forces alone, which the belts turn against; rolling resistance acts on the
    body.
    """
    forces: FloatArray = sloped_track_forces(
        backend, row, footing.right_row(row), footing.gravity.load_ratio, rolling=rolling
    )[0]
    return forces


def sloped_track_forces(
    backend: ForceBackend, left: FloatArray, right: FloatArray, load_ratio: float | FloatArray, *, rolling: bool
) -> FloatArray:
    """Return :func:`track_forces_on` of any number of rows, shape (n, 2, 3).

    Parameters
    ----------
    backend : ForceBackend
        That knows the tracks apart.
    left, right : ndarray, shape (d,) or (n, d)
        Rows of each track.
    load_ratio : float, or ndarray of shape (n,)
        g_z/g, for all rows or each.
    rolling : bool
        Whether with rolling resistance.
    """
    left, right = (level_equivalent(backend.interface, each, load_ratio) for each in (left, right))
    if not rolling:
        resistance = backend.interface.index("fr")
        left, right = left.copy(), right.copy()
        left[..., resistance] = right[..., resistance] = 0.0
    forces: FloatArray = np.asarray(load_ratio)[..., None, None] * backend.track_forces(left, right)
    return forces
