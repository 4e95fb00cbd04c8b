"""Compiled rotation of pixels onto tiles.

No compiled function here calls one of another file, so that the compiler's cache is never out of date.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, inline="always")
def _gain(gains, turn, x, y):  # type: ignore[no-untyped-def]
    total, power = 1.0, 1.0
    for p in range(gains.shape[0]):
        power *= turn
        total += power * (gains[p, 0] + gains[p, 1] * x + gains[p, 2] * y)
    return total


@njit(cache=True, inline="always")
def _leaning(c, s, parallax, lean, across):  # type: ignore[no-untyped-def]
    """Write into ``across`` the displacement for each px along both axes of a tile whose height varies over it.

    A point whose height exceeds the tile's by δ is displaced by (1 − R)·p·δ, and δ = lean·(point − middle).
    """
    across[0] = (1 - c) * parallax[0] + s * parallax[1]
    across[1] = (1 - c) * parallax[1] - s * parallax[0]
    rest = 1 - lean[0] * across[0] - lean[1] * across[1]
    across[2], across[3] = lean[0] / rest, lean[1] / rest


@njit(cache=True, nogil=True)
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
        rises[k] = across[:2]
        for m in range(starts[k], starts[k + 1]):
            away[m, 0] = c * offsets[m, 0] - s * offsets[m, 1]
            away[m, 1] = s * offsets[m, 0] + c * offsets[m, 1]
            x, y = pivots[p, 0] + away[m, 0] - corners[p, 0], pivots[p, 1] + away[m, 1] - corners[p, 1]
            rise = across[2] * (x - side / 2) + across[3] * (y - side / 2)
            places[m, 0], places[m, 1] = x + across[0] * rise, y + across[1] * rise
            gains[m] = _gain(all_gains[p], turns[k], 2 * places[m, 0] / side - 1, 2 * places[m, 1] / side - 1)
    return places, away, gains, rises
