"""The interface of the track-terrain block: columns, order, units and mirror symmetry, written once.

Physics, surrogates, dataset columns, the C core and CasADi all read this table. The order is Table I of the paper.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from .errors import InvalidInputError, unknown_name

Mode = Literal["rigid", "soil"]
FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Column:
    """One scalar that crosses the interface.

    Parameters
    ----------
    name : str
        Name in code, logs and datasets.
    unit : str
        SI unit.
    meaning : str
        What it is, in words.
    mirror_of : str
        Column that takes this value when left and right are exchanged.
    mirror_sign : int
        Sign that it takes on the way.
    reverse_sign : int
        Sign that it takes when front and rear are exchanged, the lateral axis staying as it is.
    """

    name: str
    unit: str
    meaning: str
    mirror_of: str
    mirror_sign: int
    reverse_sign: int


def _column(
    name: str, unit: str, meaning: str, mirror_sign: int = 1, reverse_sign: int = 1, mirror_of: str | None = None
) -> Column:
    return Column(name, unit, meaning, mirror_of or name, mirror_sign, reverse_sign)


_MOTION = (
    _column("vx", "m/s", "forward velocity of the CG, body axes", 1, -1),
    _column("vy", "m/s", "leftward velocity of the CG, body axes", -1),
    _column("yaw_rate", "rad/s", "yaw rate, positive counter-clockwise", -1, -1),
    _column("ax", "m/s^2", "inertial forward acceleration of the CG, previous tick", 1, -1),
    _column("ay", "m/s^2", "inertial leftward acceleration of the CG, previous tick", -1),
    _column("v_left", "m/s", "left belt speed, positive drives forward", 1, -1, mirror_of="v_right"),
    _column("v_right", "m/s", "right belt speed, positive drives forward", 1, -1, mirror_of="v_left"),
)
_MU = _column("mu", "1", "friction coefficient")
_COHESION = _column("c", "Pa", "cohesion")
_FRICTION_ANGLE = _column("phi", "rad", "angle of internal friction")
_ROLLING = _column("fr", "1", "rolling resistance coefficient")
_SHEAR_MODULUS = _column("k", "m", "shear deformation modulus")

OUTPUTS: Final = (
    _column("qx", "N", "forward force on the vehicle", 1, -1),
    _column("qy", "N", "leftward force on the vehicle", -1),
    _column("mz", "N m", "yaw moment about the CG", -1, -1),
)
OUTPUT_NAMES: Final = tuple(column.name for column in OUTPUTS)
MOTION_NAMES: Final = tuple(column.name for column in _MOTION)
MOTION_SIZE: Final = len(_MOTION)


@dataclass(frozen=True)
class Interface:
    """The columns that one terrain mode takes and returns.

    Parameters
    ----------
    mode : {"rigid", "soil"}
        Terrain mode.
    inputs : tuple of Column
        Input columns, in order.
    """

    mode: Mode
    inputs: tuple[Column, ...]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Input names, in order."""
        return tuple(column.name for column in self.inputs)

    @property
    def size(self) -> int:
        """Number of inputs d."""
        return len(self.inputs)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the terrain parameters θ, in order."""
        return self.names[MOTION_SIZE:]

    def index(self, name: str) -> int:
        """Position of an input.

        Raises
        ------
        ConfigurationError
            If the mode has no such input.
        """
        try:
            return self.names.index(name)
        except ValueError:
            raise unknown_name(f"{self.mode} input", name, self.names) from None

    @cached_property
    def mirror_permutation(self) -> NDArray[np.intp]:
        """Index array p such that ``x[..., p] * mirror_signs`` is the input seen in a mirror, shape (d,)."""
        return np.array([self.names.index(column.mirror_of) for column in self.inputs], dtype=np.intp)

    @cached_property
    def mirror_signs(self) -> FloatArray:
        """Sign of each mirrored input, shape (d,)."""
        return np.array([column.mirror_sign for column in self.inputs], dtype=np.float64)

    def mirror(self, x: FloatArray) -> FloatArray:
        """Exchange left and right in an interface array of shape (..., d)."""
        return x[..., self.mirror_permutation] * self.mirror_signs

    @cached_property
    def reverse_signs(self) -> FloatArray:
        """Sign of each input with front and rear exchanged, shape (d,)."""
        return np.array([column.reverse_sign for column in self.inputs], dtype=np.float64)

    def reverse(self, x: FloatArray) -> FloatArray:
        """Exchange front and rear in an interface array of shape (..., d): a symmetry where the CG is centred."""
        return x * self.reverse_signs

    def check(self, x: Any) -> FloatArray:
        """Return ``x`` as a float64 array of shape (d,) or (n, d).

        Raises
        ------
        InvalidInputError
            If it has another shape, does not convert to float64, or holds NaN or infinity.
        """
        try:
            given = np.asarray(x)
            if np.iscomplexobj(given):
                raise TypeError("they are complex")
            array = np.ascontiguousarray(given, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise InvalidInputError(f"expected numbers of shape ({self.size},) or (n, {self.size}): {error}") from error
        if array.ndim not in (1, 2) or array.shape[-1] != self.size:
            raise InvalidInputError(
                f"a {self.mode} interface array has shape ({self.size},) or (n, {self.size}) "
                f"with columns {', '.join(self.names)}; got shape {array.shape}"
            )
        if not np.isfinite(array).all():
            bad = sorted({int(column) for column in np.argwhere(~np.isfinite(array))[:, -1]})
            raise InvalidInputError(
                f"interface columns must be finite; not so: {', '.join(self.names[i] for i in bad)}"
            )
        return array


RIGID: Final = Interface("rigid", (*_MOTION, _MU, _ROLLING, _SHEAR_MODULUS))
SOIL: Final = Interface("soil", (*_MOTION, _COHESION, _FRICTION_ANGLE, _ROLLING, _SHEAR_MODULUS))
MODES: Final[tuple[Mode, ...]] = ("rigid", "soil")
OUTPUT_MIRROR_SIGNS: Final[FloatArray] = np.array([column.mirror_sign for column in OUTPUTS], dtype=np.float64)
OUTPUT_REVERSE_SIGNS: Final[FloatArray] = np.array([column.reverse_sign for column in OUTPUTS], dtype=np.float64)


def interface(mode: str) -> Interface:
    """Return the interface of a terrain mode.

    Raises
    ------
    ConfigurationError
        If the mode is neither ``rigid`` nor ``soil``.
    """
    if mode == "rigid":
        return RIGID
    if mode == "soil":
        return SOIL
    raise unknown_name("terrain mode", mode, MODES)


def mirror_forces(forces: FloatArray) -> FloatArray:
    """Exchange left and right in forces of shape (..., 3)."""
    return forces * OUTPUT_MIRROR_SIGNS


def reverse_forces(forces: FloatArray) -> FloatArray:
    """Exchange front and rear in forces of shape (..., 3)."""
    return forces * OUTPUT_REVERSE_SIGNS
