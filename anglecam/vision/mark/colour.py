"""The mark's colour: hue against skin to find the mark, then the best linear separation from its surroundings.

Light on an edge pixel is a mixture, and a mixture is linear in the picture's values. The fraction of a pixel that the
mark covers is therefore estimated by a linear function of blue, green and red: Fisher's discriminant between the mark
and its surroundings. The discriminant also suppresses whatever varies in the surroundings: light and shade, skin,
wallpaper.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from anglecam.data.typing import Floats, Image

EMPTY_LEVEL, FULL_LEVEL = 40.0, 215.0
"""Grey levels of a fraction map that stand for a pixel without mark and for a pixel full of it. The levels below and
above leave room for noise."""

_SKIN_SLOPE = 0.5
"""Skin of every complexion, wood and warm light lie along b* ≈ 2·a*. The difference a* − 0.5·b* vanishes there."""
_NOISE_FLOOR = 3.0
"""Grey levels; keeps the discriminant from relying on differences that a codec does not preserve."""
_ELSEWHERE_SHARE = 0.3
"""Weight of the rest of the picture in the scatter of the surroundings; the neighbours of the mark matter most."""


@dataclass(frozen=True)
class ColourModel:
    """Linear model of the fraction of a pixel that the mark covers."""

    weights: Floats
    """(3,) per grey level of blue, green, red."""
    offset: float
    """Fraction = weights · (b, g, r) + offset: 0 next to the mark, 1 inside it."""
    noise: float
    """Standard deviation of the fraction in the mark's surroundings."""
    mean_bgr: Floats
    """(3,) the mark's colour in this clip, grey levels."""

    @property
    def mean_rgb(self) -> tuple[int, int, int]:
        """The mark's colour as red, green, blue."""
        blue, green, red = (round(float(v)) for v in np.clip(self.mean_bgr, 0, 255))
        return red, green, blue

    def fraction_map(self, image: Image) -> Image:
        """Map an image to the fraction of mark in each pixel, as grey levels from `EMPTY_LEVEL` to `FULL_LEVEL`."""
        scale = FULL_LEVEL - EMPTY_LEVEL
        blue, green, red = (np.float32(weight) for weight in self.weights * scale)
        offset = np.float32(self.offset * scale + EMPTY_LEVEL)
        return np.asarray(_weighted(np.ravel(image), blue, green, red, offset).reshape(image.shape[:2]))


def hue_contrast(lab: Image, rgb: tuple[int, int, int] | None) -> NDArray[Any]:
    """Return how strongly each pixel has the mark's hue, insensitive to skin and little affected by shading.

    Parameters
    ----------
    lab : ndarray
        (h, w, 3) CIE Lab, bytes.
    rgb : tuple of int, optional
        The declared colour. Without it the hue is red as opposed to skin: a* − 0.5·b* of CIE Lab.

    Returns
    -------
    ndarray
        (h, w), units of CIE Lab's a* and b*. With a declared colour: the component of (a*, b*) along the declared hue
        minus the magnitude of the component across it.
    """
    if rgb is None:
        contrast = np.empty(lab.shape[:2], np.float32)
        slope, offset = np.float32(_SKIN_SLOPE), np.float32(128.0 * (1.0 - _SKIN_SLOPE))
        green_red, blue_yellow = (np.ascontiguousarray(lab[..., k]) for k in (1, 2))
        _less(green_red, blue_yellow, slope, offset, contrast)
        return contrast
    along = lab_of(rgb)[1:]
    along = along / max(float(np.hypot(*along)), 1.0)
    across = np.array([-along[1], along[0]])
    rows = np.array([[0.0, *v, -128.0 * v.sum()] for v in (along, across)])
    parts = cv2.transform(np.ascontiguousarray(lab, np.float32), rows)
    return parts[..., 0] - np.abs(parts[..., 1])


@njit("(uint8[:, ::1], uint8[:, ::1], float32, float32, float32[:, ::1])", cache=True, nogil=True)
def _less(first, second, slope, offset, found):  # type: ignore[no-untyped-def]
    """Fill in first − slope·second − offset of two planes of bytes."""
    for y in range(found.shape[0]):
        to, one, other = found[y], first[y], second[y]
        for x in range(found.shape[1]):
            to[x] = np.float32(one[x]) - slope * np.float32(other[x]) - offset


