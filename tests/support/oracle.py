"""An analytic picture of flat shapes: the exact share of every pixel that a polygon covers.

    share = coverage(border(vertices_px, faces), width, height)

It uses no meshes, depth or cameras. Each edge of the border is cut where it crosses pixel edges. A piece that falls by
dy within a pixel covers everything to its right by dy (Green's theorem), so a running sum along each row gives the
areas. Nothing is sampled.
"""

from __future__ import annotations

import numpy as np


def coverage(border_px: np.ndarray, width: int, height: int) -> np.ndarray:
    """Return each pixel's share, (height, width), inside a border of (n, 2, 2) directed edges; (0, 0) is a centre."""
    area = np.zeros((height, width + 1))
    for start, end in np.asarray(border_px, dtype=float) + 0.5:  # from pixel centres to pixel corners
        cuts = np.unique(np.concatenate([[0.0, 1.0], *(_crossings(start[k], end[k]) for k in (0, 1))]))
        points = start + cuts[:, None] * (end - start)
        middle, falls = (points[1:] + points[:-1]) / 2, np.diff(points[:, 1])
        for (x, y), fall in zip(middle, falls, strict=True):
            row, column = int(np.floor(y)), int(np.floor(x))
            if 0 <= row < height and column < width:
                left = max(column, 0)
                share = 1.0 if column < 0 else column + 1 - x
                area[row, left] += fall * share
                area[row, left + 1] += fall * (1 - share)
    return np.abs(np.cumsum(area, axis=1)[:, :width])


def centroid(share: np.ndarray) -> np.ndarray:
    """Return the centroid (x, y), px, of a picture's intensity."""
    y, x = np.indices(share.shape)
    return np.array([np.average(x, weights=share), np.average(y, weights=share)])


def border(vertices_px: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the directed edges (n, 2, 2) around the area of the triangles that face the camera."""
    ahead, behind = (vertices_px[faces[:, k]] - vertices_px[faces[:, 0]] for k in (1, 2))
    # y points down in a picture: counter-clockwise in the world is clockwise here
    front = faces[ahead[:, 0] * behind[:, 1] - ahead[:, 1] * behind[:, 0] < 0]
    edges = {(int(a), int(b)) for face in front for a, b in zip(face, np.roll(face, -1), strict=True)}
    return vertices_px[[edge for edge in edges if edge[::-1] not in edges]]


def _crossings(start: float, end: float) -> np.ndarray:
    """Return the positions along an edge, 0 to 1, at which a coordinate crosses whole numbers."""
    low, high = sorted((start, end))
    whole = np.arange(np.ceil(low), np.floor(high) + 1)
    return (whole - start) / (end - start) if high > low else np.empty(0)
