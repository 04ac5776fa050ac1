"""A tracked vehicle from above: hull, belts that move and redden with their slip, an arrow along its velocity."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from ..terrain import FloatArray, TrackedVehicle
from .canvas import Canvas, Color, blend
from .state import VehicleState

_BELT: Final[Color] = (66, 66, 64)
_BELT_SLIPPING: Final[Color] = (226, 52, 36)
_BAR: Final[Color] = (22, 22, 22)
_HULL: Final[Color] = (94, 108, 72)
_HULL_DARK: Final[Color] = (66, 78, 50)
_HULL_LIGHT: Final[Color] = (124, 138, 98)
_ARROW: Final[Color] = (252, 214, 60)

_BARS_PER_TRACK: Final = 9
_ARROW_SECONDS: Final = 0.5
_FULL_SLIP: Final = 0.2


def full_slip(vehicle: TrackedVehicle) -> float:
    """Return the slip speed in m/s at which a belt is drawn fully red."""
    return _FULL_SLIP * vehicle.training_speed


def slip_color(vehicle: TrackedVehicle, slip: float) -> Color:
    """Return the color of a belt that slips at a speed in m/s."""
    return blend(_BELT, _BELT_SLIPPING, abs(slip) / full_slip(vehicle))


def draw_vehicle(
    canvas: Canvas, vehicle: TrackedVehicle, state: VehicleState, slips: tuple[float, float], belts: Sequence[float]
) -> None:
    """Draw a vehicle to scale.

    Parameters
    ----------
    canvas : Canvas
        To draw on.
    vehicle : TrackedVehicle
        What to draw.
    state : VehicleState
        Where it is, and how it moves.
    slips : tuple of float
        Slip speed of the left and the right belt in m/s.
    belts : sequence of float
        How far each belt has run, in m.
    """
    cosine, sine = math.cos(state.heading), math.sin(state.heading)
    turn = np.array([[cosine, sine], [-sine, cosine]])

    def body(points: ArrayLike) -> FloatArray:
        placed: FloatArray = np.asarray(points, dtype=np.float64) @ turn + (state.x, state.y)
        return placed

    def box(rear: float, front: float, right: float, left: float) -> FloatArray:
        return body([(rear, right), (front, right), (front, left), (rear, left)])

    length, width = vehicle.contact_length, vehicle.track_width
    rear, front = vehicle.contact_center - length / 2, vehicle.contact_center + length / 2
    pitch = length / _BARS_PER_TRACK
    for y, slip, moved in zip((vehicle.tread / 2, -vehicle.tread / 2), slips, belts, strict=True):
        canvas.polygon(slip_color(vehicle, slip), box(rear, front, y - width / 2, y + width / 2))
        for bar in rear + moved % pitch + pitch * np.arange(_BARS_PER_TRACK):
            thick = min(0.25 * pitch, front - bar)
            canvas.polygon(_BAR, box(bar, bar + thick, y - width / 2, y + width / 2))
    inner = vehicle.tread / 2 - 0.4 * width
    nose = front - 0.14 * length
    glacis = [(nose, -inner), (front, -0.8 * inner), (front, 0.8 * inner), (nose, inner)]
    canvas.polygon(_HULL, box(rear, nose, -inner, inner))
    canvas.polygon(_HULL_LIGHT, body(glacis))
    canvas.polygon(_HULL_DARK, box(rear + 0.07 * length, rear + 0.4 * length, -0.6 * inner, 0.6 * inner))
    canvas.circle(_HULL_DARK, body((rear + 0.62 * length, 0.4 * inner)), 0.28 * inner)
    _draw_arrow(canvas, max(length, vehicle.overall_width), state, body)


def _draw_arrow(canvas: Canvas, extent: float, state: VehicleState, body: Callable[[ArrayLike], FloatArray]) -> None:
    speed = math.hypot(state.vx, state.vy)
    length = speed * _ARROW_SECONDS
    if length < 0.05 * extent:
        return
    along = np.array([state.vx, state.vy]) / speed
    across = np.array([-along[1], along[0]])
    head = min(0.22 * extent, length)
    tip, neck, half = length * along, (length - head) * along, 0.025 * extent * across
    spread = 0.4 * head * across
    canvas.polygon(_ARROW, body([half, neck + half, neck + spread, tip, neck - spread, neck - half, -half]))
    canvas.circle(_ARROW, (state.x, state.y), 0.05 * extent)
