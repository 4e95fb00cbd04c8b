"""How noisy the pixels of a clip are."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray


def pixel_noise(images: Sequence[NDArray[Any]]) -> float:
    """Estimate the pixels' standard deviation from what differs between frames where nothing moves.

    Parameters
    ----------
    images : sequence of ndarray
        (h, w, planes) frames, most of which show scenery.

    Returns
    -------
    float
        Grey levels; never below that of rounding to whole ones. 1 where there is nothing to compare.
    """
    if len(images) < 2:
        return 1.0
    pairs = [a[::4, ::4].astype(float) - b[::4, ::4] for a, b in itertools.pairwise(images)]
    quantised = 1.0 / np.sqrt(12.0)
    return float(max(quantised, 1.4826 * float(np.median(np.abs(pairs))) / np.sqrt(2.0)))
