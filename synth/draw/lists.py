"""Lists, for every pixel that an edge crosses, the triangles that reach into it.

The lists are found triangle by triangle and read pixel by pixel. They are therefore sorted by pixel, so that those who
read them find each list in one place.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

_ON_LINE = 1e-9
"""A triangle that reaches less than this into a pixel is not listed, px."""
_BLOCK = 3
"""Binary logarithm of the side of the blocks of pixels in which edges are looked for first."""


@njit("(boolean[:, ::1],)", cache=True, error_model="numpy")
def number(marked: NDArray[np.bool_]) -> tuple[Ints, Ints]:
    """Count the marked pixels row by row.

    Parameters
    ----------
    marked : ndarray
        (rows, width).

    Returns
    -------
    tuple of ndarray
        (s, 2), row and column of each; and (rows, width + 1), the count before each pixel and each row's end.
    """
    rows, width = marked.shape
    before = np.empty((rows, width + 1), np.int32)
    count = 0
    for row in range(rows):
        for x in range(width):
            before[row, x] = count
            count += marked[row, x]
        before[row, width] = count
    places = np.empty((count, 2), np.int32)
    for row in range(rows):
        if before[row, 0] == before[row, width]:
            continue
        for x in range(width):
            if marked[row, x]:
                places[before[row, x], 0], places[before[row, x], 1] = row, x
    return places, before


@njit("(float64, float64, float64, float64)", cache=True, error_model="numpy", forceinline=True)
def _side(xa: float, ya: float, xb: float, yb: float) -> tuple[float, float, float]:
    """Return (a, b, c): a·x + b·y + c is positive if the pixel at (x, y) reaches to the inner side of an edge."""
    a, b = yb - ya, xa - xb
    return a, b, (0.5 - _ON_LINE) * (abs(a) + abs(b)) - a * xa - b * ya


@njit("(int32[::1], float64[:, ::1], int32[:, ::1], int32[:, ::1], int64)", cache=True, error_model="numpy")
def gather(seen: Ints, shapes: Floats, places: Ints, before: Ints, first: int) -> tuple[Ints, Ints, Floats]:
    """List for each marked pixel the triangles that reach into it.

    Parameters
    ----------
    seen, shapes : ndarray
        As in `synth.draw.depth.lay_planes`.
    places, before : ndarray
        `number`.
    first : int
        Row of the picture that is the first one of `before`.

    Returns
    -------
    tuple of ndarray
        (s + 1,), where the list of each marked pixel begins, and the end of the last one; (n,), the triangles of one
        list after another, ascending as in `seen`; and (n, 2), bounds of each triangle's 1/depth in the pixel, the
        greater first.
    """
    rows, width = before.shape[0], before.shape[1] - 1
    found = np.empty((8 * len(places) + 64, 2), np.int32)
    starts, count = np.zeros(len(places) + 1, np.int32), 0
    # most triangles are far from every such pixel, as a coarser picture shows
    blocks = np.zeros(((rows >> _BLOCK) + 1, (width >> _BLOCK) + 1), np.bool_)
    for slot in range(len(places)):
        blocks[places[slot, 0] >> _BLOCK, places[slot, 1] >> _BLOCK] = True
    for t in seen:
        xa, ya, xb, yb, xc, yc = shapes[t, 0], shapes[t, 1], shapes[t, 2], shapes[t, 3], shapes[t, 4], shapes[t, 5]
        left, right = max(int(np.floor(min(xa, xb, xc) + 0.5)), 0), min(int(np.floor(max(xa, xb, xc) + 0.5)), width - 1)
        if left > right:
            continue
        top = max(int(np.floor(min(ya, yb, yc) + 0.5)), first) - first
        bottom = min(int(np.floor(max(ya, yb, yc) + 0.5)), first + rows - 1) - first
        crossed = False
        for row in range(top >> _BLOCK, (bottom >> _BLOCK) + 1):
            for x in range(left >> _BLOCK, (right >> _BLOCK) + 1):
                crossed |= blocks[row, x]
        if not crossed:
            continue
        a0, b0, c0 = _side(xa, ya, xb, yb)
        a1, b1, c1 = _side(xb, yb, xc, yc)
        a2, b2, c2 = _side(xc, yc, xa, ya)
        for row in range(top, bottom + 1):
            begin, end = before[row, left], before[row, right + 1]
            if count + end - begin > len(found):
                found = np.concatenate((found, found))
            y = row + first
            for slot in range(begin, end):
                # written for every pixel, and kept if the triangle reaches into it: a branch would take longer
                x = places[slot, 1]
                inside = a0 * x + b0 * y + c0 > 0.0
                inside &= a1 * x + b1 * y + c1 > 0.0
                inside &= a2 * x + b2 * y + c2 > 0.0
                found[count, 0], found[count, 1] = slot, t
                starts[slot + 1] += inside
                count += inside
    for slot in range(len(places)):
        starts[slot + 1] += starts[slot]
    listed, depths, ends = np.empty(count, np.int32), np.empty((count, 2)), starts[:-1].copy()
    for n in range(count):
        slot, t = found[n, 0], found[n, 1]
        gx, gy = shapes[t, 6], shapes[t, 7]
        middle = gx * places[slot, 1] + gy * (places[slot, 0] + first) + shapes[t, 8]
        reach = 0.5 * (abs(gx) + abs(gy))
        at = ends[slot]
        listed[at] = t
        depths[at, 0], depths[at, 1] = min(middle + reach, shapes[t, 9]), max(middle - reach, shapes[t, 10])
        ends[slot] += 1
    return starts, listed, depths
