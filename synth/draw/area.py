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

_NOTHING = -1
_ON_LINE = 1e-9
"""A corner this close to a line counts as on it, px; bounds the thinness of pieces and the error of areas."""
_SAME_DEPTH = 1e-9
"""Relative difference of 1/depth that counts as rounding: of two coplanar triangles the first one stays."""
_PIECES, _CORNERS = 256, 24
"""Capacity per pixel. Beyond it a piece is not divided but goes to the side on which its centre lies."""


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
def gather(
    seen: Ints, faces: Ints, pixels: Floats, places: Ints, before: Ints, first: int, heads: Ints
) -> tuple[Ints, Ints]:
    """List for each marked pixel the triangles that reach into it.

    Parameters
    ----------
    seen, faces, pixels : ndarray
        (k,) triangles that look at the camera, (m, 3) and (n, 2).
    places, before : ndarray
        `number`.
    first : int
        Row of the picture that is the first one of `before`.
    heads : ndarray
        (s,), written: where each marked pixel's list begins, below zero for an empty one.

    Returns
    -------
    tuple of ndarray
        Entries of the lists: index into `seen`, and where the list goes on, below zero at its end.
    """
    rows, width = before.shape[0], before.shape[1] - 1
    heads[:] = _NOTHING
    triangles, following = np.empty(8 * len(heads) + 64, np.int32), np.empty(8 * len(heads) + 64, np.int32)
    count = 0
    lines = np.empty((3, 3))
    for k in range(len(seen)):
        a, b, c = faces[seen[k], 0], faces[seen[k], 1], faces[seen[k], 2]
        xs, ys = (pixels[a, 0], pixels[b, 0], pixels[c, 0]), (pixels[a, 1], pixels[b, 1], pixels[c, 1])
        left, right = max(int(np.floor(min(xs) + 0.5)), 0), min(int(np.floor(max(xs) + 0.5)), width - 1)
        if left > right:
            continue
        top = max(int(np.floor(min(ys) + 0.5)), first) - first
        bottom = min(int(np.floor(max(ys) + 0.5)), first + rows - 1) - first
        ready = False
        for row in range(top, bottom + 1):
            for slot in range(before[row, left], before[row, right + 1]):
                if not ready:
                    _sides(seen[k], faces, pixels, 0.0, 0.0, lines)
                    ready = True
                reaches, x = True, places[slot, 1]
                for e in range(3):
                    reach = (0.5 - _ON_LINE) * (abs(lines[e, 0]) + abs(lines[e, 1]))
                    reaches &= lines[e, 0] * x + lines[e, 1] * (row + first) + lines[e, 2] + reach > 0.0
                if not reaches:
                    continue
                if count == len(triangles):
                    triangles, following = _longer(triangles), _longer(following)
                triangles[count], following[count] = k, heads[slot]
                heads[slot] = count
                count += 1
    return triangles[:count], following[:count]


@njit(cache=True, error_model="numpy")
def _longer(values: Ints) -> Ints:
    twice = np.empty(2 * len(values), np.int32)
    twice[: len(values)] = values
    return twice


@njit(cache=True, error_model="numpy", forceinline=True)
def _sides(triangle: int, faces: Ints, pixels: Floats, x: float, y: float, lines: Floats) -> None:
    """Write the lines (a, b, c) along a triangle's sides: a·(x' − x) + b·(y' − y) + c is positive inside."""
    for e in range(3):
        p, q = faces[triangle, e], faces[triangle, e + 1 if e < 2 else 0]
        a, b = pixels[q, 1] - pixels[p, 1], pixels[p, 0] - pixels[q, 0]
        lines[e, 0], lines[e, 1], lines[e, 2] = a, b, a * (x - pixels[p, 0]) + b * (y - pixels[p, 1])


