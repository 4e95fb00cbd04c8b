"""The layer of what does not move: drawn once, and again only when the camera has moved.

Most of a picture is the wall and the stand, and a frame consists of several instants. An instant starts from the
layer's depths and light. Only the moving triangles are drawn over it, and in each row only the pixels from the first of
them to the last get new light. The depth test does not depend on the order in which triangles are drawn, so that the
picture is the same bit for bit as if all were drawn.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

BODY = "ground"
"""The body whose parts do not move."""
_AROUND = 1
"""Pixels around a triangle whose light may depend on it: an edge is hidden or not by a pixel's neighbours."""


@dataclass(frozen=True)
class Still:
    """The whole picture of the parts that do not move."""

    nearest: Ints
    """(height, width), `synth.draw.depth.find_nearest`."""
    depths: Floats
    """(height, width)."""
    light: NDArray[np.float32]
    """(height, width, 3)."""


@njit("(int32[::1], float64[:, ::1], int64, int32[:, ::1])", cache=True, error_model="numpy")
def reach(moving: Ints, shapes: Floats, first: int, spans: Ints) -> None:
    """Find the pixels of each row whose light may depend on one of the triangles.

    Parameters
    ----------
    moving, shapes : ndarray
        (k,) triangles and (m, 11), `synth.draw.depth.lay_planes`.
    first : int
        Row of the picture that is the first one of `spans`.
    spans : ndarray
        (rows, 2), widened: the first column and the one after the last; they may lie outside the picture.
    """
    rows = len(spans)
    for t in moving:
        xa, ya, xb, yb, xc, yc = shapes[t, 0], shapes[t, 1], shapes[t, 2], shapes[t, 3], shapes[t, 4], shapes[t, 5]
        left = int(np.floor(min(xa, xb, xc) + 0.5)) - _AROUND
        right = int(np.floor(max(xa, xb, xc) + 0.5)) + _AROUND + 1
        top = max(int(np.floor(min(ya, yb, yc) + 0.5)) - _AROUND - first, 0)
        bottom = min(int(np.floor(max(ya, yb, yc) + 0.5)) + _AROUND - first, rows - 1)
        for row in range(top, bottom + 1):
            spans[row, 0], spans[row, 1] = min(spans[row, 0], left), max(spans[row, 1], right)


@njit(
    "(int32[:, ::1], int32[:, ::1], float64[:, ::1], int32[:, ::1], float64[:, ::1])",
    cache=True,
    error_model="numpy",
)
def restore(spans: Ints, drawn: Ints, at: Floats, nearest: Ints, depths: Floats) -> None:
    """Undo a drawing over the layer.

    Parameters
    ----------
    spans : ndarray
        (height, 2), the columns of each row that were drawn.
    drawn, at : ndarray
        (height, width), triangles and depths of the layer.
    nearest, depths : ndarray
        (height, width), written there.
    """
    for row in range(len(spans)):
        for x in range(spans[row, 0], spans[row, 1]):
            nearest[row, x], depths[row, x] = drawn[row, x], at[row, x]
