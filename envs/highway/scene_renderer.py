"""A scene of highway-env from above: its lanes and objects, the ground by its grip, and the vehicle on its tracks."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ...terrain import Ground, TrackedVehicle
from ..canvas import Canvas, Color
from ..rendering import Renderer, RenderMode
from ..state import VehicleState
from .dependency import import_highway_env
from .footprint import Footprint

_objects = import_highway_env("vehicle.objects")

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
# Of a rectangle, in halves of its length and width.
_CORNERS: Final = ((1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0))


class SceneRenderer(Renderer):
    """Draws a scene to scale, the plane's x axis to the right and y up.

    Ground, belts, gauges and legend are as in :class:`~grouser.envs.rendering.Renderer`; the hull is the footprint that
    collides.

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
        self._road, self._parked = road, parked
        return self.draw(state, label=label, ground=ground)

    def _draw_ground(self) -> None:
        canvas = self._canvas
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