@njit(cache=True, error_model="numpy")
def cover(
    places: Ints,
    heads: Ints,
    triangles: Ints,
    following: Ints,
    seen: Ints,
    faces: Ints,
    pixels: Floats,
    inverse_depth: Floats,
    planes: Floats,
    first: int,
    light: NDArray[np.float32],
) -> None:
    """Compute the mean light of each marked pixel; where nothing is visible it is dark.

    Parameters
    ----------
    places : ndarray
        (s, 2), row and column of each marked pixel in `light`.
    heads, triangles, following : ndarray
        `gather`.
    seen, faces, pixels, inverse_depth, planes : ndarray
        As in `synth.draw.depth.lay_planes`.
    first : int
        Row of the picture that is the first one of `light`.
    light : ndarray
        (rows, width, 3), written at `places`.
    """
    xs, ys = np.empty((_PIECES, _CORNERS)), np.empty((_PIECES, _CORNERS))
    sizes, owners, farthest = np.empty(_PIECES, np.int64), np.empty(_PIECES, np.int64), np.empty(_PIECES)
    lines, spare = np.empty((4, 3)), np.empty((3, _CORNERS))
    listed, upper, lower = np.empty(len(triangles), np.int64), np.empty(len(triangles)), np.empty(len(triangles))
    for slot in range(len(places)):
        x, y = float(places[slot, 1]), float(places[slot, 0] + first)
        count = _sort(heads[slot], triangles, following, seen, faces, inverse_depth, planes, x, y, listed, upper, lower)
        xs[0, 0], xs[0, 1], xs[0, 2], xs[0, 3] = -0.5, 0.5, 0.5, -0.5
        ys[0, 0], ys[0, 1], ys[0, 2], ys[0, 3] = -0.5, -0.5, 0.5, 0.5
        sizes[0], owners[0], farthest[0], pieces = 4, _NOTHING, -np.inf, 1
        for i in range(count):
            k, hidden = listed[i], True
            _sides(seen[k], faces, pixels, x, y, lines)
            for p in range(pieces):
                if upper[i] <= farthest[p]:
                    continue
                hidden = False
                if _apart(p, lines, xs, ys, sizes[p]):
                    continue
                bounds = _bounds(p, owners[p], k, planes, x, y, xs, ys, sizes[p], lines)
                if bounds > 0:
                    pieces = _take(p, k, lower[i], lines, bounds, xs, ys, sizes, owners, farthest, pieces, spare)
            if hidden:
                break  # and so are all that follow
        red = green = blue = 0.0
        for p in range(pieces):
            k = owners[p]
            if k == _NOTHING:
                continue
            area, u, v = _centroid(p, xs, ys, sizes[p])
            u, v = u + x, v + y
            weight = area / (planes[k, 0, 0] * u + planes[k, 0, 1] * v + planes[k, 0, 2])
            red += weight * (planes[k, 1, 0] * u + planes[k, 1, 1] * v + planes[k, 1, 2])
            green += weight * (planes[k, 2, 0] * u + planes[k, 2, 1] * v + planes[k, 2, 2])
            blue += weight * (planes[k, 3, 0] * u + planes[k, 3, 1] * v + planes[k, 3, 2])
        light[places[slot, 0], places[slot, 1], 0] = red
        light[places[slot, 0], places[slot, 1], 1] = green
        light[places[slot, 0], places[slot, 1], 2] = blue


@njit(cache=True, error_model="numpy", forceinline=True)
def _sort(
    head: int, triangles: Ints, following: Ints, seen: Ints, faces: Ints, inverse_depth: Floats, planes: Floats,
    x: float, y: float, listed: NDArray[np.int64], upper: Floats, lower: Floats,
) -> int:  # fmt: skip
    """List a pixel's triangles, nearest first, with bounds of their 1/depth within it."""
    count = 0
    while head >= 0:
        k = triangles[head]
        a, b, c = faces[seen[k], 0], faces[seen[k], 1], faces[seen[k], 2]
        middle = planes[k, 0, 0] * x + planes[k, 0, 1] * y + planes[k, 0, 2]
        reach = 0.5 * (abs(planes[k, 0, 0]) + abs(planes[k, 0, 1]))
        high = min(middle + reach, max(inverse_depth[a], inverse_depth[b], inverse_depth[c]))
        at = count
        # the lists run backwards; of two equal ones the earlier triangle comes first
        while at > 0 and upper[at - 1] <= high:
            listed[at], upper[at], lower[at] = listed[at - 1], upper[at - 1], lower[at - 1]
            at -= 1
        listed[at], upper[at] = k, high
        lower[at] = max(middle - reach, min(inverse_depth[a], inverse_depth[b], inverse_depth[c]))
        count += 1
        head = following[head]
    return count


