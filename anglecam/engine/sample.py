"""A few frames of a film as a camera at rest would see them under steady light, cut to where something changes.

Explanations of what moves are compared on such a sample (`anglecam.engine.score`). Its frames are grey and
reduced, so that memory and time do not grow with the film.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats, Image

FRAMES = 48
"""Frames of a sample, at most."""
LONGEST_PX = 240
"""Longer side of the part that is kept, after the reduction."""
_CHANGE = 6.0
"""Standard deviations by which a smoothed pixel has to differ from its median to count as changed. Only what is cut off
depends on it; every pixel that is kept is compared. Of 10⁵ pixels in 48 frames none differs as much by chance."""
_MARGIN = 0.1
"""Of the longer side of what changes: the part of the surroundings that is kept."""
_LEAST_NOISE = 0.5
"""Grey levels; pixels are whole numbers."""
_MAD = 1.4826
_DARK, _BRIGHT = 16.0, 235.0
"""Grey levels between which a pixel follows the light; black and white of television."""


@dataclass(frozen=True)
class Sample:
    """K frames of h × w pixels."""

    pictures: NDArray[np.float32] = field(repr=False)
    """(K, h, w) grey levels."""
    frames: NDArray[np.int64]
    """(K,) numbers of the frames in the film."""
    scale: float
    """Pixels of the sample for each pixel of the film."""
    corner_px: Floats
    """(2,) place of the sample's corner in the film, px."""
    noise: float
    """Standard deviation of a pixel where nothing moves, grey levels, the codec's errors included."""

    def place(self, point_px: Floats) -> Floats:
        """Map points (…, 2) of the film, px, to the sample."""
        return np.asarray((np.asarray(point_px) - self.corner_px + 0.5) * self.scale - 0.5)

    def in_film(self, place: Floats) -> Floats:
        """Map places (…, 2) of the sample to the film, px."""
        return np.asarray((np.asarray(place) + 0.5) / self.scale - 0.5 + self.corner_px)


def cut(
    images: Sequence[Image], moves: Sequence[Floats] | None = None
) -> tuple[NDArray[np.float32], float, Floats] | None:
    """Cut frames to where something changes, and reduce them.

    Parameters
    ----------
    images : sequence of ndarray
        K pictures (height, width, 3), BGR, spread over the film.
    moves : sequence of (2, 3) ndarray, optional
        For each frame the affine map from the picture of a camera at rest to the frame, px; without it the camera is
        at rest.

    Returns
    -------
    tuple or None
        (K, h, w) grey levels, `Sample.scale` and `Sample.corner_px`; ``None`` where nothing changes.
    """
    still = [None] * len(images) if moves is None else moves
    small = min(1.0, LONGEST_PX / max(images[0].shape[:2]))
    box = _changed_box(steady_light(np.stack([_seen(*one, small) for one in zip(images, still, strict=True)])))
    if box is None:
        return None
    left, top, right, bottom = (box / small).round().astype(int).tolist()
    scale = min(1.0, LONGEST_PX / max(right - left, bottom - top))
    part = np.s_[top:bottom, left:right]
    return np.stack([_seen(*one, scale, part) for one in zip(images, still, strict=True)]), scale, np.array([left, top])


def sample_of(pictures: NDArray[np.generic], frames: NDArray[np.int64], scale: float, corner_px: Floats) -> Sample:
    """Return the sample of (K, h, w) pictures that were `cut`; ``frames`` are their numbers."""
    steady = steady_light(np.asarray(pictures, np.float32))
    return Sample(steady, frames, scale, corner_px, noise_of(steady))


def steady_light(pictures: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return (K, h, w) pictures, each divided by its brightness relative to their median.

    Light and exposure multiply the light that falls on a pixel, and so, by whatever power the camera applies, its grey
    level. What moves does not count, because the median of the ratios is taken, nor what is black or saturated.
    """
    median = np.median(pictures, axis=0)
    result = np.empty_like(pictures)
    for i, picture in enumerate(pictures):
        fair = (median > _DARK) & (picture > _DARK) & (median < _BRIGHT) & (picture < _BRIGHT)
        result[i] = picture / np.median(picture[fair] / median[fair]) if fair.any() else picture
    return result


def noise_of(pictures: NDArray[np.float32]) -> float:
    """Return the standard deviation of a pixel where nothing moves, grey levels.

    It is the lower quartile over the picture, as something may move in most of it.
    """
    deviation = np.median(np.abs(pictures - np.median(pictures, axis=0)), axis=0)
    return max(_LEAST_NOISE, _MAD * float(np.quantile(deviation, 0.25)))


def _seen(
    image: Image, move: Floats | None, scale: float, part: tuple[slice, slice] = np.s_[:, :]
) -> NDArray[np.float32]:
    """Return a part of a frame as a camera at rest sees it, grey and reduced."""
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    if move is not None:
        still = cv2.WARP_INVERSE_MAP | cv2.INTER_LINEAR
        grey = cv2.warpAffine(grey, move, grey.shape[::-1], flags=still, borderMode=cv2.BORDER_REPLICATE)
    return cv2.resize(grey[part], None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA).astype(np.float32)


def _changed_box(pictures: NDArray[np.float32]) -> Floats | None:
    """Return left, top, right, bottom of what changes, with a margin, px."""
    noise = noise_of(pictures)
    off = np.abs(pictures - np.median(pictures, axis=0)).max(axis=0)
    smooth = cv2.GaussianBlur(off, (0, 0), 1.0)
    rows, columns = np.nonzero(smooth > _CHANGE * noise)
    if len(rows) == 0:
        return None
    height, width = off.shape
    margin = max(4.0, _MARGIN * float(max(np.ptp(rows), np.ptp(columns))))
    return np.array(
        [
            max(0.0, columns.min() - margin),
            max(0.0, rows.min() - margin),
            min(float(width), columns.max() + 1 + margin),
            min(float(height), rows.max() + 1 + margin),
        ]
    )
