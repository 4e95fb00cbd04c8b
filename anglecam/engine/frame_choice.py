"""The frames by which explanations are compared: evenly spread over those in which something has moved.

Frames at rest show the same pose again. To predict one of them from another is no proof of a motion, and behind a body
that rests for half of the film no background is seen.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Image

_LONGEST_PX = 160
"""Longer side of the reduced frames that are compared."""
_MOVED = 6.0
"""Standard deviations of a difference by which a smoothed pixel has to differ from that of the last frame that counts,
so that something has moved: of 10⁴ pixels in 200 frames none does by chance."""
_LEAST_NOISE = 0.5
"""Grey levels; pixels are whole numbers."""
_MAD = 1.4826
"""Standard deviation of normal values over the median of their magnitudes."""
_STEADY = 0.1
"""Share of the pairs of successive frames that show the noise alone; light and camera change what is between others.
Where they change all pairs, no frame counts as one at rest."""


def thumbnail(image: Image) -> NDArray[np.float32]:
    """Return a frame's brightness, (h, w) or (h, w, 1), reduced and smoothed as it is compared."""
    scale = min(1.0, _LONGEST_PX / max(image.shape[:2]))
    reduced = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.GaussianBlur(reduced.astype(np.float32), (0, 0), 1.0))


def spread_over_motion(thumbnails: Sequence[NDArray[np.float32]], most: int) -> NDArray[np.int64]:
    """Choose frames in which something has moved since the last one that counts.

    Parameters
    ----------
    thumbnails : sequence of ndarray
        Of n frames, in order; one at least.
    most : int
        Number of frames to choose, at most.

    Returns
    -------
    ndarray
        Their indices, ascending.
    """
    pictures = np.stack(thumbnails)
    level = np.maximum(1.0, np.median(pictures, axis=(1, 2), keepdims=True))
    pictures *= np.median(level) / level  # the light of a frame is no motion
    least = _MOVED * np.sqrt(2.0) * _noise(pictures)
    moved, last = [0], pictures[0]
    for k, picture in enumerate(pictures[1:], 1):
        if float(np.abs(picture - last).max()) > least:
            moved.append(k)
            last = picture
    return np.array(moved)[np.linspace(0, len(moved) - 1, min(most, len(moved))).round().astype(int)]


def _noise(pictures: NDArray[np.float32]) -> float:
    """Return the standard deviation of a pixel at rest of (n, h, w) pictures, grey levels."""
    off = np.median(np.abs(np.diff(pictures, axis=0)), axis=(1, 2))
    return max(_LEAST_NOISE, _MAD / np.sqrt(2.0) * float(np.quantile(off, _STEADY))) if len(off) else _LEAST_NOISE