@njit(cache=True, error_model="numpy", forceinline=True)
def _apart(p: int, lines: Floats, xs: Floats, ys: Floats, size: int) -> bool:
    """Return whether one side of a triangle separates it from piece p."""
    for e in range(3):
        a, b, c = lines[e, 0], lines[e, 1], lines[e, 2]
        most = -np.inf
        for i in range(size):
            most = max(most, a * xs[p, i] + b * ys[p, i] + c)
        if most <= _ON_LINE * (abs(a) + abs(b)):
            return True
    return False


@njit(cache=True, error_model="numpy", forceinline=True)
def _bounds(
    p: int, owner: int, k: int, planes: Floats, x: float, y: float, xs: Floats, ys: Floats, size: int, lines: Floats
) -> int:
    """Return how many lines bound triangle k's part of a piece: 0 if it is behind, 4 if the planes meet."""
    if owner == _NOTHING:
        return 3
    depth = planes[owner, 0, 0] * x + planes[owner, 0, 1] * y + planes[owner, 0, 2]
    a, b = planes[k, 0, 0] - planes[owner, 0, 0], planes[k, 0, 1] - planes[owner, 0, 1]
    c = planes[k, 0, 0] * x + planes[k, 0, 1] * y + planes[k, 0, 2] - depth
    least, most = np.inf, -np.inf
    for i in range(size):
        gap = a * xs[p, i] + b * ys[p, i] + c
        least, most = min(least, gap), max(most, gap)
    if most <= _SAME_DEPTH * depth:
        return 0
    if least >= 0.0:
        return 3
    lines[3, 0], lines[3, 1], lines[3, 2] = a, b, c
    return 4


@njit(cache=True, error_model="numpy", forceinline=True)
def _take(
    p: int, k: int, depth: float, lines: Floats, bounds: int, xs: Floats, ys: Floats, sizes: NDArray[np.int64],
    owners: NDArray[np.int64], farthest: Floats, pieces: int, spare: Floats,
) -> int:  # fmt: skip
    """Assign triangle k's part of piece p; the cut-off parts become new pieces. Return the number of pieces."""
    for e in range(bounds):
        a, b, c = lines[e, 0], lines[e, 1], lines[e, 2]
        margin = _ON_LINE * (abs(a) + abs(b))
        size, least, most, total = sizes[p], np.inf, -np.inf, 0.0
        for i in range(size):
            distance = a * xs[p, i] + b * ys[p, i] + c
            least, most, total = min(least, distance), max(most, distance), total + distance
            spare[2, i] = distance
        if pieces == _PIECES or size + 1 > _CORNERS:
            least = most = total
        if least >= -margin:
            continue
        if most <= margin:
            return pieces
        within = without = 0
        for i in range(size):
            j = i + 1 if i + 1 < size else 0
            here, there = spare[2, i], spare[2, j]
            x, y = xs[p, i], ys[p, i]
            if here >= -margin:
                spare[0, within], spare[1, within] = x, y
                within += 1
            if here <= margin:
                xs[pieces, without], ys[pieces, without] = x, y
                without += 1
            if (here > margin and there < -margin) or (here < -margin and there > margin):
                share = here / (here - there)
                x, y = x + share * (xs[p, j] - x), y + share * (ys[p, j] - y)
                spare[0, within], spare[1, within] = x, y
                xs[pieces, without], ys[pieces, without] = x, y
                within += 1
                without += 1
        sizes[pieces], owners[pieces], farthest[pieces] = without, owners[p], farthest[p]
        pieces += 1
        for i in range(within):
            xs[p, i], ys[p, i] = spare[0, i], spare[1, i]
        sizes[p] = within
    owners[p], farthest[p] = k, depth
    return pieces


@njit(cache=True, error_model="numpy", forceinline=True)
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
