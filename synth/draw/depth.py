"""Projects the triangles and finds the nearest one at the centre of each pixel.

Through a pinhole 1/depth of a flat triangle is affine in the picture, and so is its light times 1/depth; both are
kept as planes q(x, y) = gx·x + gy·y + q0. No value is carried over from pixel to pixel or from row to row, so that a
band of rows equals the same rows of the whole picture bit for bit.

Compiled functions here call no function of another file, because the compiler's disk cache would miss changes there.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

NOTHING = -1
"""Index of no triangle."""

_SMALLEST = 1e-9
"""Twice the area, px², below which a triangle is seen edge-on and covers nothing."""


@njit(cache=True, error_model="numpy")
def project(
    vertices: Floats,
    body: Ints,
    poses: Floats,
    distance: float,
    focal: float,
    principal: Floats,
    lens: Floats,
    k1: float,
    pixels: Floats,
    inverse_depth: Floats,
) -> None:
    """Project the vertices, as `Pinhole.draw` does.

    Parameters
    ----------
    vertices : ndarray
        (n, 3), each in its body's frame, m.
    body : ndarray
        (n,), index into `poses`.
    poses : ndarray
        (b, 3, 4), from a body's frame to the camera's axes about the shaft.
    distance, focal, principal, lens, k1
        Fields of `Pinhole`.
    pixels : ndarray
        (n, 2), written, px before mirroring.
    inverse_depth : ndarray
        (n,), written, 1/m; zero or less behind the camera.
    """
    for v in range(len(vertices)):
        pose = poses[body[v]]
        a, b, c = vertices[v, 0], vertices[v, 1], vertices[v, 2]
        x = pose[0, 0] * a + pose[0, 1] * b + pose[0, 2] * c + pose[0, 3]
        y = pose[1, 0] * a + pose[1, 1] * b + pose[1, 2] * c + pose[1, 3]
        z = pose[2, 0] * a + pose[2, 1] * b + pose[2, 2] * c + pose[2, 3]
        inverse = 1.0 / (distance - z)
        u = principal[0] + focal * x * inverse
        w = principal[1] - focal * y * inverse
        off_u, off_w = u - lens[0], w - lens[1]
        stretch = k1 * (off_u * off_u + off_w * off_w) / (focal * focal)
        pixels[v, 0] = u + off_u * stretch
        pixels[v, 1] = w + off_w * stretch
        inverse_depth[v] = inverse


@njit(cache=True, error_model="numpy")
def face_camera(
    faces: Ints,
    pixels: Floats,
    inverse_depth: Floats,
    width: int,
    top: float,
    bottom: float,
    front: NDArray[np.bool_],
    seen: Ints,
    used: Ints,
    touched: NDArray[np.bool_],
) -> tuple[int, int]:
    """List the triangles that face the camera and reach into a band of rows, and their vertices.

    Parameters
    ----------
    faces, pixels, inverse_depth : ndarray
        (m, 3), (n, 2) and (n,).
    width : int
        Width of the picture, px.
    top, bottom : float
        Upper and lower border of the band, px.
    front : ndarray
        (m,), written: whether a triangle is in the list.
    seen, used : ndarray
        (m,) and (n,), their first entries written: the triangles and the vertices in the list.
    touched : ndarray
        (n,), workspace.

    Returns
    -------
    tuple of int
        Number of valid entries of `seen` and of `used`.
    """
    touched[:] = False
    faces_seen = vertices_used = 0
    for t in range(len(faces)):
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        xa, ya, xb, yb, xc, yc = pixels[a, 0], pixels[a, 1], pixels[b, 0], pixels[b, 1], pixels[c, 0], pixels[c, 1]
        # y points down, so a triangle that appears counter-clockwise has a negative area
        looks = (xb - xa) * (yc - ya) - (xc - xa) * (yb - ya) < -_SMALLEST
        inside = (
            max(ya, yb, yc) >= top and min(ya, yb, yc) <= bottom and max(xa, xb, xc) >= -0.5
            and min(xa, xb, xc) <= width - 0.5 and min(inverse_depth[a], inverse_depth[b], inverse_depth[c]) > 0.0
        )  # fmt: skip
        front[t] = looks and inside
        if front[t]:
            seen[faces_seen] = t
            faces_seen += 1
            for v in (a, b, c):
                if not touched[v]:
                    touched[v] = True
                    used[vertices_used] = v
                    vertices_used += 1
    return faces_seen, vertices_used


@njit(cache=True, error_model="numpy")
def lay_planes(seen: Ints, faces: Ints, pixels: Floats, inverse_depth: Floats, light: Floats, planes: Floats) -> None:
    """Fit 1/depth and the three lights times 1/depth of each triangle.

    Parameters
    ----------
    seen : ndarray
        (k,), triangles.
    faces, pixels, inverse_depth, light : ndarray
        (m, 3), (n, 2), (n,) and (n, 3).
    planes : ndarray
        (k, 4, 3) or more, written: (gx, gy, q0) of 1/depth, then of red, green and blue.
    """
    for k in range(len(seen)):
        a, b, c = faces[seen[k], 0], faces[seen[k], 1], faces[seen[k], 2]
        xa, ya = pixels[a, 0], pixels[a, 1]
        xb, yb, xc, yc = pixels[b, 0] - xa, pixels[b, 1] - ya, pixels[c, 0] - xa, pixels[c, 1] - ya
        scale = 1.0 / (xb * yc - xc * yb)
        for q in range(4):
            qa, qb, qc = inverse_depth[a], inverse_depth[b], inverse_depth[c]
            if q > 0:
                qa, qb, qc = qa * light[a, q - 1], qb * light[b, q - 1], qc * light[c, q - 1]
            gx = ((qb - qa) * yc - (qc - qa) * yb) * scale
            gy = ((qc - qa) * xb - (qb - qa) * xc) * scale
            planes[k, q, 0], planes[k, q, 1], planes[k, q, 2] = gx, gy, qa - gx * xa - gy * ya


@njit(cache=True, error_model="numpy")
def find_nearest(
    seen: Ints,
    faces: Ints,
    part: Ints,
    pixels: Floats,
    planes: Floats,
    first: int,
    nearest: Ints,
    owner: Ints,
    depths: Floats,
) -> None:
    """Find the nearest triangle at each pixel's centre; a centre on a common edge belongs to exactly one triangle.

    Parameters
    ----------
    seen, faces, pixels, planes : ndarray
        As in `lay_planes`.
    part : ndarray
        (m,), part of each triangle.
    first : int
        Row of the picture that is the first one of `nearest`.
    nearest, owner : ndarray
        (rows, width), written: index into `seen`, and part, or `NOTHING`.
    depths : ndarray
        (rows, width), written: 1/depth there, 0 for nothing, 1/m.
    """
    rows, width = nearest.shape
    nearest[:], owner[:], depths[:] = NOTHING, NOTHING, 0.0
    low, high, start, slope = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for k in range(len(seen)):
        t = seen[k]
        xa, xb, xc = pixels[faces[t, 0], 0], pixels[faces[t, 1], 0], pixels[faces[t, 2], 0]
        ya, yb, yc = pixels[faces[t, 0], 1], pixels[faces[t, 1], 1], pixels[faces[t, 2], 1]
        top, bottom = max(np.ceil(min(ya, yb, yc)), first), min(np.ceil(max(ya, yb, yc)), first + rows)
        if top >= bottom or np.ceil(min(xa, xb, xc)) >= np.ceil(max(xa, xb, xc)):
            continue  # contains no pixel's centre
        for e in range(3):
            # Both triangles at an edge compute from its upper end, so that rounding leaves no gap between them.
            a, b = faces[t, e], faces[t, e + 1 if e < 2 else 0]
            if pixels[a, 1] > pixels[b, 1] or (pixels[a, 1] == pixels[b, 1] and pixels[a, 0] > pixels[b, 0]):
                a, b = b, a
            low[e], high[e], start[e] = pixels[a, 1], pixels[b, 1], pixels[a, 0]
            slope[e] = (pixels[b, 0] - pixels[a, 0]) / (high[e] - low[e]) if high[e] > low[e] else 0.0
        gx, gy, q0 = planes[k, 0, 0], planes[k, 0, 1], planes[k, 0, 2]
        belongs = part[t]
        for row in range(int(top), int(bottom)):
            left, right = np.inf, -np.inf
            for e in range(3):
                if low[e] <= row < high[e]:
                    x = start[e] + (row - low[e]) * slope[e]
                    left, right = min(left, x), max(right, x)
            begin, end = max(int(np.ceil(left)), 0), min(int(np.ceil(right)), width)
            if begin >= end:
                continue
            there = gy * row + q0
            ids, parts = nearest[row - first, begin:end], owner[row - first, begin:end]
            near = depths[row - first, begin:end]
            for i in range(end - begin):
                # all three are always written: without a branch the loop is vectorised
                q = gx * (begin + i) + there
                nearer = q > near[i]
                near[i] = q if nearer else near[i]
                ids[i] = k if nearer else ids[i]
                parts[i] = belongs if nearer else parts[i]


@njit(cache=True, error_model="numpy")
def light_centres(nearest: Ints, planes: Floats, first: int, light: NDArray[np.float32]) -> None:
    """Write the light at each pixel's centre.

    Parameters
    ----------
    nearest : ndarray
        (rows, width), index into `planes`, or `NOTHING`.
    planes : ndarray
        (k, 4, 3), `lay_planes`.
    first : int
        Row of the picture that is the first one of `nearest`.
    light : ndarray
        (rows, width, 3), written.
    """
    rows, width = nearest.shape
    for row in range(rows):
        y, end = float(row + first), 0
        while end < width:
            # one run of pixels with the same triangle at a time
            begin, k = end, nearest[row, end]
            while end < width and nearest[row, end] == k:
                end += 1
            if k == NOTHING:
                light[row, begin:end] = 0.0
                continue
            q0, r0 = planes[k, 0, 1] * y + planes[k, 0, 2], planes[k, 1, 1] * y + planes[k, 1, 2]
            g0, b0 = planes[k, 2, 1] * y + planes[k, 2, 2], planes[k, 3, 1] * y + planes[k, 3, 2]
            qx, rx, gx, bx = planes[k, 0, 0], planes[k, 1, 0], planes[k, 2, 0], planes[k, 3, 0]
            for x in range(begin, end):
                depth = 1.0 / (qx * x + q0)
                light[row, x, 0] = (rx * x + r0) * depth
                light[row, x, 1] = (gx * x + g0) * depth
                light[row, x, 2] = (bx * x + b0) * depth
