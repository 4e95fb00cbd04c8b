"""Marks the pixels that an edge crosses; only those need more than the light at their centre.

The search walks along the edges, not over the picture, so that a needle thinner than a pixel is found too. Lines in
which two bodies pass through each other are not mesh edges: there the sign of the difference of the bodies' depths
changes between neighbouring pixels' centres.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from synth.draw.depth import NOTHING

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Bools = NDArray[np.bool_]

_CLOSE = 1e-6
"""An edge this close to a pixel counts as crossing it, px."""
_BEHIND = 1e-9
"""Relative difference of 1/depth that counts as rounding."""


@njit(
    "(int32[:, ::1], float64[:, ::1], int32[::1], int64, int64, int32, float64)",
    cache=True,
    error_model="numpy",
    forceinline=True,
)
def _visible(nearest: Ints, depths: Floats, part: Ints, row: int, x: int, mine: int, closest: float) -> bool:
    for v in range(max(row - 1, 0), min(row + 2, nearest.shape[0])):
        for u in range(max(x - 1, 0), min(x + 2, nearest.shape[1])):
            # where there is nothing, the depth is 0
            if depths[v, u] <= closest or part[nearest[v, u]] == mine:
                return True
    return False


@njit(
    "(int32[:, ::1], int32[:, ::1], boolean[::1], boolean[::1], int32[::1], float64[:, ::1], float64[::1], "
    "boolean, int32[:, ::1], float64[:, ::1], int64, int64, int32[:, ::1], boolean[:, ::1])",
    cache=True,
    error_model="numpy",
)
def mark_edges(
    edges: Ints,
    sides: Ints,
    sharp: Bools,
    front: Bools,
    part: Ints,
    pixels: Floats,
    inverse_depth: Floats,
    every: bool,
    nearest: Ints,
    depths: Floats,
    margin: int,
    first: int,
    spans: Ints,
    marked: Bools,
) -> None:
    """Mark the pixels crossed by an edge that may be visible there.

    An edge is hidden in a pixel if all neighbours of the pixel show something nearer and of another part, because the
    neighbours lie on both sides of the edge. A nearer surface that covers only part of the pixel has an edge there too.

    Parameters
    ----------
    edges, sides, sharp : ndarray
        Of `Surface`.
    front : ndarray
        (m,), whether a triangle faces the camera.
    part : ndarray
        (m,), their parts.
    pixels, inverse_depth : ndarray
        (n, 2) and (n,), of the vertices.
    every : bool
        Whether every edge counts, not only those with a discontinuity of the picture.
    nearest, depths : ndarray
        (rows, width), `synth.draw.depth.find_nearest`.
    margin : int
        Rows of `nearest` above those of `marked`.
    first : int
        Row of the picture that is the first one of `marked`.
    spans : ndarray
        (rows, 2), the columns in which to look for edges in each row: from the first to before the second.
    marked : ndarray
        (rows, width), set where crossed.
    """
    rows, width = marked.shape
    # few edges count: a list of them, made without branches, takes less time than a decision at each
    chosen, count = np.empty(len(edges), np.int32), 0
    for e in range(len(edges)):
        here, there = front[sides[e, 0]], (sides[e, 1] >= 0) & front[sides[e, 1]]
        chosen[count] = e
        count += (here | there) & (every | sharp[e] | (here != there))
    for e in chosen[:count]:
        one = sides[e, 0]
        a, b = edges[e, 0], edges[e, 1]
        if pixels[a, 1] > pixels[b, 1]:
            a, b = b, a
        xa, ya, xb, yb = pixels[a, 0], pixels[a, 1], pixels[b, 0], pixels[b, 1]
        if yb < first - 0.5 or ya > first + rows - 0.5:
            continue
        qa, qb = inverse_depth[a], inverse_depth[b]
        across = 1.0 / (yb - ya) if yb > ya else 0.0
        top = max(int(np.floor(ya + 0.5 - _CLOSE)), first)
        bottom = min(int(np.floor(yb + 0.5 + _CLOSE)), first + rows - 1)
        for row in range(top, bottom + 1):
            # the part of the edge within this row of pixels, as fractions of its length
            begin = min(max((row - 0.5 - ya) * across, 0.0), 1.0)
            end = min(max((row + 0.5 - ya) * across, 0.0), 1.0) if yb > ya else 1.0
            x0, x1 = xa + begin * (xb - xa), xa + end * (xb - xa)
            closest = max(qa + begin * (qb - qa), qa + end * (qb - qa)) * (1.0 + _BEHIND)
            left = max(int(np.floor(max(min(x0, x1), -1.0) + 0.5 - _CLOSE)), spans[row - first, 0])
            right = min(int(np.floor(min(max(x0, x1), width) + 0.5 + _CLOSE)), spans[row - first, 1] - 1)
            for x in range(left, right + 1):
                if not marked[row - first, x]:
                    marked[row - first, x] = _visible(
                        nearest, depths, part, row - first + margin, x, part[one], closest
                    )


@njit("(float64[:, ::1], int32, int32, int64, int64, int64, int64)", cache=True, error_model="numpy", forceinline=True)
def _pass(shapes: Floats, one: int, two: int, x: int, y: int, u: int, v: int) -> bool:
    """Return whether triangle one is in front of triangle two at (x, y) and behind it at (u, v)."""
    gx, gy, q0 = shapes[one, 6] - shapes[two, 6], shapes[one, 7] - shapes[two, 7], shapes[one, 8] - shapes[two, 8]
    return gx * x + gy * y + q0 > 0.0 and gx * u + gy * v + q0 < 0.0


@njit("(boolean[:, ::1], int64, int64)", cache=True, error_model="numpy", forceinline=True)
def _mark(marked: Bools, row: int, x: int) -> None:
    if 0 <= row < marked.shape[0]:
        marked[row, x] = True


@njit(
    "(int32[:, ::1], int32[::1], float64[:, ::1], int64, int64, int32[:, ::1], boolean[:, ::1])",
    cache=True,
    error_model="numpy",
)
def mark_passages(
    nearest: Ints, part: Ints, shapes: Floats, margin: int, first: int, spans: Ints, marked: Bools
) -> None:
    """Mark neighbouring pixels between whose centres two parts pass through each other.

    Parameters
    ----------
    nearest, part, margin, first, marked
        As in `mark_edges`.
    spans : ndarray
        (rows, 2), as in `mark_edges`, for the rows of `nearest`. Between pixels outside a few may be marked, too.
    shapes : ndarray
        (m, 11), `synth.draw.depth.lay_planes`.
    """
    total, width = nearest.shape
    upper, lower = np.empty(width, np.int32), np.empty(width, np.int32)
    for y in range(total):
        below = min(y + 1, total - 1)
        begin = max(min(spans[y, 0], spans[below, 0]) - 1, 0)
        end = min(max(spans[y, 1], spans[below, 1]) + 1, width)
        for x in range(max(begin - 1, 0), min(end + 1, width)):
            upper[x], lower[x] = part[nearest[y, x]], part[nearest[below, x]]
        for x in range(begin, end):
            mine, left, right = upper[x], max(x - 1, 0), min(x + 1, width - 1)
            same = mine == upper[right]
            same &= mine == lower[left]
            same &= mine == lower[x]
            same &= mine == lower[right]
            if same:
                continue
            for v, u in ((y, right), (below, left), (below, x), (below, right)):
                one, two = nearest[y, x], nearest[v, u]
                if one == NOTHING or two == NOTHING or part[one] == part[two]:
                    continue
                if _pass(shapes, one, two, x, y - margin + first, u, v - margin + first):
                    _mark(marked, y - margin, x)
                    _mark(marked, v - margin, u)
