"""Compiled: which tiles of a frame are visible and how much each counts, and which share of them a codec copied."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(
    "(float64[:, :, ::1], float64[:, ::1], float64[::1], int64[::1], float64[:, :, ::1], float64[::1], "
    "float64[::1], float64, float64)",
    cache=True,
    nogil=True,
)
def weigh_tiles(normal, gradient, squares, count, light, variance, excess, hidden, most_light):  # type: ignore[no-untyped-def]
    """Weigh the tiles of a frame, and find those that are visible.

    Motion blur and the like affect all tiles alike, a hand or a hair only some: a tile is visible where its misfit is
    not far beyond the median, and its light not changed too much.

    Parameters
    ----------
    normal, gradient, squares, count, light : ndarray
        From `anglecam.vision.registration.turn_kernel.frame_equations`.
    variance : ndarray
        (tiles,) usual mean squared residual.
    excess : ndarray
        (tiles,) factor of the variance that a tile's displacements show.
    hidden : float
        Misfit relative to the median beyond which a tile is hidden.
    most_light : float
        Relative change of contrast beyond which it is.

    Returns
    -------
    usual : float
        Median misfit relative to the usual one.
    clear : ndarray
        (tiles,) which are visible.
    normals, gradients : ndarray
        (tiles, 3, 3) and (tiles, 3) for turn and place, divided by the variances; zero where a tile is not visible.
    """
    tiles = len(count)
    misfit, clear = np.full(tiles, np.inf), np.zeros(tiles, np.bool_)
    normals, gradients = np.zeros((tiles, 3, 3)), np.zeros((tiles, 3))
    for t in range(tiles):
        if count[t] > 0:
            misfit[t] = squares[t] / count[t] / variance[t]
    ordered = misfit.copy()
    for t in range(1, tiles):  # by insertion, which compiles in a tenth of the time that NumPy's sort takes
        here, k = ordered[t], t
        while k > 0 and (ordered[k - 1] > here or np.isnan(ordered[k - 1])):
            ordered[k] = ordered[k - 1]
            k -= 1
        ordered[k] = here
    usual = (ordered[(tiles - 1) // 2] + ordered[tiles // 2]) / 2
    scale = max(usual, 1.0)
    for t in range(tiles):
        clear[t] = misfit[t] < hidden * scale
        for plane in range(light.shape[1]):
            clear[t] &= abs(light[t, plane, 0]) <= most_light
        if clear[t]:
            usual_square = variance[t] * scale * excess[t]
            for a in range(3):
                for b in range(3):
                    normals[t, a, b] = normal[t, a, b] / usual_square
                gradients[t, a] = gradient[t, a] / usual_square
    return usual, clear, normals, gradients


@njit("(uint8[:, :, ::1], uint8[:, :, ::1], int64[:, ::1], int64)", cache=True, nogil=True)
def copied_share(image, before, middles, half):  # type: ignore[no-untyped-def]
    """Return the share of the tiles' pixels that equal those of the previous frame, the mean over the tiles.

    Parameters
    ----------
    image, before : ndarray
        (h, w, planes) bytes.
    middles : ndarray
        (tiles, 2) column and row of the tiles' middles in the picture.
    half : int
        Half of a tile's side, px.

    Returns
    -------
    float
        0 where no tile is in the picture.
    """
    height, width, planes = image.shape
    total, tiles = 0.0, 0
    for x, y in middles:
        top, bottom = max(y - half, 0), min(y + half, height)
        left, right = max(x - half, 0), min(x + half, width)
        if top >= bottom or left >= right:
            continue
        equal = 0
        for row in range(top, bottom):
            for column in range(left, right):
                for plane in range(planes):
                    equal += image[row, column, plane] == before[row, column, plane]
        total += equal / ((bottom - top) * (right - left) * planes)
        tiles += 1
    return total / tiles if tiles else 0.0
