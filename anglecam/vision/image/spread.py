"""The pixel-wise median of a few pictures of bytes and their robust spread about it, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

_BLOCK = 1024
"""Pixels that are sorted at once: of so many, all pictures fit into a processor's first cache."""
_OF_NORMAL = np.float32(1.4826)
"""Standard deviation of a normal distribution over the median of its absolute deviations."""


def median_and_spread(pile: NDArray[np.uint8]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the median over the first axis and the robust standard deviation from it.

    Parameters
    ----------
    pile : ndarray
        (n, …) bytes.

    Returns
    -------
    middle, spread : ndarray
        (…) median, and 1.4826 times the median of the absolute differences from it.
    """
    doubled, deviation = _doubled_medians(pile.reshape(len(pile), -1))
    middle, spread = doubled * np.float32(0.5), _OF_NORMAL * (deviation * np.float32(0.25))
    return middle.reshape(pile.shape[1:]), spread.reshape(pile.shape[1:])


@njit(["(uint8[::1], int64, int64)", "(int16[::1], int64, int64)"], cache=True)
def _sort_upper(rows, count, pixels):  # type: ignore[no-untyped-def]
    """Sort the upper half of each column, the middle included, by a bubble sort that stops there.

    The rows begin at multiples of the block's size in one array, so that the compiler knows that none overlap. Of two
    types, because twice as many bytes are compared at once as numbers of 16 bits.
    """
    for last in range(count - 1, max((count - 1) // 2, 1) - 1, -1):
        for i in range(last):
            at = i * _BLOCK
            for k in range(pixels):
                low, high = rows[at + k], rows[at + k + _BLOCK]
                rows[at + k], rows[at + k + _BLOCK] = min(low, high), max(low, high)


@njit("(uint8[:, ::1],)", cache=True, nogil=True)
def _doubled_medians(pile):  # type: ignore[no-untyped-def]
    """Return twice the medians (m,), and four times the medians of the absolute differences from them."""
    count, size = pile.shape
    lower, upper = (count - 1) // 2 * _BLOCK, count // 2 * _BLOCK
    doubled, deviation = np.empty(size, np.float32), np.empty(size, np.float32)
    rows, apart = np.empty(count * _BLOCK, np.uint8), np.empty((count + 1) * _BLOCK, np.int16)
    twice = count * _BLOCK  # where these medians are, behind the pictures
    for start in range(0, size, _BLOCK):
        pixels = min(_BLOCK, size - start)
        for i in range(count):
            for k in range(pixels):
                rows[i * _BLOCK + k] = pile[i, start + k]
                apart[i * _BLOCK + k] = pile[i, start + k]
        _sort_upper(rows, count, pixels)
        for k in range(pixels):
            apart[twice + k] = rows[lower + k] + rows[upper + k]
            doubled[start + k] = apart[twice + k]
        for i in range(count):
            at = i * _BLOCK
            for k in range(pixels):
                value, middle = np.int16(apart[at + k] + apart[at + k]), apart[twice + k]
                apart[at + k] = max(value, middle) - min(value, middle)
        _sort_upper(apart, count, pixels)
        for k in range(pixels):
            apart[twice + k] = apart[lower + k] + apart[upper + k]
            deviation[start + k] = apart[twice + k]
    return doubled, deviation
