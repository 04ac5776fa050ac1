from collections.abc import Sequence
from typing import Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

_Array: TypeAlias = NDArray[np.float64]

class Physics:
    def __new__(
        cls,
        *,
        mode: int,
        contact: int,
        path: int,
        wheels: int,
        along: int,
        across: int,
        mass: float,
        gravity: float,
        contact_length: float,
        element_length: float,
        element_spacing: float,
        tread: float,
        track_width: float,
        cg_height: float,
        contact_center: float,
        soft_speed: float,
    ) -> Self: ...
    def forces(self, x: _Array, forces: _Array, /) -> None: ...
    def forces_and_jacobian(self, x: _Array, forces: _Array, jacobian: _Array, /) -> None: ...
    def track_forces(
        self, x_left: _Array, x_right: _Array, track_forces: _Array, jacobian: _Array = ..., /
    ) -> None: ...

class Mlp:
    def __new__(
        cls,
        *,
        activation: int,
        widths: Sequence[int],
        parameters: bytes,
        input_mean: _Array,
        input_scale: _Array,
        output_mean: _Array,
        output_scale: _Array,
    ) -> Self: ...
    def forces(self, x: _Array, forces: _Array, /) -> None: ...
    def forces_and_jacobian(self, x: _Array, forces: _Array, jacobian: _Array, /) -> None: ...

class TrackNet:
    def __new__(
        cls,
        *,
        mode: int,
        contact: int,
        wheels: int,
        mass: float,
        gravity: float,
        contact_length: float,
        element_length: float,
        element_spacing: float,
        tread: float,
        track_width: float,
        cg_height: float,
        contact_center: float,
        soft_speed: float,
        activation: int,
        widths: Sequence[int],
        parameters: bytes,
        input_mean: _Array,
        input_scale: _Array,
        output_mean: _Array,
        output_scale: _Array,
        ends: _Array,
        reach: _Array,
        half_travel: float,
        part_length: float,
        weights: _Array,
    ) -> Self: ...
    def forces(self, x: _Array, forces: _Array, /) -> None: ...
    def forces_and_jacobian(self, x: _Array, forces: _Array, jacobian: _Array, /) -> None: ...
    def track_forces(
        self, x_left: _Array, x_right: _Array, track_forces: _Array, jacobian: _Array = ..., /
    ) -> None: ...

def columns(mode: int, /) -> tuple[str, ...]: ...
def cpu_level() -> str: ...
