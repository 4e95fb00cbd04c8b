"""The share of each pixel that a region covers, scaled between the local values just inside and just outside of it.

A single scale for the whole picture would shift the edge as bright and dark wallpaper pass behind it. The loops over
pixels are compiled: as array operations, most of their time goes into copies of the picture. They round as those do, in
single precision.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from anglecam.data.typing import Image
from anglecam.vision.mark.colour import EMPTY_LEVEL, FULL_LEVEL

_LOCAL_PX = 4.0
"""Scale, px, on which the values inside and outside of an edge are taken to be constant."""
_PRIOR = np.float32(1e-3)
"""Weight of the clip's typical values (0 outside, 1 inside) where no pixel is near."""
_LEAST_STEP = np.float32(0.3)
"""Smallest difference between the local values inside and outside, as a share of the clip's typical one."""
_EMPTY, _SPAN = np.float32(EMPTY_LEVEL), np.float32(FULL_LEVEL - EMPTY_LEVEL)


def cover_weight(fraction: Image, core: Image, near: Image, reach: Image, low: float) -> NDArray[Any]:
    """Return the weight of each pixel in a region: the share that is covered, without noise near 0 and 1.

    Parameters
    ----------
    fraction : ndarray
        (h, w) fraction map, grey levels.
    core : ndarray
        (h, w) bytes: 1 where a pixel is far enough inside to show the value of a full pixel.
    near : ndarray
        (h, w) bytes: 0 where a pixel is far enough outside to show the value of an empty pixel.
    reach : ndarray
        (h, w) bytes: 0 where the region's weight is zero.
    low : float
        Covered share up to which the weight is 0; from 1 - low on it is 1.

    Returns
    -------
    ndarray
        (h, w) from 0 to 1.
    """
    # normalised convolution (Knutsson & Westin 1993) extends known values smoothly to where none is known
    blurred = cv2.GaussianBlur(_known(fraction, core, near), (0, 0), _LOCAL_PX)
    return np.asarray(_weight(fraction, blurred, reach, np.float32(low), np.float32(1.0 - 2.0 * low)))


def connected_tail(smooth: Image, filled: Image, low: float) -> Image:
    """Return the pixels from a level on that are connected with a region, and the region.

    Parameters
    ----------
    smooth : ndarray
        (h, w) fraction map, grey levels.
    filled : ndarray
        (h, w) bytes: 1 inside the region's outline.
    low : float
        Grey level.

    Returns
    -------
    ndarray
        (h, w) bytes, 1 or 0.
    """
    count, labels = cv2.connectedComponents(_from_level(smooth, filled, low), connectivity=8)
    return np.asarray(_with_label_in(labels, filled, count))


@njit("(uint8[:, :], uint8[:, ::1], uint8[:, ::1])", cache=True, nogil=True)
def _known(fraction, core, near):  # type: ignore[no-untyped-def]
    """Return (h, w, 4) the sums and the weights of the known values inside, and of those outside."""
    height, width = fraction.shape
    known = np.empty((height, width, 4), np.float32)
    for y in range(height):
        for x in range(width):
            value = (np.float32(fraction[y, x]) - _EMPTY) / _SPAN
            inside, outside = np.float32(core[y, x]), np.float32(1 - near[y, x])
            known[y, x, 0] = value * inside + _PRIOR
            known[y, x, 1] = _PRIOR + inside
            known[y, x, 2] = value * outside
            known[y, x, 3] = _PRIOR + outside
    return known


@njit("(uint8[:, :], float32[:, :, ::1], uint8[:, ::1], float32, float32)", cache=True, nogil=True)
def _weight(fraction, blurred, reach, low, span):  # type: ignore[no-untyped-def]
    height, width = fraction.shape
    weight = np.zeros((height, width), np.float32)
    for y in range(height):
        for x in range(width):
            if reach[y, x] == 0:
                continue
            empty = blurred[y, x, 2] / blurred[y, x, 3]
            step = max(blurred[y, x, 0] / blurred[y, x, 1] - empty, _LEAST_STEP)
            value = (np.float32(fraction[y, x]) - _EMPTY) / _SPAN
            share = ((value - empty) / step - low) / span
            weight[y, x] = min(max(share, np.float32(0.0)), np.float32(1.0))
    return weight


@njit("(uint8[:, :], uint8[:, ::1], float64)", cache=True, nogil=True)
def _from_level(smooth, filled, low):  # type: ignore[no-untyped-def]
    height, width = smooth.shape
    found = np.empty((height, width), np.uint8)
    for y in range(height):
        for x in range(width):
            found[y, x] = smooth[y, x] >= low or filled[y, x] > 0
    return found


@njit("(int32[:, ::1], uint8[:, ::1], int64)", cache=True, nogil=True)
def _with_label_in(labels, filled, count):  # type: ignore[no-untyped-def]
    """Return 1 where a label other than 0 is one that the filled pixels have."""
    height, width = labels.shape
    belongs = np.zeros(count, np.uint8)
    for y in range(height):
        for x in range(width):
            if filled[y, x] > 0:
                belongs[labels[y, x]] = 1
    belongs[0] = 0
    found = np.empty((height, width), np.uint8)
    for y in range(height):
        for x in range(width):
            found[y, x] = belongs[labels[y, x]]
    return found
