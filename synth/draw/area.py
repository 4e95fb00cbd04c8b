"""Exact area coverage: the mean light of a pixel that edges cross.

The pixel is a square that is cut into convex pieces, each showing one triangle. It begins as one piece that shows
nothing. For each triangle, nearest first, every piece is cut along the triangle's three sides and, if the piece shows
a triangle already, along the line in which the two planes meet; the part inside belongs to the new triangle. In the
end each piece contributes its area times the light at its centre of mass, which is exact for affine light. The
result does not depend on the order of the triangles, only the time does, so bodies may overlap, pass through each
other, or overlap cyclically.

Sources: polygon areas in each pixel, E. Catmull, "A hidden-surface algorithm with anti-aliasing", SIGGRAPH 1978; K.
Weiler and P. Atherton, "Hidden surface removal using polygon area sorting", SIGGRAPH 1977; cutting a convex polygon, I.
Sutherland and G. Hodgman, "Reentrant polygon clipping", Comm. ACM 17, 1974.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

_NOTHING = _APART = -1
_ON_LINE = 1e-9
"""A corner this close to a line counts as on it, px; bounds the thinness of pieces and the error of areas."""
_SAME_DEPTH = 1e-9
"""Relative difference of 1/depth that counts as rounding: of two coplanar triangles the first one stays."""
_PIECES, _CORNERS = 256, 24
"""Capacity per pixel. Beyond it a piece is not divided but goes to the side on which its centre lies."""


@njit(
    "(int32, float64[:, ::1], float64, float64, int64, float64[:, :, ::1])",
    cache=True,
    error_model="numpy",
    forceinline=True,
)
def _sides(t: int, shapes: Floats, x: float, y: float, at: int, lines: Floats) -> int:
    """Write to lines[at] (a, b, c) along a triangle's sides: a·(x' − x) + b·(y' − y) + c is positive inside.

    Return their number. Sides that have all of the pixel at (x, y) on their inner side are left out.
    """
    count = 0
    for e in range(3):
        p, q = 2 * e, 2 * e + 2 if e < 2 else 0
        a, b = shapes[t, q + 1] - shapes[t, p + 1], shapes[t, p] - shapes[t, q]
        c = a * (x - shapes[t, p]) + b * (y - shapes[t, p + 1])
        lines[at, count, 0], lines[at, count, 1], lines[at, count, 2] = a, b, c
        count += c < 0.5 * (abs(a) + abs(b))
    return count


@njit("(int32, int32, int32[::1], float64[:, ::1])", cache=True, error_model="numpy", forceinline=True)
def _sort(begin: int, end: int, listed: Ints, depths: Floats) -> None:
    """Sort a pixel's triangles, nearest first; of two equal ones the earlier stays first."""
    for i in range(begin + 1, end):
        t, high, low, at = listed[i], depths[i, 0], depths[i, 1], i
        while at > begin and depths[at - 1, 0] < high:
            listed[at], depths[at, 0], depths[at, 1] = listed[at - 1], depths[at - 1, 0], depths[at - 1, 1]
            at -= 1
        listed[at], depths[at, 0], depths[at, 1] = t, high, low


@njit(
    "(int64, float64[:, :, ::1], int64, int64, float64[:, ::1], float64[:, ::1], int64)",
    cache=True,
    error_model="numpy",
    forceinline=True,
)
def _cutting(p: int, lines: Floats, at: int, sides: int, xs: Floats, ys: Floats, size: int) -> int:
    """Return which of a triangle's sides cut piece p, one bit each; below zero if one separates the two."""
    cutting, apart = 0, False
    for e in range(sides):
        a, b, c = lines[at, e, 0], lines[at, e, 1], lines[at, e, 2]
        margin = _ON_LINE * (abs(a) + abs(b))
        within = without = 0
        for i in range(size):
            distance = a * xs[p, i] + b * ys[p, i] + c
            within += distance > margin
            without += distance < -margin
        apart |= within == 0
        cutting |= (without > 0) << e
    return _APART if apart else cutting


@njit(
    "(int64, int64, int32, float64[:, ::1], float64, float64, float64[:, ::1], float64[:, ::1], int64, "
    "float64[:, :, ::1], int64, int64)",
    cache=True,
    error_model="numpy",
    forceinline=True,
)
def _ahead(
    p: int, owner: int, k: int, shapes: Floats, x: float, y: float, xs: Floats, ys: Floats, size: int,
    lines: Floats, at: int, e: int,
) -> int:  # fmt: skip
    """Return the bit of the line in which the planes of triangle k and of a piece meet, 0 if k is nearer everywhere.

    Below zero if the piece hides the triangle.
    """
    depth = shapes[owner, 6] * x + shapes[owner, 7] * y + shapes[owner, 8]
    a, b = shapes[k, 6] - shapes[owner, 6], shapes[k, 7] - shapes[owner, 7]
    c = shapes[k, 6] * x + shapes[k, 7] * y + shapes[k, 8] - depth
    least, most = np.inf, -np.inf
    for i in range(size):
        gap = a * xs[p, i] + b * ys[p, i] + c
        least, most = min(least, gap), max(most, gap)
    if most <= _SAME_DEPTH * depth:
        return _APART
    if least >= 0.0:
        return 0
    lines[at, e, 0], lines[at, e, 1], lines[at, e, 2] = a, b, c
    return 1


@njit(
    "(int64, int64, float64[:, :, ::1], int64, int64, float64[:, ::1], float64[:, ::1], int64, float64[:, ::1])",
    cache=True,
    error_model="numpy",
    forceinline=True,
)
def _cut(
    p: int, new: int, lines: Floats, at: int, e: int, xs: Floats, ys: Floats, size: int, spare: Floats
) -> tuple[int, int]:
    """Cut piece p along line e: what lies inside stays, what lies outside becomes piece `new`.

    Return the number of corners of either; with none outside, or none inside, nothing has been cut.
    """
    a, b, c = lines[at, e, 0], lines[at, e, 1], lines[at, e, 2]
    margin = _ON_LINE * (abs(a) + abs(b))
    inner = outer = 0
    total = 0.0
    for i in range(size):
        distance = a * xs[p, i] + b * ys[p, i] + c
        spare[2, i] = distance
        inner += distance > margin
        outer += distance < -margin
        total += distance
    if new == _PIECES or size + 1 > _CORNERS:
        inner, outer = size * (total > margin), size * (total < -margin)
    if outer == 0:
        return size, 0
    if inner == 0:
        return 0, size
    within = without = 0
    for i in range(size):
        j = i + 1 if i + 1 < size else 0
        here, there = spare[2, i], spare[2, j]
        x, y = xs[p, i], ys[p, i]
        # every corner is written to both pieces, and kept where it belongs: branches would take longer
        spare[0, within], spare[1, within] = x, y
        within += here >= -margin
        xs[new, without], ys[new, without] = x, y
        without += here <= margin
        crossed = ((here > margin) & (there < -margin)) | ((here < -margin) & (there > margin))
        share = here / (here - there)
        x, y = x + share * (xs[p, j] - x), y + share * (ys[p, j] - y)
        spare[0, within], spare[1, within] = x, y
        within += crossed
        xs[new, without], ys[new, without] = x, y
        without += crossed
    for i in range(within):
        xs[p, i], ys[p, i] = spare[0, i], spare[1, i]
    return within, without


@njit("(int64, float64[:, ::1], float64[:, ::1], int64)", cache=True, error_model="numpy", forceinline=True)
def _centroid(p: int, xs: Floats, ys: Floats, size: int) -> tuple[float, float, float]:
    """Return the area of a convex polygon and its centre of mass; its first corner if the area is 0."""
    x0, y0 = xs[p, 0], ys[p, 0]
    area = u = v = 0.0
    for i in range(1, size - 1):
        xa, ya, xb, yb = xs[p, i] - x0, ys[p, i] - y0, xs[p, i + 1] - x0, ys[p, i + 1] - y0
        twice = xa * yb - xb * ya
        area += twice
        u += twice * (xa + xb)
        v += twice * (ya + yb)
    if area <= 0.0:
        return 0.0, x0, y0
    return area / 2, x0 + u / (3 * area), y0 + v / (3 * area)


@njit(
    "(int32[:, ::1], int32[::1], int32[::1], float64[:, ::1], float64[:, ::1], float64[:, :, ::1], int64, "
    "float32[:, :, ::1])",
    cache=True,
    error_model="numpy",
)
def cover(
    places: Ints,
    starts: Ints,
    listed: Ints,
    depths: Floats,
    shapes: Floats,
    shades: Floats,
    first: int,
    light: NDArray[np.float32],
) -> None:
    """Compute the mean light of each marked pixel; where nothing is visible it is dark.

    Parameters
    ----------
    places : ndarray
        (s, 2), row and column of each marked pixel in `light`.
    starts, listed, depths : ndarray
        `synth.draw.lists.gather`; each list is sorted by depth.
    shapes, shades : ndarray
        `synth.draw.depth.lay_planes`.
    first : int
        Row of the picture that is the first one of `light`.
    light : ndarray
        (rows, width, 3), written at `places`.
    """
    # one corner more than fits: `_cut` writes before it knows whether a corner stays
    xs, ys = np.empty((_PIECES, _CORNERS + 1)), np.empty((_PIECES, _CORNERS + 1))
    sizes, owners, farthest = np.empty(_PIECES, np.int64), np.empty(_PIECES, np.int64), np.empty(_PIECES)
    longest = 0
    for slot in range(len(places)):
        longest = max(longest, starts[slot + 1] - starts[slot])
    lines, sides, spare = np.empty((longest, 4, 3)), np.empty(longest, np.int64), np.empty((3, _CORNERS + 1))
    for slot in range(len(places)):
        x, y = float(places[slot, 1]), float(places[slot, 0] + first)
        begin, end = starts[slot], starts[slot + 1]
        _sort(begin, end, listed, depths)
        # fetched at once, before any decision, the triangles need not be waited for one by one
        for i in range(begin, end):
            sides[i - begin] = _sides(listed[i], shapes, x, y, i - begin, lines)
        xs[0, 0], xs[0, 1], xs[0, 2], xs[0, 3] = -0.5, 0.5, 0.5, -0.5
        ys[0, 0], ys[0, 1], ys[0, 2], ys[0, 3] = -0.5, -0.5, 0.5, 0.5
        sizes[0], owners[0], farthest[0], pieces = 4, _NOTHING, -np.inf, 1
        for i in range(begin, end):
            k, at, hidden = listed[i], i - begin, True
            for p in range(pieces):
                if depths[i, 0] <= farthest[p]:
                    continue
                hidden = False
                cutting = _cutting(p, lines, at, sides[at], xs, ys, sizes[p])
                if cutting >= 0 and owners[p] != _NOTHING:
                    ahead = _ahead(p, owners[p], k, shapes, x, y, xs, ys, sizes[p], lines, at, sides[at])
                    cutting = cutting | ahead << sides[at] if ahead >= 0 else _APART
                for e in range(sides[at] + 1):
                    if cutting < 0 or not cutting >> e & 1:
                        continue
                    within, without = _cut(p, pieces, lines, at, e, xs, ys, sizes[p], spare)
                    if within == 0:
                        cutting = _APART
                    elif without > 0:
                        sizes[p], sizes[pieces] = within, without
                        owners[pieces], farthest[pieces] = owners[p], farthest[p]
                        pieces += 1
                if cutting >= 0:
                    owners[p], farthest[p] = k, depths[i, 1]
            if hidden:
                break  # and so are all that follow
        red = green = blue = 0.0
        for p in range(pieces):
            k = owners[p]
            if k == _NOTHING:
                continue
            area, u, v = _centroid(p, xs, ys, sizes[p])
            u, v = u + x, v + y
            weight = area / (shapes[k, 6] * u + shapes[k, 7] * v + shapes[k, 8])
            red += weight * (shades[k, 0, 0] * u + shades[k, 0, 1] * v + shades[k, 0, 2])
            green += weight * (shades[k, 1, 0] * u + shades[k, 1, 1] * v + shades[k, 1, 2])
            blue += weight * (shades[k, 2, 0] * u + shades[k, 2, 1] * v + shades[k, 2, 2])
        light[places[slot, 0], places[slot, 1], 0] = red
        light[places[slot, 0], places[slot, 1], 1] = green
        light[places[slot, 0], places[slot, 1], 2] = blue
