"""A picture that shapes are painted on: polygons, bars, discs and textured plates, in pixels of the film.

Coordinates have their origin in the middle of the film's first pixel; y points down. Angles are degrees,
counter-clockwise as seen. The canvas is larger than the film by `MARGIN` on every side, so that a camera may shake, and
finer by a whole factor, so that edges fall between pixels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import skimage
from numpy.typing import NDArray

Picture = NDArray[np.uint8]
Colour = tuple[int, int, int]
"""Blue, green, red, as OpenCV has them."""

MARGIN = 64
"""Margin of the canvas around the film, px."""
BITS = 6
"""Binary digits of a coordinate after the point."""
BRIGHT: Sequence[Colour] = (
    (30, 30, 200),
    (200, 70, 20),
    (40, 160, 40),
    (20, 200, 230),
    (180, 30, 160),
    (20, 120, 240),
    (190, 180, 20),
)
DULL: Sequence[Colour] = (
    (60, 60, 60),
    (35, 40, 50),
    (200, 205, 210),
    (120, 120, 125),
    (70, 95, 130),
    (90, 60, 40),
    (150, 170, 185),
)
SKIN: Colour = (120, 150, 200)
_PHOTOGRAPHS = (
    "coffee.png",
    "chelsea.png",
    "astronaut.png",
    "brick.png",
    "grass.png",
    "gravel.png",
    "motorcycle_left.png",
    "rocket.jpg",
    "camera.png",
    "coins.png",
)


def pick(rng: np.random.Generator, among: Sequence[Any]) -> Any:
    """Return one of a few things."""
    return among[int(rng.integers(len(among)))]


def photograph(rng: np.random.Generator) -> Picture:
    """Return one of scikit-image's photographs."""
    path = Path(skimage.__file__).parent / "data" / pick(rng, _PHOTOGRAPHS)
    return cv2.imread(str(path), cv2.IMREAD_COLOR)


def direction(angle_deg: float) -> NDArray[np.float64]:
    """Return the unit vector (x, y) of an angle."""
    angle = np.radians(angle_deg)
    return np.array([np.cos(angle), -np.sin(angle)])


def turned(points: Any, angle_deg: float) -> NDArray[np.float64]:
    """Return points (n, 2) of a body, x along it and y to its left, as seen after a turn."""
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    along, left = np.asarray(points, float).T
    return np.column_stack([c * along - s * left, -(s * along + c * left)])


@dataclass
class Canvas:
    """What is painted on."""

    picture: Picture
    """(rows, columns, 3) with the margin, ``scale`` times as fine as the film."""
    scale: int
    smooth: bool
    """Whether OpenCV smooths the edges."""
    top: int = 0
    """The film's row, margin included, that the picture begins with."""

    def polygon(self, points: Any, colour: Colour) -> None:
        cv2.fillPoly(self.picture, [self._placed(points)], colour, self._line, BITS)

    def disc(self, centre: Any, radius: float, colour: Colour) -> None:
        x, y = (int(v) for v in self._placed([centre])[0])
        cv2.circle(self.picture, (x, y), round(radius * self.scale * (1 << BITS)), colour, -1, self._line, BITS)

    def bar(self, start: Any, end: Any, width: float, colour: Colour, end_width: float | None = None) -> None:
        start, end = np.asarray(start, float), np.asarray(end, float)
        along = (end - start) / np.linalg.norm(end - start)
        across = np.array([-along[1], along[0]]) / 2.0
        far = across * (width if end_width is None else end_width)
        self.polygon([start + width * across, end + far, end - far, start - width * across], colour)

    def plate(self, points: Any, pivot: Any, angle_deg: float, texture: Picture) -> None:
        """Paint a polygon with a texture that turns with it about its pivot."""
        mask = np.zeros(self.picture.shape[:2], np.uint8)
        cv2.fillPoly(mask, [self._placed(points)], 255, self._line, BITS)
        x, y, w, h = cv2.boundingRect(mask)
        if w == 0:
            return
        rows, columns = texture.shape[:2]
        carry = cv2.getRotationMatrix2D((columns / 2.0, rows / 2.0), angle_deg, 0.7 * self.scale)
        carry[:, 2] += self._placed([pivot])[0] / (1 << BITS) - (columns / 2.0 + x, rows / 2.0 + y)
        filling = cv2.warpAffine(texture, carry, (w, h), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
        cover = mask[y : y + h, x : x + w, None].astype(np.float32) / 255.0
        there = self.picture[y : y + h, x : x + w]
        there[:] = (there * (1.0 - cover) + filling * cover + 0.5).astype(np.uint8)

    @property
    def _line(self) -> int:
        return cv2.LINE_AA if self.smooth else cv2.LINE_8

    def _placed(self, points: Any) -> NDArray[np.int32]:
        inside = np.asarray(points, float) + (MARGIN, MARGIN - self.top) + 0.5
        return np.round((inside * self.scale - 0.5) * (1 << BITS)).astype(np.int32)
