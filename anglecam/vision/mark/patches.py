"""Connected patches of a map that lie above a level.

They are those of OpenCV's ``connectedComponentsWithStats``, in its order. OpenCV visits every pixel of the background
several times, which takes most of the time of a search. Here each row is divided into runs of pixels above the level,
and runs of neighbouring rows are joined.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from anglecam.data.typing import Floats

_LEFT, _TOP, _RIGHT, _BOTTOM, _AREA, _FIRST_X, _FIRST_Y, _BLOCK = range(8)
"""Columns of a patch: its box, the ends excluded, its area, its first pixel, and its first block of 2 × 2 pixels."""


@dataclass(frozen=True)
class Patches:
    """The patches of one map; arrays of length n, in the order of the blocks of 2 × 2 pixels in which they begin."""

    box_px: NDArray[np.int64]
    """(n, 4) left, top, width and height, px."""
    area: NDArray[np.int32]
    """px²."""
    centre_px: Floats
    """(n, 2) centroid of the pixels, px."""
    first_px: NDArray[np.int64]
    """(n, 2) column and row of the leftmost pixel of the highest row."""


def find_patches(values: NDArray[Any], level: float) -> Patches:
    """Find the patches of pixels above a level; pixels that touch at a corner are connected.

    Parameters
    ----------
    values : ndarray
        (h, w) float32.
    level : float
        A pixel belongs to a patch if its value is larger.

    Returns
    -------
    Patches
        All of them, also single pixels.
    """
    table, sums = _joined_runs(values, np.float32(level))
    order = np.argsort(table[:, _BLOCK])  # no two patches begin in one block
    table, sums = table[order], sums[order]
    box = np.column_stack([table[:, :_RIGHT], table[:, _RIGHT:_AREA] - table[:, :_RIGHT]])
    area = table[:, _AREA]
    return Patches(box, area.astype(np.int32), sums / area[:, None], table[:, _FIRST_X : _FIRST_Y + 1])


@njit(cache=True, nogil=True)
def _joined_runs(values, level):  # type: ignore[no-untyped-def]
    """Return a row for each patch, in the order of their first pixels, and the sums of its columns and rows."""
    height, width = values.shape
    most = height * ((width + 1) // 2)
    start, stop, parent = np.empty(most, np.int32), np.empty(most, np.int32), np.empty(most, np.int32)
    row_begins = np.empty(height + 1, np.int64)
    runs = above = 0
    for y in range(height):
        row_begins[y] = runs
        row = values[y]
        above, begins = (row_begins[y - 1] if y else 0), runs
        x = 0
        while x < width:
            if not row[x] > level:
                x += 1
                continue
            start[runs] = x
            while x < width and row[x] > level:
                x += 1
            stop[runs] = x
            parent[runs] = runs
            # runs of the row above that end before this one begins touch no later one
            while above < begins and stop[above] < start[runs]:
                above += 1
            other = above
            while other < begins and start[other] <= x:
                _join(parent, other, runs)
                other += 1
            runs += 1
    row_begins[height] = runs
    which = np.empty(runs, np.int32)
    patches = 0
    for k in range(runs):
        if parent[k] == k:
            which[k] = patches
            patches += 1
        else:
            which[k] = which[_root(parent, k)]
    table, sums = np.zeros((patches, 8), np.int64), np.zeros((patches, 2), np.int64)
    table[:, _LEFT] = width
    table[:, _BLOCK] = height * width
    for y in range(height):
        for k in range(row_begins[y], row_begins[y + 1]):
            p, left, right = which[k], np.int64(start[k]), np.int64(stop[k])
            if table[p, _AREA] == 0:
                table[p, _TOP], table[p, _FIRST_X], table[p, _FIRST_Y] = y, left, y
            table[p, _LEFT] = min(table[p, _LEFT], left)
            table[p, _RIGHT] = max(table[p, _RIGHT], right)
            table[p, _BOTTOM] = y + 1
            table[p, _AREA] += right - left
            table[p, _BLOCK] = min(table[p, _BLOCK], (y // 2) * width + left // 2)
            sums[p, 0] += (left + right - 1) * (right - left) // 2
            sums[p, 1] += y * (right - left)
    return table, sums


@njit(cache=True, nogil=True)
def _root(parent, k):  # type: ignore[no-untyped-def]
    """Return the first run of a patch; shorten the way to it."""
    while parent[k] != k:
        parent[k] = parent[parent[k]]
        k = parent[k]
    return k


@njit(cache=True, nogil=True)
def _join(parent, one, other):  # type: ignore[no-untyped-def]
    a, b = _root(parent, one), _root(parent, other)
    if a < b:
        parent[b] = a
    else:
        parent[a] = b
