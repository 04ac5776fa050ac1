"""The vehicle on its path, seen from above: frames as arrays, or a window."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from ..terrain import FloatArray, Ground, InvalidInputError, TrackedVehicle, unknown_name
from ..terrain.parameters import require_in
from .canvas import Canvas, Color
from .grip import grip_at, grip_map
from .path import Path
from .state import VehicleState
from .vehicle_picture import draw_vehicle, full_slip, slip_color

RenderMode = Literal["rgb_array", "human"]
RENDER_MODES: Final[tuple[RenderMode, ...]] = get_args(RenderMode)

_GROUND: Final[Color] = (186, 170, 140)
_GRID: Final[Color] = (178, 161, 131)
_LANE: Final[Color] = (203, 190, 163)
_EDGE: Final[Color] = (240, 236, 226)
_CONE: Final[Color] = (232, 101, 32)
_RUT: Final[Color] = (158, 140, 109)
_PATH: Final[Color] = (38, 92, 168)
_TRAIL: Final[Color] = (136, 66, 20)
_INK: Final[Color] = (34, 32, 28)
_PAPER: Final[Color] = (246, 242, 232)

_OFF_MAP: Final[Color] = (58, 54, 50)
_COMMAND: Final[Color] = (38, 92, 168)
# From no grip to a grip of 1: ice, snow, sand, dry pavement.
_GRIPS: Final[tuple[Color, ...]] = ((205, 226, 240), (214, 208, 190), (186, 170, 140), (152, 132, 102), (118, 100, 78))

_VEHICLES_PER_VIEW: Final = 6.0
_COMMAND_SECONDS: Final = 2.0
_LEGEND_STEPS: Final = 16


class Renderer:
    """Draws a vehicle on its path from above, to scale; the camera follows it, the plane's x axis to the right.

    The vehicle covers its contact length by its overall width. The bars move as the upper run of the belt does, and
    a belt reddens with its slip speed, which the gauge at the bottom left shows for each track: to the right where the
    belt is faster than the ground under it. The arrow shows half a second of the CG's velocity. Ground is the darker,
    the better it holds: from pale blue without grip to dark brown at a grip of 1.

    Parameters
    ----------
    path : Path or None
        The path, where there is one; its corridor is drawn where it has one.
    vehicle : TrackedVehicle
        The vehicle.
    mode : {"rgb_array", "human"}
        Frames as arrays, which needs no display, or a window.
    size : tuple of int
        Width and height in pixels.
    fps : float
        Frames a second that a window keeps to.

    Raises
    ------
    ConfigurationError
        If the mode is unknown or pygame is not installed.
    InvalidInputError
        If a size or the frame rate is impossible.
    """

    def __init__(
        self,
        path: Path | None,
        vehicle: TrackedVehicle,
        mode: RenderMode = "rgb_array",
        size: tuple[int, int] = (960, 540),
        fps: float = 10.0,
    ) -> None:
        if mode not in RENDER_MODES:
            raise unknown_name("render mode", mode, RENDER_MODES)
        for name, pixels in zip(("width", "height"), size, strict=True):
            require_in(name, pixels, 64, 8192)
        require_in("fps", fps, 0.0, 1000.0, low_open=True)
        self._path, self._vehicle, self._mode, self._fps = path, vehicle, mode, fps
        self._extent = max(vehicle.contact_length, vehicle.overall_width)
        self._canvas = Canvas((int(size[0]), int(size[1])), _VEHICLES_PER_VIEW * self._extent)
        dash = 0.3 * self._extent
        self._dashes = np.empty((0, 5, 2))
        if path is not None:
            starts = np.arange(0.0, path.length, 2 * dash)
            self._dashes = np.stack(path.sample(starts[:, None] + np.linspace(0.0, dash, 5))[:2], axis=-1)
        self._window: Any = None
        self._clock: Any = None
        self._closed = False
        self._varied = False
        self.reset()

    def reset(self) -> None:
        """Forget the driven trail and the position of the belts."""
        self._poses: list[tuple[float, float, float]] = []
        self._belts = [0.0, 0.0]
        self._time: float | None = None

    def draw(
        self,
        state: VehicleState,
        trail: Sequence[tuple[float, float]] | None = None,
        label: str = "",
        *,
        ground: Ground | None = None,
        command: tuple[float, float] | None = None,
    ) -> NDArray[np.uint8] | None:
        """Draw one frame.

        Parameters
        ----------
        state : VehicleState
            What to draw. A time before that of the last frame begins a new drive.
        trail : sequence of (x, y), optional
            Driven path of the CG in m; by default through the states drawn since the last :meth:`reset`.
        label : str
            A line of text for the panel, such as the ground and the backend.
        ground : Ground, optional
            Shown by its grip, with a legend where it changes over the view.
        command : tuple of float, optional
            Commanded speed in m/s and yaw rate in rad/s: two seconds of that motion are drawn.

        Returns
        -------
        ndarray or None
            Shape (height, width, 3), uint8, in mode ``rgb_array``; None in mode ``human``, where closing the window
            makes further calls do nothing.

        Raises
        ------
        InvalidInputError
            If the renderer was closed, in mode ``rgb_array``.
        """
        if self._closed:
            if self._mode == "human":
                return None
            raise InvalidInputError("this renderer was closed; make a new one")
        self._remember(state)
        self._canvas.start((state.x, state.y), _GROUND)
        self._varied = ground is not None and self._draw_grip(ground)
        self._draw_ground()
        self._draw_trail([*(pose[:2] for pose in self._poses), (state.x, state.y)] if trail is None else trail)
        slips = self._slip_speeds(state)
        if command is not None:
            self._draw_command(state, *command)
        self._draw_vehicle(state, slips)
        self._canvas.finish()
        self._canvas.ruler(_round_length(0.4 * float(self._canvas.reach[0])), _INK)
        rows: list[tuple[str, ...]] = [(label,)] if label else []
        rows += [
            ("time", f"{state.time:.2f} s"),
            ("speed", f"{math.hypot(state.vx, state.vy):.2f} m/s"),
            ("yaw rate", f"{state.yaw_rate:+.2f} rad/s"),
            ("belts", f"L {state.v_left:+.2f}", f"R {state.v_right:+.2f}", "m/s"),
            ("slip", f"L {slips[0]:+.2f}", f"R {slips[1]:+.2f}", "m/s"),
        ]
        if command is not None:
            rows.append(("command", f"{command[0]:.2f} m/s", f"{command[1]:+.2f} rad/s"))
        if ground is not None:
            rows.append(("grip", f"{grip_at(self._vehicle, ground, state.x, state.y):.2f}"))
        self._canvas.panel(rows, _INK, _PAPER)
        self._draw_gauges(slips)
        if self._mode == "human":
            self._show()
            return None
        return self._canvas.to_array()

    def close(self) -> None:
        """Close the window, if there is one; calling it again does nothing."""
        self._closed = True
        if self._window is not None:
            self._window = None
            self._canvas.pygame.display.quit()

    def _remember(self, state: VehicleState) -> None:
        if self._time is not None and state.time < self._time:
            self.reset()
        elapsed = 0.0 if self._time is None else state.time - self._time
        self._time = state.time
        for side, speed in enumerate((state.v_left, state.v_right)):
            self._belts[side] += speed * elapsed
        if not self._poses or math.dist(self._poses[-1][:2], (state.x, state.y)) > 0.1 * self._extent:
            self._poses.append((state.x, state.y, state.heading))

    def _slip_speeds(self, state: VehicleState) -> tuple[float, float]:
        """Belt speed minus the forward ground speed of the track's centreline, in m/s, left and right."""
        half = self._vehicle.tread / 2
        left, right = state.vx - state.yaw_rate * half, state.vx + state.yaw_rate * half
        return state.v_left - left, state.v_right - right

    def _draw_grip(self, ground: Ground) -> bool:
        """Shade the view by the ground's grip, and return whether that changes over it."""
        canvas = self._canvas
        shown = grip_map(self._vehicle, ground, canvas.center - canvas.reach, canvas.center + canvas.reach)
        canvas.picture(_grip_colors(shown.values), shown.low, shown.high)
        return not np.all(shown.values == shown.values[0, 0])

    def _draw_command(self, state: VehicleState, speed: float, yaw_rate: float) -> None:
        time = np.linspace(0.0, _COMMAND_SECONDS, 40)
        heading = state.heading + yaw_rate * time
        # Of a motion along a circle; the chord points along the mean heading.
        chord = speed * time * np.sinc(yaw_rate * time / (2 * math.pi))
        mean = (state.heading + heading) / 2
        x, y = state.x + chord * np.cos(mean), state.y + chord * np.sin(mean)
        points = np.column_stack([x, y])
        self._canvas.line(_COMMAND, points, 0.05 * self._extent)
        if abs(speed) * _COMMAND_SECONDS > 0.1 * self._extent:
            self._canvas.circle(_COMMAND, points[-1], 0.09 * self._extent)

    def _draw_gauges(self, slips: tuple[float, float]) -> None:
        full = full_slip(self._vehicle)
        bars = [(side, slip / full, slip_color(self._vehicle, slip)) for side, slip in zip("LR", slips, strict=True)]
        self._canvas.gauge("track slip", bars, f"{full:.1f} m/s", _INK, _PAPER)
        if self._varied:
            steps = _grip_colors(np.linspace(0.0, 1.0, _LEGEND_STEPS)).tolist()
            self._canvas.legend("grip", [(red, green, blue) for red, green, blue in steps], ("0", "1"), _INK)

    def _draw_ground(self) -> None:
        canvas, size = self._canvas, self._extent
        step = _round_length(2.0 * size)
        low, high = canvas.center - canvas.reach, canvas.center + canvas.reach
        for x in np.arange(math.ceil(low[0] / step), high[0] / step) * step:
            canvas.line(_GRID, [(x, low[1]), (x, high[1])], 0.0)
        for y in np.arange(math.ceil(low[1] / step), high[1] / step) * step:
            canvas.line(_GRID, [(low[0], y), (high[0], y)], 0.0)
        for lane in self._path.corridor.lanes if self._path and self._path.corridor else ():
            if lane.end < low[0] or lane.start > high[0]:
                continue
            x = np.linspace(lane.start, lane.end, max(2, round((lane.end - lane.start) / 5) + 1))
            right, left = (np.column_stack([x, np.full_like(x, y)]) for y in (lane.right, lane.left))
            if not self._varied:
                canvas.ribbon(_LANE, right, left)
            for edge in (right, left):
                canvas.line(_EDGE, edge, 0.025 * size)
                for cone in edge:
                    for color, radius in ((_CONE, 0.07), (_EDGE, 0.045), (_CONE, 0.025)):
                        canvas.circle(color, cone, radius * size)

    def _draw_trail(self, trail: Sequence[tuple[float, float]]) -> None:
        canvas, vehicle = self._canvas, self._vehicle
        poses = np.array(self._poses)
        left = np.column_stack([-np.sin(poses[:, 2]), np.cos(poses[:, 2])])
        for y in (-vehicle.tread / 2, vehicle.tread / 2):
            near, far = y - vehicle.track_width / 2, y + vehicle.track_width / 2
            canvas.ribbon(_RUT, poses[:, :2] + near * left, poses[:, :2] + far * left)
        for dash in self._dashes[canvas.visible(self._dashes, 0.0).any(axis=1)]:
            canvas.line(_PATH, dash, 0.04 * self._extent)
        canvas.line(_TRAIL, trail, 0.025 * self._extent)

    def _draw_vehicle(self, state: VehicleState, slips: tuple[float, float]) -> None:
        draw_vehicle(self._canvas, self._vehicle, state, slips, self._belts)

    def _show(self) -> None:
        pygame = self._canvas.pygame
        if self._window is None:
            pygame.display.init()
            self._window = pygame.display.set_mode(self._canvas.size)
            pygame.display.set_caption(
                ", ".join([f"grouser: {self._vehicle.name}", *([self._path.name] if self._path else [])])
            )
            self._clock = pygame.time.Clock()
        # Reading events is also what keeps the window responsive.
        if any(event.type == pygame.QUIT for event in pygame.event.get()):
            self.close()
            return
        self._window.blit(self._canvas.frame, (0, 0))
        pygame.display.flip()
        self._clock.tick(self._fps)


def _grip_colors(values: FloatArray) -> NDArray[np.uint8]:
    """Return the colors, shape (..., 3), of grips, NaN standing for no ground at all."""
    places = np.linspace(0.0, 1.0, len(_GRIPS))
    colors = np.stack([np.interp(values, places, channel) for channel in zip(*_GRIPS, strict=True)], axis=-1)
    colors[np.isnan(values)] = _OFF_MAP
    return colors.round().astype(np.uint8)


def _round_length(limit: float) -> float:
    """Largest of 1, 2, 5 times a power of ten that is not above the limit."""
    power: float = 10.0 ** math.floor(math.log10(limit))
    return max(power * factor for factor in (1, 2, 5) if power * factor <= limit * (1 + 1e-9))
