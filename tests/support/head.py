"""A face in profile as one layer that can be sampled at any angle.

The layer is drawn at 8×, reduced to 4× by area, and blurred by the camera's point spread function (a round Gaussian
that includes the pixel's aperture), so that one sample per pixel gives the picture. The head is turned by sampling the
layer on a rotated grid, so the drawn angle is exact. Head points are complex numbers in units of the lever arm, with
the pivot at 0, forward positive, up imaginary.
"""

from __future__ import annotations

from functools import cached_property

import cv2
import numpy as np
from scipy.interpolate import CubicSpline

from .look import BLUR_PX, Look, relief

FINE = 4

FACE = [(-0.20, -0.42), (-0.24, -0.15), (-0.47, 0.15), (-0.55, 0.50), (-0.38, 0.88), (0.0, 1.08), (0.42, 1.08),
        (0.76, 0.90), (0.91, 0.66), (0.93, 0.50), (0.96, 0.44), (1.06, 0.33), (1.14, 0.25), (1.06, 0.215),
        (1.00, 0.19), (0.99, 0.12), (0.965, 0.05), (0.955, 0.01), (0.975, -0.07), (0.93, -0.17), (0.78, -0.20),
        (0.52, -0.14), (0.34, -0.20), (0.28, -0.42)]  # fmt: skip
LIPS = [(0.855, 0.122), (0.92, 0.17), (0.99, 0.205), (1.045, 0.19), (1.06, 0.15), (1.03, 0.123), (1.05, 0.09),
        (1.03, 0.05), (0.97, 0.04), (0.91, 0.075)]  # fmt: skip
HAIR = [(-0.18, -0.25), (-0.36, -0.10), (-0.55, 0.15), (-0.62, 0.52), (-0.44, 0.94), (-0.02, 1.16),
        (0.46, 1.16), (0.82, 0.96), (0.90, 0.80), (0.62, 0.83), (0.36, 0.68), (0.22, 0.45), (0.04, 0.34),
        (-0.14, 0.10)]  # fmt: skip
EYE = [(0.66, 0.50), (0.74, 0.54), (0.83, 0.545), (0.85, 0.50), (0.82, 0.47), (0.73, 0.475)]
BROW = [(0.62, 0.62), (0.74, 0.66), (0.88, 0.635), (0.88, 0.615), (0.74, 0.635)]
SKIN = {"pale": ((232, 196, 172), (98, 66, 44)), "dark": ((112, 76, 56), (26, 22, 24))}
"""Skin and hair, rgb."""


def _smooth(points: list[tuple[float, float]]) -> np.ndarray:
    """Return a closed cubic spline through the points."""
    z = np.array([complex(*p) for p in [*points, points[0]]])
    along = np.append(0.0, np.cumsum(np.sqrt(np.abs(np.diff(z)))))  # centripetal: no loops between near points
    return CubicSpline(along, z, bc_type="periodic")(np.linspace(0, along[-1], 600)[:-1])


def _centroid(z: np.ndarray) -> complex:
    """Return the centre of a polygon's area."""
    after = np.roll(z, -1)
    cross = (z.conj() * after).imag
    return complex(np.sum((z + after) * cross) / (3 * np.sum(cross)))


