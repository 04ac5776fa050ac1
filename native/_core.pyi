from collections.abc import Callable, Sequence
from typing import Protocol, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

_Array: TypeAlias = NDArray[np.float64]

class _Kernel:
    @property
    def kernel(self) -> object: ...
    def forces(self, x: _Array, forces: _Array, /) -> None: ...
    def forces_and_jacobian(self, x: _Array, forces: _Array, jacobian: _Array, /) -> None: ...
    def bind(self, x: _Array, forces: _Array, jacobian: _Array = ..., /) -> Callable[[], None]: ...
    def time_calls(self, x: _Array, calls: int, want_jacobian: bool, /) -> float: ...

class _TrackKernel(_Kernel):
    def track_forces(
        self, x_left: _Array, x_right: _Array, track_forces: _Array, jacobian: _Array = ..., /
    ) -> None: ...

class Physics(_TrackKernel):
    def __new__(
        cls,
        *,
        mode: int,
        contact: int,
        path: int,
        precision: int,
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

class Mlp(_Kernel):
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

class TrackNet(_TrackKernel):
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
        mean: _Array,
        moment: _Array,
    ) -> Self: ...

class Gated(_Kernel):
    def __new__(cls, *, primary: _HasKernel, fallback: _HasKernel, detector: Detector) -> Self: ...

class Detector:
    def __new__(
        cls, *, columns: int, low: _Array, high: _Array, center: _Array, whitening: _Array, threshold: float
    ) -> Self: ...
    @property
    def detector(self) -> object: ...
    def detect(self, row: _Array, /) -> tuple[float, str, int]: ...

class Field:
    def __new__(
        cls,
        *,
        rows: int,
        columns: int,
        parameters: int,
        x: float,
        y: float,
        spacing: float,
        extend: bool,
        theta: _Array,
        height: _Array | None = None,
    ) -> Self: ...
    @property
    def field(self) -> object: ...

class _HasKernel(Protocol):
    @property
    def kernel(self) -> object: ...

class Fleet:
    def __new__(
        cls,
        *,
        kernel: _HasKernel,
        state: _Array,
        guard: _Array,
        record: _Array,
        status: NDArray[np.uint8],
        mass: float,
        yaw_inertia: float,
        tread: float,
        contact_center: float,
        gravity: float,
        belt_time_constant: float,
        belt_acceleration: float,
        tick: float,
        integrator: int,
        tolerance: float,
        sample_tracks: bool,
        threads: int,
        fallback: _HasKernel | None = None,
        detector: Detector | None = None,
        policy: tuple[int, int, float, float, float, int] | None = None,
    ) -> Self: ...
    def set_ground(
        self, vehicle: int, theta: _Array, slope_x: float, slope_y: float, field: Field | None = None, /
    ) -> None: ...
    def set_traits(
        self, vehicle: int, yaw_inertia: float, belt_time_constant: float, belt_acceleration: float, /
    ) -> None: ...
    def advance(self, commands: _Array, ticks: int, /) -> None: ...
    @property
    def fleet(self) -> object: ...

class Tracking:
    def __new__(
        cls,
        *,
        nodes: _Array,
        length: float,
        closed: bool,
        reference_speed: float,
        control_period: float,
        maximum_cross_track: float,
        progress_weight: float,
        cross_track_weight: float,
        look_ahead: _Array,
    ) -> Self: ...
    @property
    def rules(self) -> object: ...
    def project(
        self, x: float, y: float, near: float, window: float, /
    ) -> tuple[float, float, float, float, float, float]: ...
    def at(self, arc_length: float, /) -> tuple[float, float, float, float]: ...

class Speed:
    def __new__(
        cls,
        *,
        knots: int,
        segment_time: float,
        ramp_time: float,
        speed_weight: float,
        yaw_rate_weight: float,
        speed_tolerance: float,
        yaw_rate_tolerance: float,
        look_ahead: _Array,
    ) -> Self: ...
    @property
    def rules(self) -> object: ...
    def reference(self, profile: _Array, time: float, /) -> tuple[float, float]: ...

class Episodes:
    def __new__(
        cls,
        *,
        fleet: Fleet,
        rules: Tracking | Speed,
        slip_block: _HasKernel,
        ticks: int,
        steps: int,
        twist: bool,
        control_period: float,
        training_speed: float,
        tread: float,
        yaw_rate_scale: float,
        bound: float,
        action_change_weight: float,
        slip_power_weight: float,
        slip_power_scale: float,
        broken_off_reward: float,
        ranges: _Array,
        actions: _Array,
        idle: NDArray[np.bool_],
        observations: NDArray[np.float32],
        rewards: _Array,
        terms: _Array,
        measures: _Array,
        terminated: NDArray[np.bool_],
        truncated: NDArray[np.bool_],
        memory: _Array,
        periods: _Array,
        previous: _Array,
        parameters: _Array,
        poses: _Array,
    ) -> Self: ...
    def step(self) -> None: ...
    def begin(self, vehicle: int, /) -> None: ...

def columns(mode: int, /) -> tuple[str, ...]: ...
def cpu_level() -> str: ...
