"""Compiled work on the pixels of tiles: their rotation onto the tiles, their order, their brightness.

No compiled function here calls one of another file, so that the compiler's cache is never out of date.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(inline="always")
def _gain(gains, turn, x, y):  # type: ignore[no-untyped-def]
    total, power = 1.0, 1.0
    for p in range(gains.shape[0]):
        power *= turn
        total += power * (gains[p, 0] + gains[p, 1] * x + gains[p, 2] * y)
    return total


@njit(inline="always")
def _leaning(c, s, parallax, lean, across):  # type: ignore[no-untyped-def]
    """Write into ``across`` the displacement for each px along both axes of a tile whose height varies over it.

    A point whose height exceeds the tile's by δ is displaced by (1 − R)·p·δ, and δ = lean·(point − middle).
    """
    across[0] = (1 - c) * parallax[0] + s * parallax[1]
    across[1] = (1 - c) * parallax[1] - s * parallax[0]
    rest = 1 - lean[0] * across[0] - lean[1] * across[1]
    across[2], across[3] = lean[0] / rest, lean[1] / rest


@njit(
    "(float64[:, ::1], int64[::1], float64[::1], float64[:, ::1], float64[:, ::1], int64, float64[:, :, ::1], "
    "float64[::1], float64[:, ::1])",
    cache=True,
    nogil=True,
)
def place_on_tiles(offsets, starts, turns, pivots, corners, side, all_gains, parallax, leans):  # type: ignore[no-untyped-def]
    """Rotate the pixels of views onto their tiles.

    Parameters
    ----------
    offsets, starts : ndarray
        Of the views, see `anglecam.vision.registration.appearance.TileViews`.
    turns : ndarray
        (views,) rad.
    side : int
        Side of a tile, px.
    parallax : ndarray
        (2,) displacement of the centre for each px of height.
    pivots, corners, all_gains, leans : ndarray
        (tiles, …) of one tile, or of one tile for each view.

    Returns
    -------
    tuple of ndarray
        (m, 2) places from the tiles' corners, px, (m, 2) places from their centres of rotation, px, (m,) gains, and
        (views, 2) displacement of the centre for each px of height.
    """
    places, away, gains = np.empty((len(offsets), 2)), np.empty((len(offsets), 2)), np.empty(len(offsets))
    rises, across = np.empty((len(turns), 2)), np.zeros(4)
    for k in range(len(turns)):
        c, s = np.cos(turns[k]), np.sin(turns[k])
        p = k if len(pivots) > 1 else 0
        _leaning(c, s, parallax, leans[p], across)
        rises[k, 0], rises[k, 1] = across[0], across[1]
        for m in range(starts[k], starts[k + 1]):
            away[m, 0] = c * offsets[m, 0] - s * offsets[m, 1]
            away[m, 1] = s * offsets[m, 0] + c * offsets[m, 1]
            x, y = pivots[p, 0] + away[m, 0] - corners[p, 0], pivots[p, 1] + away[m, 1] - corners[p, 1]
            rise = across[2] * (x - side / 2) + across[3] * (y - side / 2)
            places[m, 0], places[m, 1] = x + across[0] * rise, y + across[1] * rise
            gains[m] = _gain(all_gains[p], turns[k], 2 * places[m, 0] / side - 1, 2 * places[m, 1] / side - 1)
    return places, away, gains, rises


@njit(
    "(float64[:, ::1], int64[::1], float64[::1], float64[::1], float64[::1], int64, float64[:, ::1], "
    "float64[::1], float64[::1])",
    cache=True,
    nogil=True,
    fastmath={"contract"},
)
def place_on_tile(offsets, starts, turns, pivot, corner, side, gains, parallax, lean):  # type: ignore[no-untyped-def]
    """Rotate the pixels of views onto one tile.

    Parameters
    ----------
    offsets, starts : ndarray
        Of the views, see `anglecam.vision.registration.appearance.TileViews`.
    turns : ndarray
        (views,) rad.
    pivot, corner : ndarray
        (2,) centre of rotation and upper left corner of the tile, px.
    side : int
        Side of the tile, px.
    gains : ndarray
        (powers, 3) coefficients of the gain.
    parallax, lean : ndarray
        (2,) displacement of the centre for each px of height, and gradient of the height over the tile.

    Returns
    -------
    ndarray
        (3, m) x and y from the tile's corner, px, and the gain.
    """
    placed = np.empty((3, len(offsets)))
    half = side / 2
    for k in range(len(turns)):
        c, s = np.cos(turns[k]), np.sin(turns[k])
        # A point whose height exceeds the tile's by δ is displaced by (1 − R)·p·δ, and δ = lean·(point − middle).
        across, down = (1 - c) * parallax[0] + s * parallax[1], (1 - c) * parallax[1] - s * parallax[0]
        rest = 1 - lean[0] * across - lean[1] * down
        constant, by_x, by_y, power = 1.0, 0.0, 0.0, 1.0
        for p in range(gains.shape[0]):
            power *= turns[k]
            constant, by_x, by_y = (
                constant + power * gains[p, 0],
                by_x + power * gains[p, 1],
                by_y + power * gains[p, 2],
            )
        for m in range(starts[k], starts[k + 1]):
            # In this order whole pixels stay whole where nothing turns: those on the tile's edge belong to it.
            x = pivot[0] + c * offsets[m, 0] - s * offsets[m, 1] - corner[0]
            y = pivot[1] + s * offsets[m, 0] + c * offsets[m, 1] - corner[1]
            rise = (lean[0] * (x - half) + lean[1] * (y - half)) / rest
            x, y = x + across * rise, y + down * rise
            placed[0, m], placed[1, m] = x, y
            placed[2, m] = constant + by_x * (x / half - 1) + by_y * (y / half - 1)
    return placed


@njit("(float64[:, ::1], int64, int64)", cache=True, nogil=True)
def sort_by_cell(placed, side, cells):  # type: ignore[no-untyped-def]
    """Sort the pixels on a tile by the knots between which they lie.

    Parameters
    ----------
    placed : ndarray
        (3, m) from `place_on_tile`.
    side : int
        Side of the tile, px.
    cells : int
        Intervals between the knots along a side.

    Returns
    -------
    tuple of ndarray
        Numbers of the pixels that are on the tile, by rows of cells, and (cells² + 1,) where each cell's begin.
    """
    cell, begins = np.empty(placed.shape[1], np.int32), np.zeros(cells * cells + 1, np.int64)
    scale = cells / side
    for m in range(placed.shape[1]):
        x, y = placed[0, m], placed[1, m]
        inside = x >= 0 and y >= 0 and x < side and y < side
        cell[m] = int(y * scale) * cells + int(x * scale) if inside else -1
        if inside:
            begins[cell[m] + 1] += 1
    for k in range(cells * cells):
        begins[k + 1] += begins[k]
    order, filled = np.empty(begins[-1], np.int64), begins[:-1].copy()
    for m in range(placed.shape[1]):
        if cell[m] >= 0:
            order[filled[cell[m]]] = m
            filled[cell[m]] += 1
    return order, begins


@njit("(float32[:, ::1], int64[::1], float64[:, :], float64[:, :])", cache=True, nogil=True)
def relight(values, starts, gains, offsets):  # type: ignore[no-untyped-def]
    """Remove from each view a relative gain and an offset of brightness.

    Parameters
    ----------
    values : ndarray
        (m, planes) single precision, grey levels.
    starts : ndarray
        (views + 1,) index at which each view's pixels begin.
    gains, offsets : ndarray
        (views, planes) gain less 1, and offset in grey levels.

    Returns
    -------
    ndarray
        (m, planes) single precision.
    """
    lit = np.empty_like(values)
    for k in range(len(starts) - 1):
        for m in range(starts[k], starts[k + 1]):
            for channel in range(values.shape[1]):
                lit[m, channel] = (values[m, channel] - offsets[k, channel]) / (1.0 + gains[k, channel])
    return lit
