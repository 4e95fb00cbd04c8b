"""Which colour is the mouth's: hue against skin first, then the best linear separation from what is around it.

Light on an edge pixel is a mixture, and a mixture is linear in the picture's values. So the fraction of a pixel
that is mouth is estimated by a linear function of blue, green and red: Fisher's discriminant between the mouth
and its surroundings, which at once ignores what varies there (light and shade, skin, wallpaper).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats, Image

EMPTY_LEVEL, FULL_LEVEL = 40.0, 215.0
"""Grey levels of a fraction map that stand for no mouth and for nothing but mouth; the rest is head room."""

_SKIN_SLOPE = 0.5
"""Skin of every complexion, wood and warm light lie along b* ≈ 2·a*; a* − 0.5·b* is blind along that line."""
_NOISE_FLOOR = 3.0
"""Grey levels; keeps the discriminant from leaning on differences that a codec does not carry."""
_ELSEWHERE = 0.3
"""Share of the rest of the picture in what the mouth is told from: its neighbours matter most."""


@dataclass(frozen=True)
class ColourModel:
    """How to read the fraction of mouth from a pixel."""

    weights: Floats
    """(3,) per grey level of blue, green, red."""
    offset: float
    """Fraction = weights · (b, g, r) + offset: 0 around the mouth, 1 in it."""
    noise: float
    """Standard deviation of the fraction in the mouth's surroundings."""
    mean_bgr: Floats
    """(3,) the mouth's colour in this clip, grey levels."""
    chroma: Floats
    """(2,) the mouth's a*, b*."""

    @property
    def mean_rgb(self) -> tuple[int, int, int]:
        """The mouth's colour as red, green, blue."""
        blue, green, red = (round(float(v)) for v in np.clip(self.mean_bgr, 0, 255))
        return red, green, blue

    def fraction_map(self, image: Image) -> Image:
        """Map an image to grey levels from `NONE` to `FULL` by the fraction of mouth in each pixel."""
        scale = FULL_LEVEL - EMPTY_LEVEL
        matrix = np.append(self.weights * scale, self.offset * scale + EMPTY_LEVEL)[None, :]
        return cv2.transform(image, matrix)


def hue_contrast(image: Image, rgb: tuple[int, int, int] | None) -> NDArray[Any]:
    """Map an image to how much each pixel has the mouth's hue, blind to skin and little moved by shading.

    Parameters
    ----------
    image : ndarray
        (h, w, 3) blue, green, red.
    rgb : tuple of int, optional
        The declared colour; without it, red as against skin: a* − 0.5·b* of CIE Lab.

    Returns
    -------
    ndarray
        (h, w), units of CIE Lab's a* and b*. With a declared colour: the part of (a*, b*) along the declared hue
        less the part across it.
    """
    lab = cv2.cvtColor(image, cv2.COLOR_BGR2LAB)
    if rgb is None:
        row = np.array([[0.0, 1.0, -_SKIN_SLOPE, -128.0 * (1.0 - _SKIN_SLOPE)]])
        return cv2.transform(lab.astype(np.float32), row)
    along = chroma_of(rgb)
    along = along / max(float(np.hypot(*along)), 1.0)
    across = np.array([-along[1], along[0]])
    rows = np.array([[0.0, *v, -128.0 * v.sum()] for v in (along, across)])
    parts = cv2.transform(lab.astype(np.float32), rows)
    return parts[..., 0] - np.abs(parts[..., 1])


def chroma_of(rgb: tuple[int, int, int]) -> Floats:
    """Return (a*, b*) of a colour."""
    pixel = np.array([[rgb[::-1]]], np.uint8)
    return cv2.cvtColor(pixel, cv2.COLOR_BGR2LAB)[0, 0, 1:].astype(float) - 128.0


def learn_colour(inside: Floats, around: Floats, elsewhere: Floats) -> ColourModel:
    """Learn how to tell the mouth from its surroundings: w ∝ Σ⁻¹ (μ_mouth − μ_around) (Fisher 1936).

    Parameters
    ----------
    inside, around, elsewhere : ndarray
        (n, 3) blue, green, red: of the mouth's inner pixels, of those next to it, and of the rest of the picture
        but for things of the mouth's own colour.

    Returns
    -------
    ColourModel
        Scaled so that the surroundings' mean maps to 0 and the mouth's to 1.
    """
    mean_in, mean_around = inside.mean(axis=0), around.mean(axis=0)
    # About the neighbours' mean, so that what is far from it (dark hair) may not look like the mouth either.
    off = elsewhere.astype(float) - mean_around
    spread = (1.0 - _ELSEWHERE) * np.cov(around.T) + _ELSEWHERE * off.T @ off / len(off)
    within = np.cov(inside.T) + spread + _NOISE_FLOOR**2 * np.eye(3)
    w = np.linalg.solve(within, mean_in - mean_around)
    w /= w @ (mean_in - mean_around)
    offset = -float(w @ mean_around)
    value = around @ w + offset
    noise = 1.4826 * float(np.median(np.abs(value - np.median(value))))
    chroma = chroma_of(tuple(round(v) for v in np.clip(mean_in[::-1], 0, 255)))
    return ColourModel(w, offset, noise, mean_in, chroma)
