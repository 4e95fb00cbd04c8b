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


@njit(
    "(float64[:, ::1], int32[::1], float64[:, :, ::1], float64, float64, float64[::1], float64[::1], float64, "
    "float64[:, ::1], float64[::1])",
    cache=True,
    error_model="numpy",
)
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


@njit(
    "(int32[:, ::1], boolean[::1], float64[:, ::1], float64[::1], int64, float64, float64, boolean[::1], "
    "int32[::1], int32[::1], boolean[::1])",
    cache=True,
    error_model="numpy",
)
def face_camera(
    faces: Ints,
    wanted: NDArray[np.bool_],
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
    faces, wanted, pixels, inverse_depth : ndarray
        (m, 3), (m,), whether a triangle may be listed, (n, 2) and (n,).
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
        front[t] = False
        if not wanted[t]:
            continue
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


@njit(
    "(int32[::1], int32[:, ::1], float64[:, ::1], float64[::1], float64[:, ::1], float64[:, ::1], float64[:, :, ::1])",
    cache=True,
    error_model="numpy",
)
def lay_planes(
    seen: Ints, faces: Ints, pixels: Floats, inverse_depth: Floats, light: Floats, shapes: Floats, shades: Floats
) -> None:
    """Collect each triangle's corners and fit its 1/depth and the three lights times 1/depth.

    What one triangle needs lies together: the time of drawing is that of fetching triangles from memory.

    Parameters
    ----------
    seen : ndarray
        (k,), triangles.
    faces, pixels, inverse_depth, light : ndarray
        (m, 3), (n, 2), (n,) and (n, 3).
    shapes : ndarray
        (m, 11), written for `seen`: x and y of each corner; gx, gy and q0 of 1/depth; its greatest and least value.
    shades : ndarray
        (m, 3, 3), written for `seen`: gx, gy and q0 of red, green and blue.
    """
    for t in seen:
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        xa, ya = pixels[a, 0], pixels[a, 1]
        xb, yb, xc, yc = pixels[b, 0] - xa, pixels[b, 1] - ya, pixels[c, 0] - xa, pixels[c, 1] - ya
        scale = 1.0 / (xb * yc - xc * yb)
        for q in range(4):
            qa, qb, qc = inverse_depth[a], inverse_depth[b], inverse_depth[c]
            if q > 0:
                qa, qb, qc = qa * light[a, q - 1], qb * light[b, q - 1], qc * light[c, q - 1]
            gx = ((qb - qa) * yc - (qc - qa) * yb) * scale
            gy = ((qc - qa) * xb - (qb - qa) * xc) * scale
            q0 = qa - gx * xa - gy * ya
            if q > 0:
                shades[t, q - 1, 0], shades[t, q - 1, 1], shades[t, q - 1, 2] = gx, gy, q0
            else:
                shapes[t, 6], shapes[t, 7], shapes[t, 8] = gx, gy, q0
                shapes[t, 9], shapes[t, 10] = max(qa, qb, qc), min(qa, qb, qc)
        for e in range(3):
            shapes[t, 2 * e], shapes[t, 2 * e + 1] = pixels[faces[t, e], 0], pixels[faces[t, e], 1]


@njit("(float64, float64, float64, float64)", cache=True, error_model="numpy", forceinline=True)
def _edge(xa: float, ya: float, xb: float, yb: float) -> tuple[float, float, float, float]:
    """Return the upper and lower end of an edge, and where it begins and its slope in px per row.

    Both triangles at an edge compute from its upper end, so that rounding leaves no gap between them.
    """
    if ya > yb or (ya == yb and xa > xb):
        xa, ya, xb, yb = xb, yb, xa, ya
    return ya, yb, xa, (xb - xa) / (yb - ya) if yb > ya else 0.0


@njit("(int32[::1], float64[:, ::1], int64, int32[:, ::1], float64[:, ::1])", cache=True, error_model="numpy")
def find_nearest(seen: Ints, shapes: Floats, first: int, nearest: Ints, depths: Floats) -> None:
    """Find the nearest triangle at each pixel's centre; a centre on a common edge belongs to exactly one triangle.

    Triangles drawn before stay where they are nearer. Of two at the same depth the one with the lower index is taken,
    so that the result does not depend on the order.

    Parameters
    ----------
    seen, shapes : ndarray
        As in `lay_planes`.
    first : int
        Row of the picture that is the first one of `nearest`.
    nearest : ndarray
        (rows, width), updated: triangle, or `NOTHING`.
    depths : ndarray
        (rows, width), updated: 1/depth there, 0 for nothing, 1/m.
    """
    rows, width = nearest.shape
    for t in seen:
        xa, ya, xb, yb, xc, yc = shapes[t, 0], shapes[t, 1], shapes[t, 2], shapes[t, 3], shapes[t, 4], shapes[t, 5]
        top, bottom = max(np.ceil(min(ya, yb, yc)), first), min(np.ceil(max(ya, yb, yc)), first + rows)
        if top >= bottom or np.ceil(min(xa, xb, xc)) >= np.ceil(max(xa, xb, xc)):
            continue  # contains no pixel's centre
        low_a, high_a, start_a, slope_a = _edge(xa, ya, xb, yb)
        low_b, high_b, start_b, slope_b = _edge(xb, yb, xc, yc)
        low_c, high_c, start_c, slope_c = _edge(xc, yc, xa, ya)
        gx, gy, q0 = shapes[t, 6], shapes[t, 7], shapes[t, 8]
        for row in range(int(top), int(bottom)):
            left, right = np.inf, -np.inf
            if low_a <= row < high_a:
                x = start_a + (row - low_a) * slope_a
                left, right = min(left, x), max(right, x)
            if low_b <= row < high_b:
                x = start_b + (row - low_b) * slope_b
                left, right = min(left, x), max(right, x)
            if low_c <= row < high_c:
                x = start_c + (row - low_c) * slope_c
                left, right = min(left, x), max(right, x)
            begin, end = max(int(np.ceil(left)), 0), min(int(np.ceil(right)), width)
            if begin >= end:
                continue
            there = gy * row + q0
            for x in range(begin, end):
                q, near = gx * x + there, depths[row - first, x]
                if q > near or (q == near and t < nearest[row - first, x]):
                    depths[row - first, x], nearest[row - first, x] = q, t


@njit(
    "(int32[:, ::1], float64[:, ::1], float64[:, :, ::1], int64, int32[:, ::1], float32[:, :, ::1])",
    cache=True,
    error_model="numpy",
)
def light_centres(
    nearest: Ints, shapes: Floats, shades: Floats, first: int, spans: Ints, light: NDArray[np.float32]
) -> None:
    """Write the light at each pixel's centre.

    Parameters
    ----------
    nearest : ndarray
        (rows, width), triangle, or `NOTHING`.
    shapes, shades : ndarray
        `lay_planes`.
    first : int
        Row of the picture that is the first one of `nearest`.
    spans : ndarray
        (rows, 2), the columns to write in each row: from the first to before the second.
    light : ndarray
        (rows, width, 3), written there.
    """
    for row in range(len(nearest)):
        y, end, stop = float(row + first), spans[row, 0], spans[row, 1]
        while end < stop:
            # one run of pixels with the same triangle at a time
            begin, k = end, nearest[row, end]
            while end < stop and nearest[row, end] == k:
                end += 1
            if k == NOTHING:
                light[row, begin:end] = 0.0
                continue
            q0, r0 = shapes[k, 7] * y + shapes[k, 8], shades[k, 0, 1] * y + shades[k, 0, 2]
            g0, b0 = shades[k, 1, 1] * y + shades[k, 1, 2], shades[k, 2, 1] * y + shades[k, 2, 2]
            qx, rx, gx, bx = shapes[k, 6], shades[k, 0, 0], shades[k, 1, 0], shades[k, 2, 0]
            for x in range(begin, end):
                depth = 1.0 / (qx * x + q0)
                light[row, x, 0] = (rx * x + r0) * depth
                light[row, x, 1] = (gx * x + g0) * depth
                light[row, x, 2] = (bx * x + b0) * depth
