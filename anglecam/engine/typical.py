"""What a pixel usually shows in many pictures, and how far it is usually off."""

from __future__ import annotations

import numpy as np
from numba import njit

from anglecam.engine.target import Picture

_MAD2 = 1.4826**2
"""Variance of normal values over the squared median of their magnitudes."""


def median_and_variance(pictures: Picture) -> tuple[Picture, Picture]:
    """Return the median (…) of pictures and the robust variance about it.

    Parameters
    ----------
    pictures : ndarray
        (m, …) grey levels, NaN where they are unknown.

    Returns
    -------
    median, variance : ndarray
        (…) grey levels, and grey levels²: by the median of the distances; NaN where no picture is known.
    """
    columns = np.ascontiguousarray(pictures.reshape(len(pictures), -1).T)
    columns.sort(axis=-1)  # NaN comes last
    median, variance = _of_ordered(columns)
    return median.reshape(pictures.shape[1:]), variance.reshape(pictures.shape[1:])


@njit("UniTuple(float32[::1], 2)(float32[:, ::1])", cache=True, nogil=True)
def _of_ordered(ordered):  # type: ignore[no-untyped-def]
    """Return medians (n,) of ordered values (n, m), and the variance by the median of the distances from them.

    On either side of the median the values are in the order of their distance; so the nearest half is found by going
    outwards.
    """
    median, variance = np.full(len(ordered), np.nan, np.float32), np.full(len(ordered), np.nan, np.float32)
    for i in range(len(ordered)):
        count = ordered.shape[1]
        while count > 0 and np.isnan(ordered[i, count - 1]):
            count -= 1
        if count == 0:
            continue
        middle = np.float32(0.5) * (ordered[i, (count - 1) // 2] + ordered[i, count // 2])
        above = count // 2
        below, far, before = above - 1, np.float32(0.0), np.float32(0.0)
        for _ in range(count // 2 + 1):
            before = far
            down = middle - ordered[i, below] if below >= 0 else np.float32(np.inf)
            up = ordered[i, above] - middle if above < count else np.float32(np.inf)
            if down < up:
                far, below = down, below - 1
            else:
                far, above = up, above + 1
        deviation = far if count % 2 else np.float32(0.5) * (before + far)
        median[i], variance[i] = middle, np.float32(_MAD2) * deviation * deviation
    return median, variance
