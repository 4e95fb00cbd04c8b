"""The whole picture: a still background with a second red object, and in front of it the moving body on its shaft."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import cv2
import numpy as np
from scipy.special import erfc

from .head import Head
from .look import BLUR_PX, SIZE, Look, relief

OVERSAMPLING = 2
MARKERS = {
    "ring": ((238, 238, 236), (22, 22, 24)),
    "ring_white": ((20, 20, 22), (236, 236, 234)),
    "disc_dark": ((16, 16, 18), None),
    "disc_bright": ((242, 242, 240), None),
    "none": (None, None),
}
"""RGB of disc and ring; the ring lies between 0.45 and 0.72 of the disc's radius."""


def _spot(centre: np.ndarray, radius: float) -> tuple[slice, slice, np.ndarray]:
    """Return the rows and columns that a blurred disc covers, and its coverage there."""
    reach = radius + 5 * BLUR_PX
    low = np.maximum(np.floor(np.asarray(centre) - reach).astype(int), 0)
    high = np.minimum(np.ceil(np.asarray(centre) + reach).astype(int) + 1, SIZE)
    y, x = np.mgrid[low[1] : high[1], low[0] : high[0]]
    distance = np.hypot(x - centre[0], y - centre[1]) - radius
    cover = 0.5 * erfc(distance / (np.sqrt(2) * BLUR_PX))
    return slice(low[1], high[1]), slice(low[0], high[0]), cover.astype(np.float32)[..., None]


def _paint(scene: np.ndarray, cover: np.ndarray, rgb: tuple[int, int, int]) -> None:
    scene += cover * (np.float32(rgb[::-1]) - scene)


def _fill(scene: np.ndarray, points: np.ndarray, rgb: tuple[float, ...]) -> None:
    """Fill a polygon, given in image pixels, on an oversampled canvas."""
    fixed = np.round((np.asarray(points) * OVERSAMPLING + (OVERSAMPLING - 1) / 2) * 256).astype(np.int32)
    cv2.fillPoly(scene, [fixed], [float(c) for c in rgb[::-1]], shift=8)


def red_object_centre(look: Look) -> np.ndarray:
    """Return the centre of the red object, in px."""
    if look.red_place == "near":
        return look.mouth([0.0])[0] + [look.sign * (0.25 * look.lever_px + 46), -4]
    return np.array([319.5 + look.sign * 250, 405])


def background(look: Look) -> np.ndarray:
    """Return everything that stands still behind the moving body, as float BGR."""
    rng = np.random.default_rng(look.texture_seed + 1)
    width, height = SIZE[0] * OVERSAMPLING, SIZE[1] * OVERSAMPLING
    y, x = np.mgrid[0:height, 0:width].astype(np.float32) / OVERSAMPLING
    if look.background == "wallpaper":
        leaf = np.sin(x / 9 + 2.2 * np.sin(y / 23)) * np.sin(y / 12)
        level = 150 + 14 * np.sign(np.sin(x / 21)) + 16 * (leaf > 0.45)
        tint = np.float32([1.00, 1.03, 0.96])
    else:
        level = 90 + 0.14 * x + 0.06 * y
        tint = np.float32([1.04, 1.02, 0.95])
    level = level * (1 + 0.05 * relief(rng, (height, width), 240)) + 2 * relief(rng, (height, width), 2.5)
    scene = (level[..., None] * tint).astype(np.float32)
    px, py = look.pivot
    _fill(scene, [[px - 30, py + 20], [px + 30, py + 20], [px + 52, 490], [px - 52, 490]], (70, 74, 80))
    centre = red_object_centre(look)
    red = np.array(look.red_rgb, float)
    if look.red_object == "mug":
        angle = np.linspace(0, 2 * np.pi, 90)
        rim = np.column_stack([np.cos(angle), 0.22 * np.sin(angle)])
        for radius, colour in ((24, red * 0.9), (15, None)):
            handle = np.column_stack([0.8 * np.cos(angle), np.sin(angle)]) * radius
            where = handle + np.array([centre[0] + look.sign * 34, centre[1]])
            _fill(scene, where, scene[10, 10, ::-1] if colour is None else colour)
        body = centre + np.vstack([rim[:45] * 34 + [0, 40], rim[45:] * 34 - [0, 40]])
        _fill(scene, body, red)
        _fill(scene, centre + (rim * 34 - [0, 40]), red * 0.45)
        glint = np.array([[-24, -26], [-17, -25], [-17, 30], [-24, 29]])
        _fill(scene, centre + glint, np.minimum(red * 1.25, 255))
    elif look.red_object == "book":
        corners = np.array([[-36, -50], [36, -50], [36, 50], [-36, 50]]) @ [[0.985, 0.17], [-0.17, 0.985]]
        _fill(scene, centre + corners, red)
        _fill(scene, centre + (corners * [0.6, 0.08] - [0, 22]), (214, 190, 120))
    scene = cv2.GaussianBlur(scene, (0, 0), BLUR_PX * OVERSAMPLING)
    return cv2.resize(scene, SIZE, interpolation=cv2.INTER_LINEAR)


