"""An off-screen drawing board over pygame, in meters of the plane, with a camera; it needs no display."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..terrain import FloatArray, missing_extra

Color = tuple[int, int, int]

# Drawn this much larger and scaled down: pygame has no anti-aliased polygons.
_OVERSAMPLING: Final = 2


class Canvas:
    """Shapes in m on a picture whose middle is ``center``, the plane's x axis to the right.

    Text and rulers go on ``frame`` in pixels, after :meth:`finish`.

    Parameters
    ----------
    size : tuple of int
        Width and height of the picture in pixels.
    view_height : float
        What the smaller side of the picture shows, in m.

    Raises
    ------
    ConfigurationError
        If pygame is not installed.
    """

    def __init__(self, size: tuple[int, int], view_height: float) -> None:
        self.pygame = import_pygame()
        self.size = size
        self.pixels_per_meter = min(size) / view_height
        self.frame = self.pygame.Surface(size, 0, 32)
        self.center = np.zeros(2)
        self.pygame.font.init()
        self.font = self.pygame.font.Font(None, max(16, size[1] // 25))
        self._scene = self.pygame.Surface((size[0] * _OVERSAMPLING, size[1] * _OVERSAMPLING), 0, 32)
        self._scale = _OVERSAMPLING * self.pixels_per_meter

    @property
    def reach(self) -> FloatArray:
        """Half the width and height of the view in m."""
        half: FloatArray = np.array(self.size) / (2 * self.pixels_per_meter)
        return half

    def visible(self, points: FloatArray, margin: float) -> NDArray[np.bool_]:
        """Whether points (…, 2) in m lie in the view, or closer to it than a margin in m."""
        inside: NDArray[np.bool_] = np.abs(points - self.center) < self.reach + margin
        return np.logical_and(inside[..., 0], inside[..., 1])

    def start(self, center: tuple[float, float], background: Color) -> None:
        """Begin a picture."""
        self.center = np.array(center)
        self._scene.fill(background)

    def picture(self, colors: NDArray[np.uint8], low: tuple[float, float], high: tuple[float, float]) -> None:
        """Fill a rectangle between two corners (x, y) in m with colors (rows, columns, 3), rows along y, smoothly."""
        rows, columns = colors.shape[:2]
        image = self.pygame.image.frombytes(np.ascontiguousarray(colors[::-1]).tobytes(), (columns, rows), "RGB")
        (left, bottom), (right, top) = self._pixels([low, high]).round().astype(int).tolist()
        self._scene.blit(self.pygame.transform.smoothscale(image, (right - left, bottom - top)), (left, top))

    def polygon(self, color: Color, points: ArrayLike) -> None:
        """Fill a polygon with corners (n, 2) in m."""
        self.pygame.draw.polygon(self._scene, color, self._pixels(points).tolist())

    def circle(self, color: Color, center: ArrayLike, radius: float) -> None:
        """Fill a circle, all in m."""
        self.pygame.draw.circle(self._scene, color, self._pixels(center).tolist(), max(1.0, radius * self._scale))

    def line(self, color: Color, points: ArrayLike, width: float) -> None:
        """Draw a line through points (n, 2), ``width`` in m but at least a pixel; what is out of view costs nothing."""
        xy = np.asarray(points, dtype=np.float64).reshape(-1, 2)
        if len(xy) < 2:
            return
        along: FloatArray = np.asarray(np.gradient(xy, axis=0))
        length = np.hypot(along[:, 0], along[:, 1])[:, None]
        across = np.column_stack([-along[:, 1], along[:, 0]]) / np.where(length > 0.0, length, 1.0)
        half = max(width, 1.0 / self.pixels_per_meter) / 2
        self.ribbon(color, xy - half * across, xy + half * across)

    def ribbon(self, color: Color, right: FloatArray, left: FloatArray) -> None:
        """Fill the strip between two edges (n, 2) in m, which may cross itself."""
        quads = np.stack([right[:-1], right[1:], left[1:], left[:-1]], axis=1)
        crosses = (quads.min(axis=1) < self.center + self.reach) & (quads.max(axis=1) > self.center - self.reach)
        for quad in self._pixels(quads[crosses.all(axis=1)]).tolist():
            self.pygame.draw.polygon(self._scene, color, quad)

    def finish(self) -> None:
        """Scale the picture down onto ``frame``."""
        self.pygame.transform.smoothscale(self._scene, self.size, self.frame)

    def panel(self, rows: Sequence[tuple[str, ...]], ink: Color, paper: Color) -> None:
        """Write rows of text into a box at the top left of the frame; the cells of rows with several align."""
        cells = [[self.font.render(cell, True, ink) for cell in row] for row in rows]
        gap, height = 12, self.font.get_linesize() + 2
        columns: dict[int, int] = {}
        for row in cells:
            for index, cell in enumerate(row if len(row) > 1 else ()):
                # In coarse steps, so that the box does not tremble with the width of the digits.
                columns[index] = max(columns.get(index, 0), -(-(cell.get_width() + gap) // 24) * 24)
        single = max((row[0].get_width() for row in cells if len(row) == 1), default=0)
        width = max(single + gap, sum(columns.values())) + gap
        box = self.pygame.Surface((width, height * len(cells) + 2 * gap - 2), 0, 32)
        box.fill(paper)
        box.set_alpha(215)
        self.frame.blit(box, (gap, gap))
        for line, row in enumerate(cells):
            left = 2 * gap
            for index, cell in enumerate(row):
                self.frame.blit(cell, (left, 2 * gap + line * height))
                left += columns.get(index, 0)

    def ruler(self, meters: float, ink: Color) -> None:
        """Draw a scale bar at the bottom right of the frame."""
        right, bottom = self.size[0] - 20, self.size[1] - 20
        left = right - meters * self.pixels_per_meter
        self.pygame.draw.line(self.frame, ink, (left, bottom), (right, bottom), 2)
        for x in (left, right):
            self.pygame.draw.line(self.frame, ink, (x, bottom - 6), (x, bottom), 2)
        text = self.font.render(f"{meters:g} m", True, ink)
        self.frame.blit(text, ((left + right - text.get_width()) / 2, bottom - 6 - text.get_height()))

    def gauge(self, title: str, rows: Sequence[tuple[str, float, Color]], ends: str, ink: Color, paper: Color) -> None:
        """Draw bars from the middle of a box at the bottom left of the frame.

        Parameters
        ----------
        title, ends : str
            Above the bars, and what a full bar stands for.
        rows : sequence of (label, share, color)
            Share of half the box in [-1, 1]; negative to the left.
        ink, paper : Color
            Of text and box.
        """
        gap, height, half = 12, self.font.get_linesize() + 2, max(48, self.size[0] // 14)
        labels = [self.font.render(text, True, ink) for text in (title, f"±{ends}", *(label for label, _, _ in rows))]
        indent = gap + max(label.get_width() for label in labels[2:]) + gap
        size = (indent + 2 * half + gap, height * (len(rows) + 1) + gap)
        corner = (gap, self.size[1] - size[1] - gap)
        box = self.pygame.Surface(size, 0, 32)
        box.fill(paper)
        box.set_alpha(215)
        self.frame.blit(box, corner)
        top = corner[1] + gap // 2
        self.frame.blit(labels[0], (corner[0] + gap, top))
        self.frame.blit(labels[1], (corner[0] + size[0] - gap - labels[1].get_width(), top))
        middle = corner[0] + indent + half
        for line, (label, (_, share, color)) in enumerate(zip(labels[2:], rows, strict=True)):
            y = top + height * (line + 1)
            self.frame.blit(label, (corner[0] + gap, y))
            length = round(half * min(1.0, max(-1.0, share)))
            self.pygame.draw.rect(self.frame, color, (min(middle, middle + length), y + 2, abs(length), height - 6))
        self.pygame.draw.line(self.frame, ink, (middle, top + height), (middle, top + height * (len(rows) + 1) - 4), 2)

    def legend(self, title: str, colors: Sequence[Color], ends: tuple[str, str], ink: Color) -> None:
        """Draw a bar of colors at the bottom of the frame, left of the ruler, with a name and what its ends stand for."""
        step, height = max(4, self.size[0] // 120), max(8, self.size[1] // 45)
        left, top = round(0.6 * self.size[0]) - step * len(colors), self.size[1] - 20 - height
        for index, color in enumerate(colors):
            self.pygame.draw.rect(self.frame, color, (left + step * index, top, step, height))
        self.pygame.draw.rect(self.frame, ink, (left, top, step * len(colors), height), 1)
        name, first, last = (self.font.render(text, True, ink) for text in (title, *ends))
        above = top - 4 - name.get_height()
        self.frame.blit(name, (left + (step * len(colors) - name.get_width()) / 2, above))
        self.frame.blit(first, (left, above))
        self.frame.blit(last, (left + step * len(colors) - last.get_width(), above))

    def to_array(self) -> NDArray[np.uint8]:
        """Return the frame, shape (height, width, 3)."""
        # Several times as fast as surfarray, whose arrays stand with x first.
        pixels = np.frombuffer(self.pygame.image.tobytes(self.frame, "RGB"), dtype=np.uint8)
        return pixels.reshape(self.size[1], self.size[0], 3).copy()

    def _pixels(self, points: ArrayLike) -> FloatArray:
        offset = (np.asarray(points, dtype=np.float64) - self.center) * self._scale
        pixels: FloatArray = np.array(self._scene.get_size()) / 2 + offset * (1.0, -1.0)
        return pixels


def import_pygame() -> Any:
    """Return the pygame module.

    Raises
    ------
    ConfigurationError
        If it is not installed.
    """
    # Its greeting on standard output would end up in piped command output.
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    try:
        import pygame
    except ImportError as error:
        raise missing_extra("pygame-ce", "render") from error
    return pygame


def blend(start: Color, end: Color, share: float) -> Color:
    """Mix two colors, ``share`` of the second, from 0 to 1."""
    red, green, blue = (round(a + min(share, 1.0) * (b - a)) for a, b in zip(start, end, strict=True))
    return red, green, blue