class Head:
    """The drawn head of a look."""

    def __init__(self, look: Look) -> None:
        self.look = look
        # Rotate and scale the drawing about its pivot so that the lips' centroid has the specified position.
        target = look.lever_px * np.exp(1j * np.radians(look.neutral_deg))
        self._unit = target / _centroid(_smooth(LIPS))
        self.reach = float(np.abs(np.concatenate([_smooth(FACE), _smooth(HAIR)]) * self._unit).max()) + 4
        self.front = float(np.abs(_smooth(FACE)[_smooth(FACE).real > 0.5] * self._unit).max())
        self._half = int(np.ceil(self.reach * FINE))

    @cached_property
    def layer(self) -> np.ndarray:
        """Return premultiplied BGR and alpha at 4×."""
        return self._blurred(self._draw())

    def lips_layer(self) -> np.ndarray:
        """Return the lips alone, one channel of alpha, drawn with the same steps as the head, for checks."""
        return self._blurred(self._mask(LIPS))

    def sample(self, layer: np.ndarray, angle_deg: float, corner: tuple[int, int], size: tuple[int, int]) -> np.ndarray:
        """Return a window of the image of the layer with the head at that angle."""
        turn, sign, at = np.radians(angle_deg), self.look.sign, self.look.pivot
        # Image (x, y) from the pivot → forward/up → rotated back by the angle → layer sample.
        flip = np.array([[sign, 0.0], [0.0, -1.0]])
        back = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        linear = FINE * np.array([[1.0, 0.0], [0.0, -1.0]]) @ back @ flip
        offset = linear @ (np.array(corner) - at) + self._half
        matrix = np.column_stack([linear, offset])
        return cv2.warpAffine(layer, matrix, size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)

    def _blurred(self, layer: np.ndarray) -> np.ndarray:
        return cv2.GaussianBlur(layer, (0, 0), BLUR_PX * FINE)

    def _mask(self, outline: list[tuple[float, float]], smooth: bool = True, width: float = 0.0) -> np.ndarray:
        """Return the coverage 0–1 at 4× of a filled outline, or of an open line of that width."""
        z = (_smooth(outline) if smooth else np.array([complex(*p) for p in outline])) * self._unit
        side = 2 * (2 * self._half + 1)
        xy = np.column_stack([z.real, -z.imag]) * 2 * FINE + 2 * self._half + 0.5
        canvas = np.zeros((side, side), np.uint8)
        fixed = [np.round(xy * 256).astype(np.int32)]
        if width:
            cv2.polylines(canvas, fixed, False, 255, int(width * 2 * FINE * self.look.lever_px), shift=8)
        else:
            cv2.fillPoly(canvas, fixed, 255, shift=8)
        small = cv2.resize(canvas, (side // 2, side // 2), interpolation=cv2.INTER_AREA)
        return small.astype(np.float32) / 255

    def _draw(self) -> np.ndarray:
        rng = np.random.default_rng(self.look.texture_seed)
        side = 2 * self._half + 1
        shape, lever = (side, side), self.look.lever_px * FINE
        skin, hair = (np.array(c, np.float32) for c in SKIN[self.look.skin])
        along = np.arange(side, dtype=np.float32)
        forward, up = (along[None, :] - self._half) / lever, (self._half - along[:, None]) / lever
        shade = 1 - 0.10 * np.clip(0.5 - forward, 0, 1.2) - 0.12 * np.clip(0.1 - up, 0, 0.6)
        shade = shade * (1 + 0.035 * relief(rng, shape, 0.22 * lever) + 0.02 * relief(rng, shape, 1.5 * FINE))
        freckles = np.clip(relief(rng, shape, 0.02 * lever) - 1.6, 0, 1)
        blush = np.exp(-((forward - 0.68) ** 2 + (up - 0.26) ** 2) / 0.02)
        face = skin * shade[..., None]
        face *= 1 - np.array([0.22, 0.32, 0.38], np.float32) * freckles[..., None]
        face *= 1 - np.array([0.0, 0.10, 0.09], np.float32) * blush[..., None]
        strands = relief(rng, (side, side), 0.012 * lever) + np.sin(60 * np.hypot(forward + 0.1, up - 0.2))
        locks = hair * (1 + 0.22 * strands[..., None])
        seam = self._mask([(0.87, 0.124), (0.95, 0.130), (1.03, 0.124)], smooth=False, width=0.014)

        def lips(rows: slice, columns: slice) -> np.ndarray:
            light = 1 + 1.2 * (up[rows] - 0.12) + 0.5 * (forward[:, columns] - 0.97)
            red = np.array(self.look.lips_rgb, np.float32) * light[..., None]
            return red * (1 - 0.5 * seam[rows, columns][..., None])

        def eye(rows: slice, columns: slice) -> np.ndarray:
            iris = ((forward[:, columns] - 0.80) ** 2 + (up[rows] - 0.508) ** 2 < 0.032**2)[..., None]
            return np.where(iris, np.float32([52, 62, 40]), np.float32([232, 230, 226]))

        jaw = self._mask([(0.50, -0.13), (0.22, -0.02), (0.10, 0.16)], smooth=False, width=0.02)
        nostril = self._mask([(1.00, 0.232), (1.05, 0.238)], smooth=False, width=0.02)

        rgb, alpha = np.zeros((*shape, 3), np.float32), np.zeros(shape, np.float32)
        black = np.full(3, 24, np.float32)
        for cover, colour in [
            (self._mask(FACE), face),
            (0.25 * jaw, black),
            (0.6 * nostril, black),
            (self._mask(HAIR), locks),
            (self._mask(BROW), hair),
            (self._mask(EYE), eye),
            (self._mask(LIPS), lips),
        ]:
            x, y, w, h = cv2.boundingRect((cover > 0).view(np.uint8))  # most parts cover little of the head
            box = slice(y, y + h), slice(x, x + w)
            paint = colour(*box) if callable(colour) else np.broadcast_to(colour, rgb.shape)[box]
            rgb[box] += cover[box][..., None] * (paint - rgb[box])
            alpha[box] += cover[box] * (1 - alpha[box])
        return np.dstack([rgb[..., ::-1], alpha])
