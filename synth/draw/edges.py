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


@njit(cache=True, error_model="numpy")
def mark_edges(
    edges: Ints,
    sides: Ints,
    sharp: Bools,
    front: Bools,
    part: Ints,
    pixels: Floats,
    inverse_depth: Floats,
    every: bool,
    owner: Ints,
    depths: Floats,
    margin: int,
    first: int,
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
    owner, depths : ndarray
        (rows, width), `synth.draw.depth.find_nearest`.
    margin : int
        Rows of `owner` above those of `marked`.
    first : int
        Row of the picture that is the first one of `marked`.
    marked : ndarray
        (rows, width), set where crossed.
    """
    rows, width = marked.shape
    for e in range(len(edges)):
        one, two = sides[e, 0], sides[e, 1]
        here, there = front[one], two >= 0 and front[two]
        if not (here or there) or not (every or sharp[e] or here != there):
            continue
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
            left = max(int(np.floor(max(min(x0, x1), -1.0) + 0.5 - _CLOSE)), 0)
            right = min(int(np.floor(min(max(x0, x1), width) + 0.5 + _CLOSE)), width - 1)
            for x in range(left, right + 1):
                if not marked[row - first, x]:
                    marked[row - first, x] = _visible(owner, depths, row - first + margin, x, part[one], closest)


@njit(cache=True, error_model="numpy", forceinline=True)
def _visible(owner: Ints, depths: Floats, row: int, x: int, mine: int, closest: float) -> bool:
    for v in range(max(row - 1, 0), min(row + 2, owner.shape[0])):
        for u in range(max(x - 1, 0), min(x + 2, owner.shape[1])):
            if depths[v, u] <= closest or owner[v, u] == mine:
                return True
    return False


@njit(cache=True, error_model="numpy")
def mark_passages(nearest: Ints, owner: Ints, planes: Floats, margin: int, first: int, marked: Bools) -> None:
    """Mark neighbouring pixels between whose centres two parts pass through each other.

    Parameters
    ----------
    nearest, owner, margin, first, marked
        As in `mark_edges`.
    planes : ndarray
        (k, 4, 3), `lay_planes`.
    """
    total, width = nearest.shape
    for y in range(total):
        below = min(y + 1, total - 1)
        for x in range(width):
            mine, left, right = owner[y, x], max(x - 1, 0), min(x + 1, width - 1)
            same = mine == owner[y, right]
            same &= mine == owner[below, left]
            same &= mine == owner[below, x]
            same &= mine == owner[below, right]
            if same:
                continue
            for v, u in ((y, right), (below, left), (below, x), (below, right)):
                one, two = nearest[y, x], nearest[v, u]
                if mine == owner[v, u] or one == NOTHING or two == NOTHING:
                    continue
                if _pass(planes, one, two, x, y - margin + first, u, v - margin + first):
                    _mark(marked, y - margin, x)
                    _mark(marked, v - margin, u)


@njit(cache=True, error_model="numpy", forceinline=True)
def _pass(planes: Floats, one: int, two: int, x: int, y: int, u: int, v: int) -> bool:
    """Return whether triangle one is in front of triangle two at (x, y) and behind it at (u, v)."""
    gx = planes[one, 0, 0] - planes[two, 0, 0]
    gy = planes[one, 0, 1] - planes[two, 0, 1]
    q0 = planes[one, 0, 2] - planes[two, 0, 2]
    return gx * x + gy * y + q0 > 0.0 and gx * u + gy * v + q0 < 0.0


@njit(cache=True, error_model="numpy", forceinline=True)
def _mark(marked: Bools, row: int, x: int) -> None:
    if 0 <= row < marked.shape[0]:
        marked[row, x] = True
