"""A scene of highway-env from above: its lanes and objects, the ground by its grip, and the vehicle on its tracks."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ...terrain import FloatArray, Ground, SlopedGround, TerrainField, TrackedVehicle
from ..canvas import Canvas, Color, blend
from ..rendering import Renderer, RenderMode
from ..state import VehicleState
from .dependency import import_highway_env
from .footprint import Footprint

_objects = import_highway_env("vehicle.objects")

_SLIPPERY: Final[Color] = (214, 220, 222)
_FIRM: Final[Color] = (126, 112, 90)
_LINE: Final[Color] = (240, 238, 230)
_OBSTACLE: Final[Color] = (104, 62, 44)
_HIT: Final[Color] = (214, 52, 40)
_GOAL: Final[Color] = (38, 92, 168)
_REACHED: Final[Color] = (40, 150, 70)
_HULL_EDGE: Final[Color] = (44, 50, 36)
_HULL: Final[Color] = (108, 122, 84)

_LINE_WIDTH: Final = 0.15
_LINE_STEP: Final = 1.0
# So that the goal's outline is seen around a parked vehicle.
_GOAL_MARGIN: Final = 0.3
# Colours of the ground, so that cells alike are drawn as one.
_SHADES: Final = 16
_FULL_GRIP: Final = 0.9


class SceneRenderer(Renderer):
    """Draws a scene to scale, the plane's x axis to the right and y up.

    The ground is darker where it grips more: shear strength under the vehicle's mean pressure, over that pressure.
    Everything on the tracks is as in :class:`~grouser.envs.rendering.Renderer`; the hull is the footprint that collides.

    Parameters
    ----------
    vehicle : TrackedVehicle
        The vehicle.
    footprint : Footprint
        What it covers.
    mode : {"rgb_array", "human"}
        Frames as arrays, or a window.
    view_height : float
        What a frame shows from bottom to top, in m.
    center : tuple of float, optional
        What stands in the middle of every frame; the vehicle by default.
    size : tuple of int
        Width and height in pixels.
    fps : float
        Frames a second that a window keeps to.
    """

    def __init__(
        self,
        vehicle: TrackedVehicle,
        footprint: Footprint,
        mode: RenderMode,
        *,
        view_height: float,
        center: tuple[float, float] | None = None,
        size: tuple[int, int] = (960, 640),
        fps: float = 10.0,
    ) -> None:
        super().__init__(None, vehicle, mode, size, fps)
        self._canvas = _SceneCanvas(size, view_height, center)
        self._footprint = footprint
        self._road: Any = None
        self._ground: Ground | None = None
        self._parked = False

    def show(
        self, state: VehicleState, road: Any, ground: Ground, *, label: str, parked: bool = False
    ) -> NDArray[np.uint8] | None:
        """Draw one frame.

        Parameters
        ----------
        state : VehicleState
            Of the vehicle.
        road : highway_env.road.road.Road
            With its lanes and objects.
        ground : Ground
            Under the scene.
        label : str
            A line of text for the panel.
        parked : bool
            Whether the goal is reached.
        """
        self._road, self._ground, self._parked = road, ground, parked
        return self.draw(state, label=label)

    def _draw_ground(self) -> None:
        canvas = self._canvas
        if self._ground is not None:
            _draw_grip(canvas, self._ground, self._vehicle)
        if self._road is None:
            return
        for lanes in (lanes for after in self._road.network.graph.values() for lanes in after.values()):
            for lane in lanes:
                _draw_lane(canvas, lane)
        for each in self._road.objects:
            if isinstance(each, _objects.Landmark):
                self._draw_goal(each)
            else:
                canvas.polygon(_HIT if each.crashed else _OBSTACLE, each.polygon()[:4])

    def _draw_goal(self, goal: Any) -> None:
        color = _REACHED if self._parked else _GOAL
        along = np.array([math.cos(goal.heading), math.sin(goal.heading)])
        across = np.array([-along[1], along[0]])
        ahead, aside = self._footprint.length / 2 + _GOAL_MARGIN, self._footprint.width / 2 + _GOAL_MARGIN
        corners = [goal.position + u * ahead * along + v * aside * across for u, v in _CORNERS]
        self._canvas.line(color, [*corners, corners[0], corners[1]], _LINE_WIDTH)
        nose = [goal.position + 0.8 * ahead * along, *(goal.position + v * 0.6 * aside * across for v in (1, -1))]
        self._canvas.polygon(color, nose)

    def _draw_vehicle(self, state: VehicleState, slips: tuple[float, float]) -> None:
        turn = np.array(
            [[math.cos(state.heading), math.sin(state.heading)], [-math.sin(state.heading), math.cos(state.heading)]]
        )
        hull = np.array(_CORNERS) * (self._footprint.length / 2, self._footprint.width / 2)
        hull[:, 0] += self._vehicle.contact_center
        placed = hull @ turn + (state.x, state.y)
        self._canvas.polygon(_HULL, placed)
        super()._draw_vehicle(state, slips)
        self._canvas.line(_HULL_EDGE, [*placed, placed[0], placed[1]], 0.08)


_CORNERS: Final = ((1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0))


class _SceneCanvas(Canvas):
    """A canvas whose camera may stand still."""

    def __init__(self, size: tuple[int, int], view_height: float, fixed: tuple[float, float] | None) -> None:
        super().__init__(size, view_height)
        self._fixed = fixed

    def start(self, center: tuple[float, float], background: Color) -> None:
        super().start(self._fixed or center, background)


def _draw_lane(canvas: Canvas, lane: Any) -> None:
    stations = np.linspace(0.0, lane.length, max(2, math.ceil(lane.length / _LINE_STEP) + 1))
    for side in (-0.5, 0.5):
        edge = np.array([lane.position(station, side * lane.width_at(station)) for station in stations])
        canvas.line(_LINE, edge, _LINE_WIDTH)


def _grip(theta: FloatArray, vehicle: TrackedVehicle, rigid: bool) -> FloatArray:
    """Return the shear strength under the mean pressure, over that pressure; θ of shape (..., p)."""
    if rigid:
        return np.asarray(theta[..., 0])
    pressure = vehicle.weight / (2 * vehicle.contact_length * vehicle.track_width)
    return np.asarray(theta[..., 0] / pressure + np.tan(theta[..., 1]))


def _shade(grip: FloatArray) -> NDArray[np.intp]:
    return np.rint(np.clip(grip / _FULL_GRIP, 0.0, 1.0) * (_SHADES - 1)).astype(np.intp)


def _draw_grip(canvas: Canvas, ground: Ground, vehicle: TrackedVehicle) -> None:
    while isinstance(ground, SlopedGround):
        ground = ground.ground
    low, high = canvas.center - canvas.reach, canvas.center + canvas.reach
    rigid = ground.mode == "rigid"
    if isinstance(ground, TerrainField):
        shades = _shade(_grip(ground.parameters, vehicle, rigid))
        spacing, (x0, y0) = ground.spacing, ground.origin
        rows, columns = shades.shape
    else:
        shades = _shade(_grip(ground.parameters_at(*canvas.center.tolist()), vehicle, rigid)).reshape(1, 1)
        spacing, x0, y0, rows, columns = 1.0, 0.0, 0.0, 1, 1
    # Beyond the map the border goes on.
    first_row, last_row = math.floor((low[1] - y0) / spacing), math.floor((high[1] - y0) / spacing)
    first, last = math.floor((low[0] - x0) / spacing), math.floor((high[0] - x0) / spacing)
    shown = np.clip(np.arange(first, last + 1), 0, columns - 1)
    for row in range(first_row, last_row + 1):
        line = shades[min(max(row, 0), rows - 1), shown]
        cuts = [0, *(np.flatnonzero(np.diff(line)) + 1).tolist(), len(line)]
        bottom, top = y0 + row * spacing, y0 + (row + 1) * spacing
        for start, stop in pairwise(cuts):
            left, right = x0 + (first + start) * spacing, x0 + (first + stop) * spacing
            color = blend(_SLIPPERY, _FIRM, float(line[start]) / (_SHADES - 1))
            canvas.polygon(color, [(left, bottom), (right, bottom), (right, top), (left, top)])
