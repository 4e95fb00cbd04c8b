"""The noise of a clip's pixels."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray


def pixel_noise(images: Sequence[NDArray[Any]]) -> float:
    """Estimate the pixels' standard deviation from the difference between consecutive frames.

    The median absolute difference is used, so the still part of the picture determines the result.

    Parameters
    ----------
    images : sequence of ndarray
        (h, w, planes) frames; most of each picture shows scenery that does not move.

    Returns
    -------
    float
        Grey levels, at least the standard deviation of rounding to integers; 1 with fewer than two frames.
    """
    if len(images) < 2:
        return 1.0
    pairs = [a[::4, ::4].astype(float) - b[::4, ::4] for a, b in itertools.pairwise(images)]
    quantised = 1.0 / np.sqrt(12.0)
    return float(max(quantised, 1.4826 * float(np.median(np.abs(pairs))) / np.sqrt(2.0)))
