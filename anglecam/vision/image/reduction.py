"""Pictures reduced to a size at which they still show what is sought, and places in them."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from anglecam.data.typing import Floats, Image


def reduction(size: Sequence[int], longest_px: float) -> Floats:
    """Return the matrix from a picture to the reduced one; both count from the middle of the first pixel.

    Parameters
    ----------
    size : sequence of int
        Of the picture, px.
    longest_px : float
        Longer side of the reduced picture.

    Returns
    -------
    ndarray
        (3, 3); the unit matrix for a picture that is no larger.
    """
    scale = min(1.0, longest_px / max(size))
    return np.array([[scale, 0.0, (scale - 1.0) / 2.0], [0.0, scale, (scale - 1.0) / 2.0], [0.0, 0.0, 1.0]])


def reduced(picture: Image, longest_px: float) -> Image:
    """Return a picture (h, w) or (h, w, planes) whose longer side is at most ``longest_px``."""
    scale = float(reduction(picture.shape[:2], longest_px)[0, 0])
    if scale == 1.0:
        return picture
    small = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return small.reshape(*small.shape[:2], *picture.shape[2:])
