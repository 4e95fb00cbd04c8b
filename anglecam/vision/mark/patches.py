"""Connected patches of a map that lie above a level.

They are those of OpenCV's ``connectedComponentsWithStats``, in its order. OpenCV visits every pixel of the background
several times, which takes most of the time of a search. Here each row is divided into runs of pixels above the level,
and runs of neighbouring rows are joined. Most strips of a row have no pixel above any level and are passed over.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from anglecam.data.typing import Floats

_STRIP_PX = 32
"""Length of a strip, a part of a row."""
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


def find_patches(values: NDArray[Any], levels: Sequence[float]) -> list[Patches]:
    """Find the patches of pixels above each of several levels; pixels that touch at a corner are connected.

    Parameters
    ----------
    values : ndarray
        (h, w) float32.
    levels : sequence of float
        A pixel belongs to a patch if its value is larger.

    Returns
    -------
    list of Patches
        For each level all of them, also single pixels.
    """
    highest = _highest_of_strips(values)
    found = []
    for level in levels:
        table, sums = _joined_runs(values, highest, np.float32(level))
        order = np.argsort(table[:, _BLOCK])  # no two patches begin in one block
        table, sums = table[order], sums[order]
        box = np.column_stack([table[:, :_RIGHT], table[:, _RIGHT:_AREA] - table[:, :_RIGHT]])
        area = table[:, _AREA]
        found.append(Patches(box, area.astype(np.int32), sums / area[:, None], table[:, _FIRST_X : _FIRST_Y + 1]))
    return found


@njit(
    "(float32[:, ::1],)",
    cache=True,
    nogil=True,
    fastmath={"nnan", "nsz"},  # so that several pixels are compared at once
)
def _highest_of_strips(values):  # type: ignore[no-untyped-def]
    """Return the highest value of each strip of each row."""
    height, width = values.shape
    strips = (width + _STRIP_PX - 1) // _STRIP_PX
    highest = np.empty((height, strips), values.dtype)
    for y in range(height):
        for k in range(strips):
            strip = values[y, k * _STRIP_PX : min((k + 1) * _STRIP_PX, width)]
            most = strip[0]
            for x in range(len(strip)):
                most = max(strip[x], most)
            highest[y, k] = most
    return highest


@njit("(int32[::1], int64)", cache=True, nogil=True)
def _root(parent, k):  # type: ignore[no-untyped-def]
    """Return the first run of a patch; shorten the way to it."""
    while parent[k] != k:
        parent[k] = parent[parent[k]]
        k = parent[k]
    return k


@njit("(int32[::1], int64, int64)", cache=True, nogil=True)
def _join(parent, one, other):  # type: ignore[no-untyped-def]
    a, b = _root(parent, one), _root(parent, other)
    if a < b:
        parent[b] = a
    else:
        parent[a] = b


@njit("(float32[:, ::1], float32[:, ::1], float32)", cache=True, nogil=True)
def _joined_runs(values, highest, level):  # type: ignore[no-untyped-def]
    """Return a row for each patch, in the order of their first pixels, and the sums of its columns and rows."""
    height, width = values.shape
    most = height * ((width + 1) // 2)
    start, stop, parent = np.empty(most, np.int32), np.empty(most, np.int32), np.empty(most, np.int32)
    row_begins = np.empty(height + 1, np.int64)
    runs = 0
    for y in range(height):
        row_begins[y] = runs
        row = values[y]
        inside = False
        for k in range(highest.shape[1]):
            left, right = k * _STRIP_PX, min((k + 1) * _STRIP_PX, width)
            if not highest[y, k] > level:
                right = left + 1 if inside else left  # a run ends at the strip's first pixel
            for x in range(left, right):
                if (row[x] > level) != inside:
                    if inside:
                        stop[runs] = x
                        runs += 1
                    else:
                        start[runs] = x
                    inside = not inside
        if inside:
            stop[runs] = width
            runs += 1
        begins = row_begins[y]
        above = row_begins[y - 1] if y else begins
        for run in range(begins, runs):
            parent[run] = run
            # runs of the row above that end before this one begins touch no later one
            while above < begins and stop[above] < start[run]:
                above += 1
            other = above
            while other < begins and start[other] <= stop[run]:
                _join(parent, other, run)
                other += 1
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
            p, begin, end = which[k], np.int64(start[k]), np.int64(stop[k])
            if table[p, _AREA] == 0:
                table[p, _TOP], table[p, _FIRST_X], table[p, _FIRST_Y] = y, begin, y
            table[p, _LEFT] = min(table[p, _LEFT], begin)
            table[p, _RIGHT] = max(table[p, _RIGHT], end)
            table[p, _BOTTOM] = y + 1
            table[p, _AREA] += end - begin
            table[p, _BLOCK] = min(table[p, _BLOCK], (y // 2) * width + begin // 2)
            sums[p, 0] += (begin + end - 1) * (end - begin) // 2
            sums[p, 1] += y * (end - begin)
    return table, sums