def lab_of(rgb: tuple[int, int, int]) -> Floats:
    """Return (L*, a*, b*) of a colour, (3,); L* from 0 to 100."""
    pixel = np.array([[rgb[::-1]]], np.uint8)
    stored = cv2.cvtColor(pixel, cv2.COLOR_BGR2LAB)[0, 0].astype(float)
    return (stored - [0.0, 128.0, 128.0]) * [100.0 / 255.0, 1.0, 1.0]


def fit_discriminant(inside: Image, around: Image, elsewhere: Image) -> ColourModel:
    """Fit the linear discriminant between the mark and its surroundings: w ∝ Σ⁻¹ (μ_mark − μ_around) (Fisher 1936).

    Parameters
    ----------
    inside, around, elsewhere : ndarray
        (n, 3) blue, green, red, bytes: of the mark's inner pixels, of the pixels next to it, and of the rest of the
        picture without things of the mark's colour.

    Returns
    -------
    ColourModel
        Scaled so that the mean of the surroundings maps to 0 and that of the mark to 1.
    """
    of_inside, of_around, of_elsewhere = (_Sums.of(pixels) for pixels in (inside, around, elsewhere))
    mean_in, mean_around = of_inside.mean, of_around.mean
    # The scatter is taken around the neighbours' mean, so that colours far from it (dark hair) are suppressed too.
    spread = (1.0 - _ELSEWHERE_SHARE) * of_around.covariance
    spread += _ELSEWHERE_SHARE * of_elsewhere.mean_square_about(mean_around)
    within = of_inside.covariance + spread + _NOISE_FLOOR**2 * np.eye(3)
    w = np.asarray(np.linalg.solve(within, mean_in - mean_around), float)
    w /= w @ (mean_in - mean_around)
    offset = -float(w @ mean_around)
    value = around.astype(float) @ w + offset
    noise = 1.4826 * float(np.median(np.abs(value - np.median(value))))
    return ColourModel(w, offset, noise, mean_in)


@dataclass(frozen=True)
class _Sums:
    """Sums over pixels of bytes, which are exact."""

    count: int
    first: NDArray[np.int64]
    """(3,) of blue, green, red."""
    products: NDArray[np.int64]
    """(3, 3) of the products of two of them."""

    @classmethod
    def of(cls, pixels: Image) -> _Sums:
        """Return those of pixels (n, 3)."""
        return cls(len(pixels), *_sums(np.ascontiguousarray(pixels)))

    @property
    def mean(self) -> Floats:
        """(3,) mean colour."""
        return self.first / self.count

    @property
    def covariance(self) -> Floats:
        """(3, 3) around the mean."""
        return self.mean_square_about(self.mean) * (self.count / (self.count - 1))

    def mean_square_about(self, colour: Floats) -> Floats:
        """Return the mean (3, 3) of the products of the deviations from a colour (3,)."""
        off = self.mean - colour
        return (self.products - np.outer(self.first, self.mean)) / self.count + np.outer(off, off)


@njit("(uint8[::1], float32, float32, float32, float32)", cache=True, nogil=True)
def _weighted(bytes_, blue, green, red, offset):  # type: ignore[no-untyped-def]
    """Return the weighted sum of each three bytes, rounded to a byte: `cv2.transform` in a tenth of the time."""
    levels = np.empty(len(bytes_) // 3, np.uint8)
    for k in range(len(levels)):
        level = offset + blue * np.float32(bytes_[3 * k])
        level += green * np.float32(bytes_[3 * k + 1])
        level += red * np.float32(bytes_[3 * k + 2])
        level = min(max(level, np.float32(0.0)), np.float32(255.0))
        levels[k] = np.uint8(np.rint(level))
    return levels


@njit("(uint8[:, ::1],)", cache=True, nogil=True)
def _sums(pixels):  # type: ignore[no-untyped-def]
    b = g = r = bb = bg = br = gg = gr = rr = np.int64(0)
    for k in range(len(pixels)):
        blue, green, red = np.int64(pixels[k, 0]), np.int64(pixels[k, 1]), np.int64(pixels[k, 2])
        b, g, r = b + blue, g + green, r + red
        bb, bg, br = bb + blue * blue, bg + blue * green, br + blue * red
        gg, gr, rr = gg + green * green, gr + green * red, rr + red * red
    return np.array([b, g, r]), np.array([[bb, bg, br], [bg, gg, gr], [br, gr, rr]])
