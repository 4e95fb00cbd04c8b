"""Simple things that swing or turn before a wall, drawn by OpenCV alone: a ball on a thread, a stick, a wheel."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import av
import cv2
import numpy as np

SIZE = (320, 240)
RATE_HZ = 30
_FINER = 4
"""The scene is drawn at this multiple of the picture's resolution, and averaged."""
_SUBPIXEL_BITS = 8
Rgb = tuple[int, int, int]
Point = tuple[float, float]
Draw = Callable[[np.ndarray, float], None]
"""Draws a thing at an angle, rad, into a scene."""


def film(path: Path, draw: Draw, angles_deg: np.ndarray, *, seed: int = 0, relief: float = 12.0) -> Path:
    """Film a thing at the given angles, before a wall with bumps of ``relief`` grey levels, noise 2 grey levels."""
    rng = np.random.default_rng(seed)
    bumps = cv2.resize(rng.normal(0.0, relief, (12, 16)), SIZE, interpolation=cv2.INTER_CUBIC)
    wall = np.clip(np.array([172.0, 178.0, 170.0]) + bumps[..., None], 0, 255).astype(np.uint8)
    fine = cv2.resize(wall, None, fx=_FINER, fy=_FINER, interpolation=cv2.INTER_LINEAR)

    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=RATE_HZ)
        stream.width, stream.height = SIZE
        stream.pix_fmt = "bgr0"
        for angle in np.radians(angles_deg):
            scene = fine.copy()
            draw(scene, float(angle))
            seen = cv2.resize(scene, SIZE, interpolation=cv2.INTER_AREA)
            noisy = np.clip(seen + rng.normal(0.0, 2.0, seen.shape), 0, 255).round().astype(np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(noisy, format="bgr24")))
        container.mux(stream.encode())
    return path


def hanging(pivot: Point, length: float, angle: float) -> Point:
    """Return the end of a pendulum: straight down at angle zero, to the right at a positive angle."""
    return pivot[0] + length * np.sin(angle), pivot[1] + length * np.cos(angle)


def ball(rgb: Rgb, radius: float, pivot: Point = (160.0, 20.0), length: float = 160.0) -> Draw:
    """Draw a ball on a thin grey thread."""

    def draw(scene: np.ndarray, angle: float) -> None:
        bar(scene, pivot, hanging(pivot, length, angle), 1.5, (90, 90, 90))
        disc(scene, hanging(pivot, length, angle), radius, rgb)

    return draw


def stick(rgb: Rgb, width: float, pivot: Point = (160.0, 30.0), length: float = 160.0) -> Draw:
    """Draw a stick of one colour that hangs from one end."""
    return lambda scene, angle: bar(scene, pivot, hanging(pivot, length, angle), width, rgb)


def wheel(dot: Rgb, centre: Point = (160.0, 120.0), radius: float = 80.0) -> Draw:
    """Draw a grey wheel of six spokes with a dot between two of them; counter-clockwise is positive."""

    def draw(scene: np.ndarray, angle: float) -> None:
        disc(scene, centre, radius, (200, 202, 205))
        disc(scene, centre, 0.87 * radius, (120, 124, 130))
        for spoke in np.arange(6) * np.pi / 3:
            bar(scene, centre, _around(centre, 0.87 * radius, angle + spoke), 5.0, (210, 210, 210))
        disc(scene, _around(centre, 0.65 * radius, angle + np.pi / 6), 7.0, dot)
        disc(scene, centre, 8.0, (60, 60, 60))

    return draw


def disc(scene: np.ndarray, centre: Point, radius: float, rgb: Rgb) -> None:
    """Draw a filled disc; places and sizes are in pixels of the picture."""
    cv2.circle(scene, _fixed(centre), round(radius * _FINER * 2**_SUBPIXEL_BITS), rgb[::-1], -1, shift=_SUBPIXEL_BITS)


def bar(scene: np.ndarray, start: Point, end: Point, width: float, rgb: Rgb) -> None:
    """Draw a straight bar with square ends."""
    along = np.subtract(end, start) / np.hypot(*np.subtract(end, start))
    side = 0.5 * width * np.array([-along[1], along[0]])
    corners = [_fixed(p) for p in (start + side, end + side, end - side, start - side)]
    cv2.fillConvexPoly(scene, np.array(corners), rgb[::-1], shift=_SUBPIXEL_BITS)


def _around(centre: Point, radius: float, angle: float) -> Point:
    return centre[0] + radius * np.cos(angle), centre[1] - radius * np.sin(angle)


def _fixed(point: Point) -> tuple[int, int]:
    """Return a place of the picture in the finer scene, as OpenCV's fixed-point numbers."""
    x, y = (round(((v + 0.5) * _FINER - 0.5) * 2**_SUBPIXEL_BITS) for v in point)
    return x, y
