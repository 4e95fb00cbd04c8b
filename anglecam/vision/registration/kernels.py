"""Compiled sums over pixels for the appearance of tiles and its fit: cubic B-splines and their derivatives.

A pixel at an offset from the centre of rotation is rotated onto the tile, where its value is a weighted sum of the
4 × 4 coefficients around it.

No compiled function here calls one of another file, so that the compiler's cache is never out of date.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, inline="always")
def _weights(u, w):  # type: ignore[no-untyped-def]
    w[0] = (1 - u) ** 3 / 6
    w[1] = (3 * u**3 - 6 * u**2 + 4) / 6
    w[2] = (-3 * u**3 + 3 * u**2 + 3 * u + 1) / 6
    w[3] = u**3 / 6


@njit(cache=True, inline="always")
def _slopes(u, d):  # type: ignore[no-untyped-def]
    d[0] = -((1 - u) ** 2) / 2
    d[1] = (3 * u * u - 4 * u) / 2
    d[2] = (-3 * u * u + 2 * u + 1) / 2
    d[3] = u * u / 2


@njit(cache=True, inline="always")
def _bends(u, b):  # type: ignore[no-untyped-def]
    b[0] = 1 - u
    b[1] = 3 * u - 2
    b[2] = 1 - 3 * u
    b[3] = u


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


@njit(cache=True)
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
            _weights(ux - ix, wx)
            _weights(uy - iy, wy)
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


@njit(cache=True)
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
    gradient, basis = np.zeros(terms), np.zeros(terms)
    half, products = np.zeros(terms * (terms + 1) // 2), np.zeros(terms * (terms + 1) // 2)
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
            ux, uy = x * scale, y * scale
            ix, iy = int(ux), int(uy)
            _weights(ux - ix, wx)
            _weights(uy - iy, wy)
            power = 1.0
            for p in range(3):
                power *= turns[k]
                basis[3 * p] = power
                basis[3 * p + 1] = power * (2 * x / side - 1)
                basis[3 * p + 2] = power * (2 * y / side - 1)
            entry = 0
            for a in range(terms):
                for b in range(a, terms):
                    products[entry] = basis[a] * basis[b]
                    entry += 1
            for channel in range(coefficients.shape[0]):
                level = 0.0
                for j in range(4):
                    for i in range(4):
                        level += wx[i] * wy[j] * coefficients[channel, iy + j, ix + i]
                residual = values[m, channel] - level
                for a in range(terms):
                    gradient[a] += basis[a] * level * residual
                for e in range(len(half)):
                    half[e] += products[e] * level * level
    normal, entry = np.zeros((terms, terms)), 0
    for a in range(terms):
        for b in range(a, terms):
            normal[a, b] = normal[b, a] = half[entry]
            entry += 1
    return normal, gradient


@njit(cache=True)
def turn_equations(offsets, values, starts, turns, pivots, corners, side, splines, all_gains, parallax, leans):  # type: ignore[no-untyped-def]
    """Accumulate each view's normal equations for its turn, its centre's place and its lean, given the appearance.

    The view's brightness and blur are fitted too, for each plane, and eliminated.

    Parameters
    ----------
    offsets, values, starts, turns, side, parallax
        As in `normal_equations`.
    pivots, corners, splines, all_gains, leans : ndarray
        (tiles, …) centres of rotation, corners, coefficients, gains and leans: of one tile, or of one tile for each
        view.

    Returns
    -------
    tuple of ndarray
        The fields of `anglecam.vision.registration.appearance.TileFit`, in its order.
    """
    views, planes, n = len(turns), splines.shape[1], splines.shape[2]
    normals, gradients = np.zeros((views, 5, 5)), np.zeros((views, 5))
    squares, counts = np.zeros(views), np.zeros(views, dtype=np.int64)
    lights = np.zeros((views, planes, 3))
    wx, wy, dx, dy, bx, by = np.zeros(4), np.zeros(4), np.zeros(4), np.zeros(4), np.zeros(4), np.zeros(4)
    slope, bright, across = np.zeros(5), np.ones(3), np.zeros(4)
    scale = (n - 3) / side
    for k in range(views):
        c, s = np.cos(turns[k]), np.sin(turns[k])
        p = k if len(splines) > 1 else 0
        pivot, corner, coefficients, gains = pivots[p], corners[p], splines[p], all_gains[p]
        _leaning(c, s, parallax, leans[p], across)
        normal, gradient = np.zeros((5, 5)), np.zeros(5)
        light, light_gradient, cross = np.zeros((planes, 3, 3)), np.zeros((planes, 3)), np.zeros((planes, 3, 5))
        for m in range(starts[k], starts[k + 1]):
            at_x = pivot[0] + c * offsets[m, 0] - s * offsets[m, 1]
            at_y = pivot[1] + s * offsets[m, 0] + c * offsets[m, 1]
            x, y = at_x - corner[0], at_y - corner[1]
            rise = across[2] * (x - side / 2) + across[3] * (y - side / 2)
            x, y = x + across[0] * rise, y + across[1] * rise
            # Half a pixel inside the tile, where data on all sides determine the spline.
            if x < 0.5 or y < 0.5 or x >= side - 0.5 or y >= side - 0.5:
                continue
            g = _gain(gains, turns[k], 2 * x / side - 1, 2 * y / side - 1)
            ux, uy = x * scale, y * scale
            ix, iy = int(ux), int(uy)
            _weights(ux - ix, wx)
            _weights(uy - iy, wy)
            _slopes(ux - ix, dx)
            _slopes(uy - iy, dy)
            _bends(ux - ix, bx)
            _bends(uy - iy, by)
            away_x, away_y = at_x - pivot[0], at_y - pivot[1]
            from_pivot = max(away_x * away_x + away_y * away_y, 1.0)
            for channel in range(planes):
                level, along_x, along_y, xx, xy, yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
                for j in range(4):
                    for i in range(4):
                        q = coefficients[channel, iy + j, ix + i]
                        level += wx[i] * wy[j] * q
                        along_x += dx[i] * wy[j] * q
                        along_y += wx[i] * dy[j] * q
                        xx += bx[i] * wy[j] * q
                        xy += dx[i] * dy[j] * q
                        yy += wx[i] * by[j] * q
                along_x *= g * scale
                along_y *= g * scale
                slope[0] = along_y * away_x - along_x * away_y
                slope[1] = along_x
                slope[2] = along_y
                rising = along_x * across[0] + along_y * across[1]
                slope[3] = rising * (x - side / 2)
                slope[4] = rising * (y - side / 2)
                bright[0] = g * level
                bent = away_y * away_y * xx - 2.0 * away_x * away_y * xy + away_x * away_x * yy
                bright[2] = g * scale * scale * bent / from_pivot
                residual = values[m, channel] - g * level
                squares[k] += residual * residual
                counts[k] += 1
                for a in range(5):
                    gradient[a] += slope[a] * residual
                    for b in range(a, 5):
                        normal[a, b] += slope[a] * slope[b]
                for a in range(3):
                    light_gradient[channel, a] += bright[a] * residual
                    for b in range(3):
                        light[channel, a, b] += bright[a] * bright[b]
                    for b in range(5):
                        cross[channel, a, b] += bright[a] * slope[b]
        if counts[k] < 30:
            counts[k] = 0
            squares[k] = 0.0
            continue
        for a in range(5):
            for b in range(a):
                normal[a, b] = normal[b, a]
        # Eliminate the view's brightness and blur.
        for channel in range(planes):
            light_normal = light[channel] + 1e-9 * np.eye(3)
            eliminated = np.linalg.solve(light_normal, cross[channel])
            fitted_light = np.linalg.solve(light_normal, light_gradient[channel])
            normal -= cross[channel].T @ eliminated
            gradient -= eliminated.T @ light_gradient[channel]
            squares[k] -= light_gradient[channel] @ fitted_light
            lights[k, channel] = fitted_light
        normals[k], gradients[k] = normal, gradient
    return normals, gradients, squares, counts, lights
