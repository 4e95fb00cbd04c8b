"""Compiled sums over pixels for the appearance of tiles, which are cubic B-splines.

A pixel at an offset from the centre of rotation is rotated onto the tile, where its value is a weighted sum of the
4 × 4 coefficients around it.

No compiled function here calls one of another file, so that the compiler's cache is never out of date.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, inline="always")
def _weights(u):  # type: ignore[no-untyped-def]
    v = 1 - u
    return v**3 / 6, (3 * u**3 - 6 * u**2 + 4) / 6, (3 * v**3 - 6 * v**2 + 4) / 6, u**3 / 6


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
def normal_equations(offsets, values, starts, turns, pivot, corner, side, n, gains, parallax, lean):  # type: ignore[no-untyped-def]
    """Accumulate the normal equations for a tile's coefficients from views at known turns and gains.

    Parameters
    ----------
    offsets, values, starts : ndarray
        Of the views, see `anglecam.vision.registration.appearance.TileViews`.
    turns : ndarray
        (views,) rad.
    pivot, corner : ndarray
        (2,) centre of rotation and upper left corner of the tile, px.
    side : int
        Side of the tile, px.
    n : int
        Number of coefficients along a side.
    gains : ndarray
        (powers, 3) coefficients of the gain.
    parallax, lean : ndarray
        (2,) displacement of the centre for each px of height, and gradient of the height over the tile.

    Returns
    -------
    tuple of ndarray
        (n², 25) products of each coefficient's spline with itself and with the splines of those of its 7 × 7
        neighbours that come after it (the matrix is symmetric), and (planes, n²) right sides.
    """
    band = np.zeros((n * n, 25))
    planes = values.shape[1]
    right = np.zeros((planes, n * n))
    wx, wy, across = np.zeros(4), np.zeros(4), np.zeros(4)
    scale = (n - 3) / side
    for k in range(len(turns)):
        c, s = np.cos(turns[k]), np.sin(turns[k])
        _leaning(c, s, parallax, lean, across)
        for m in range(starts[k], starts[k + 1]):
            x = pivot[0] + c * offsets[m, 0] - s * offsets[m, 1] - corner[0]
            y = pivot[1] + s * offsets[m, 0] + c * offsets[m, 1] - corner[1]
            rise = across[2] * (x - side / 2) + across[3] * (y - side / 2)
            x, y = x + across[0] * rise, y + across[1] * rise
            if x < 0 or y < 0 or x >= side or y >= side:
                continue
            g = _gain(gains, turns[k], 2 * x / side - 1, 2 * y / side - 1)
            ux, uy = x * scale, y * scale
            ix, iy = int(ux), int(uy)
            wx[0], wx[1], wx[2], wx[3] = _weights(ux - ix)
            wy[0], wy[1], wy[2], wy[3] = _weights(uy - iy)
            for j in range(4):
                for i in range(4):
                    w = g * wx[i] * wy[j]
                    p = (iy + j) * n + ix + i
                    for channel in range(planes):
                        right[channel, p] += w * values[m, channel]
                    for ii in range(i, 4):
                        band[p, ii - i] += w * g * wx[ii] * wy[j]
                    for jj in range(j + 1, 4):
                        for ii in range(4):
                            band[p, (jj - j) * 7 + ii - i] += w * g * wx[ii] * wy[jj]
    return band, right


@njit(cache=True, nogil=True)
def gain_equations(offsets, values, starts, turns, pivot, corner, side, coefficients, parallax, lean):  # type: ignore[no-untyped-def]
    """Accumulate the normal equations for a tile's gain, with the coefficients given.

    Parameters
    ----------
    offsets, values, starts, turns, pivot, corner, side, parallax, lean
        As in `normal_equations`.
    coefficients : ndarray
        (planes, n, n), y first.

    Returns
    -------
    tuple of ndarray
        Normal matrix (9, 9) and right side (9,), for constant, x and y of the first power of the turn, and so on.
    """
    n = coefficients.shape[1]
    terms = 3 * 3
    normal, gradient, basis, across = np.zeros((terms, terms)), np.zeros(terms), np.zeros(terms), np.zeros(4)
    scale = (n - 3) / side
    for k in range(len(turns)):
        c, s = np.cos(turns[k]), np.sin(turns[k])
        _leaning(c, s, parallax, lean, across)
        for m in range(starts[k], starts[k + 1]):
            x = pivot[0] + c * offsets[m, 0] - s * offsets[m, 1] - corner[0]
            y = pivot[1] + s * offsets[m, 0] + c * offsets[m, 1] - corner[1]
            rise = across[2] * (x - side / 2) + across[3] * (y - side / 2)
            x, y = x + across[0] * rise, y + across[1] * rise
            if x < 0 or y < 0 or x >= side or y >= side:
                continue
            ux, uy = x * scale, y * scale
            ix, iy = int(ux), int(uy)
            wx, wy = _weights(ux - ix), _weights(uy - iy)
            square, product = 0.0, 0.0
            for channel in range(coefficients.shape[0]):
                level = 0.0
                for j in range(4):
                    for i in range(4):
                        level += wx[i] * wy[j] * coefficients[channel, iy + j, ix + i]
                square += level * level
                product += level * (values[m, channel] - level)
            power = 1.0
            for p in range(3):
                power *= turns[k]
                basis[3 * p] = power
                basis[3 * p + 1] = power * (2 * x / side - 1)
                basis[3 * p + 2] = power * (2 * y / side - 1)
            for a in range(terms):
                gradient[a] += basis[a] * product
                weighted = basis[a] * square
                for b in range(a, terms):
                    normal[a, b] += weighted * basis[b]
    for a in range(terms):
        for b in range(a):
            normal[a, b] = normal[b, a]
    return normal, gradient


@njit(cache=True, nogil=True)
def place_on_tiles(offsets, starts, turns, pivots, corners, side, all_gains, parallax, leans):  # type: ignore[no-untyped-def]
    """Rotate the pixels of views onto their tiles.

    Parameters
    ----------
    offsets, starts, turns, side, parallax
        As in `normal_equations`.
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
