"""The noise of a clip's pixels."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import cv2
import numpy as np

from anglecam.data.typing import Image
from anglecam.vision.image.median import median_of_bytes


def pixel_noise(images: Sequence[Image]) -> float:
    """Estimate the pixels' standard deviation from the difference between consecutive frames.

    The median absolute difference is used, so the still part of the picture determines the result.

    Parameters
    ----------
    images : sequence of ndarray
        (h, w, planes) or (h, w) frames of bytes; most of each picture shows scenery that does not move.

    Returns
    -------
    float
        Grey levels, at least the standard deviation of rounding to integers; 1 with fewer than two frames.
    """
    if len(images) < 2:
        return 1.0
    every_fourth = (np.ascontiguousarray(image[::4, ::4]) for image in images)
    apart = np.stack([cv2.absdiff(a, b) for a, b in itertools.pairwise(every_fourth)])
    quantised = 1.0 / np.sqrt(12.0)
    return float(max(quantised, 1.4826 * median_of_bytes(apart) / np.sqrt(2.0)))