@lru_cache(maxsize=2)
def _prepared(look: Look) -> tuple[Head, np.ndarray]:
    """Prepare a look; its noise, marker and distractor are added to each picture."""
    return Head(look), background(look)


class Scene:
    """The whole picture at any angle and time, before the sensor's noise."""

    def __init__(self, look: Look) -> None:
        self.look = look
        self.head, self._still = _prepared(
            replace(look, noise=0.0, marker="none", marker_radius_px=1.0, distractor=None)
        )
        low = np.maximum(np.floor(look.pivot - self.head.reach).astype(int), 0)
        high = np.minimum(np.ceil(look.pivot + self.head.reach).astype(int) + 1, SIZE)
        self._corner, self._size = (int(low[0]), int(low[1])), (int(high[0] - low[0]), int(high[1] - low[1]))
        disc, ring = MARKERS[look.marker]
        discs = [(1.0, disc), (0.72, ring), (0.45, disc)] if ring else [(1.0, disc)] if disc else []
        self._marker = [(*_spot(look.pivot, share * look.marker_radius_px), colour) for share, colour in discs]

    def at(self, angle_deg: float, time_s: float = 0.0) -> np.ndarray:
        """Return one picture as float BGR."""
        scene = self._still.copy()
        self._distract(scene, time_s)
        (x, y), (width, height) = self._corner, self._size
        part = scene[y : y + height, x : x + width]
        bgra = self.head.sample(self.head.layer, angle_deg, self._corner, self._size)
        bare = cv2.cvtColor(1 - bgra[..., 3], cv2.COLOR_GRAY2BGR)
        part[:] = cv2.add(cv2.multiply(part, bare), cv2.cvtColor(bgra, cv2.COLOR_BGRA2BGR))
        for rows, columns, cover, colour in self._marker:
            _paint(scene[rows, columns], cover, colour)
        return scene

    def _distract(self, scene: np.ndarray, time_s: float) -> None:
        sign = self.look.sign
        if self.look.distractor == "pendulum":
            swing = np.radians(25) * np.sin(2 * np.pi * 0.9 * time_s)
            hook = np.array([319.5 + sign * 245, 40.0])
            for along in np.linspace(0, 80, 28):
                rows, columns, cover = _spot(hook + along * np.array([np.sin(swing), np.cos(swing)]), 1.5)
                _paint(scene[rows, columns], cover, (60, 50, 40))
            bob = hook + 88 * np.array([np.sin(swing), np.cos(swing)])
            rows, columns, cover = _spot(bob, 10.0)
            _paint(scene[rows, columns], cover, self.look.red_rgb)
        elif self.look.distractor == "led":
            slide = 2 * abs((0.35 * time_s) % 1.0 - 0.5)
            rows, columns, cover = _spot(np.array([319.5 + sign * (130 + 150 * slide), 30.0]), 6.0)
            _paint(scene[rows, columns], cover, (240, 40, 44))
