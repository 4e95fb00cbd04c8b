"""Compiled sums over pixels for the turn of views: the fit of cubic B-splines, by their derivatives.

A block of pixels is a set of rows at fixed distances in one array, which lets the compiler work on several pixels at
once. Numbers of 32 bits suffice for pixels, of which twice as many are worked on at once; sums over blocks have 64. No
compiled function here calls one of another file, so that the compiler's cache is never out of date.
"""

from __future__ import annotations

import numpy as np
from numba import njit

_BLOCK = 136
"""Pixels of a block: its rows fit into a processor's first cache."""
_U, _V, _GAIN, _AWAY_X, _AWAY_Y, _RIGHT, _DOWN = range(7)
"""Rows of a block: place between knots, gain, distance from the pivot, distance from the tile's middle."""
_LEVEL, _ALONG_X, _ALONG_Y, _XX, _XY, _YY = range(7, 13)
"""Spline and its derivatives by the place in knots."""
_NEAR = 13
"""The 4 × 4 coefficients around the pixel."""
_DESIGN = 29
"""Derivatives by turn, x, y and two leans; by brightness, offset and blur; and the residual."""
_ROWS = 38
_FEWEST = 30
"""Values of a view, fewer of which determine nothing."""
_FAST = {"contract", "reassoc", "nsz"}
"""What the compiler may do with sums: their order and rounding are free, NaN and infinity keep their meaning."""


_ONE, _TWO, _THREE, _FOUR, _SIX, _HALF, _SIXTH = (np.float32(c) for c in (1.0, 2.0, 3.0, 4.0, 6.0, 0.5, 1.0 / 6.0))
"""A constant of 64 bits would make everything that it is multiplied with as long."""


@njit(cache=True, inline="always")
def _weights(u):  # type: ignore[no-untyped-def]
    v = _ONE - u
    near, far = (_THREE * u - _SIX) * u * u + _FOUR, (_THREE * v - _SIX) * v * v + _FOUR
    return v * v * v * _SIXTH, near * _SIXTH, far * _SIXTH, u * u * u * _SIXTH


@njit(cache=True, inline="always")
def _slopes(u):  # type: ignore[no-untyped-def]
    v = _ONE - u
    return -v * v * _HALF, (_THREE * u - _FOUR) * u * _HALF, ((_TWO - _THREE * u) * u + _ONE) * _HALF, u * u * _HALF


@njit(cache=True, inline="always")
def _bends(u):  # type: ignore[no-untyped-def]
    return _ONE - u, _THREE * u - _TWO, _ONE - _THREE * u, u


@njit(cache=True, inline="always")
def _dot(w, block, row, k):  # type: ignore[no-untyped-def]
    at = row * _BLOCK + k
    return w[0] * block[at] + w[1] * block[at + _BLOCK] + w[2] * block[at + 2 * _BLOCK] + w[3] * block[at + 3 * _BLOCK]


@njit(cache=True, fastmath=_FAST)
def _evaluate(splines, first, base, n, block, pixels):  # type: ignore[no-untyped-def]
    """Write the spline that starts at ``first`` and its derivatives; ``base`` is each pixel's first coefficient."""
    for k in range(pixels):
        at = first + base[k]
        for j in range(4):
            for i in range(4):
                block[(_NEAR + 4 * j + i) * _BLOCK + k] = splines[at + j * n + i]
    for k in range(pixels):
        u, v = block[_U * _BLOCK + k], block[_V * _BLOCK + k]
        wx, dx, bx = _weights(u), _slopes(u), _bends(u)
        wy, dy, by = _weights(v), _slopes(v), _bends(v)
        w0, d0, b0 = _dot(wx, block, _NEAR, k), _dot(dx, block, _NEAR, k), _dot(bx, block, _NEAR, k)
        w1, d1, b1 = _dot(wx, block, _NEAR + 4, k), _dot(dx, block, _NEAR + 4, k), _dot(bx, block, _NEAR + 4, k)
        w2, d2, b2 = _dot(wx, block, _NEAR + 8, k), _dot(dx, block, _NEAR + 8, k), _dot(bx, block, _NEAR + 8, k)
        w3, d3, b3 = _dot(wx, block, _NEAR + 12, k), _dot(dx, block, _NEAR + 12, k), _dot(bx, block, _NEAR + 12, k)
        block[_LEVEL * _BLOCK + k] = wy[0] * w0 + wy[1] * w1 + wy[2] * w2 + wy[3] * w3
        block[_ALONG_X * _BLOCK + k] = wy[0] * d0 + wy[1] * d1 + wy[2] * d2 + wy[3] * d3
        block[_ALONG_Y * _BLOCK + k] = dy[0] * w0 + dy[1] * w1 + dy[2] * w2 + dy[3] * w3
        block[_XX * _BLOCK + k] = wy[0] * b0 + wy[1] * b1 + wy[2] * b2 + wy[3] * b3
        block[_XY * _BLOCK + k] = dy[0] * d0 + dy[1] * d1 + dy[2] * d2 + dy[3] * d3
        block[_YY * _BLOCK + k] = by[0] * w0 + by[1] * w1 + by[2] * w2 + by[3] * w3


@njit(cache=True, fastmath=_FAST)
def _differentiate(block, across_x, across_y, scale, pixels):  # type: ignore[no-untyped-def]
    """Write the derivatives and subtract the level from the values, which are in the residual's row."""
    for k in range(pixels):
        g, away_x, away_y = block[_GAIN * _BLOCK + k], block[_AWAY_X * _BLOCK + k], block[_AWAY_Y * _BLOCK + k]
        along_x, along_y = block[_ALONG_X * _BLOCK + k] * g * scale, block[_ALONG_Y * _BLOCK + k] * g * scale
        rising = along_x * across_x + along_y * across_y
        xx, xy, yy = block[_XX * _BLOCK + k], block[_XY * _BLOCK + k], block[_YY * _BLOCK + k]
        bent = away_y * away_y * xx - _TWO * away_x * away_y * xy + away_x * away_x * yy
        block[_DESIGN * _BLOCK + k] = along_y * away_x - along_x * away_y
        block[(_DESIGN + 1) * _BLOCK + k] = along_x
        block[(_DESIGN + 2) * _BLOCK + k] = along_y
        block[(_DESIGN + 3) * _BLOCK + k] = rising * block[_RIGHT * _BLOCK + k]
        block[(_DESIGN + 4) * _BLOCK + k] = rising * block[_DOWN * _BLOCK + k]
        block[(_DESIGN + 5) * _BLOCK + k] = g * block[_LEVEL * _BLOCK + k]
        block[(_DESIGN + 7) * _BLOCK + k] = g * scale * scale * bent / max(away_x * away_x + away_y * away_y, _ONE)
        block[(_DESIGN + 8) * _BLOCK + k] -= g * block[_LEVEL * _BLOCK + k]


@njit(cache=True, fastmath=_FAST)
def _product(one, other, pixels):  # type: ignore[no-untyped-def]
    total = _ONE - _ONE
    for k in range(pixels):
        total += one[k] * other[k]
    return total


@njit(cache=True, nogil=True)
def _eliminate_light(product, light):  # type: ignore[no-untyped-def]
    """Eliminate brightness, offset and blur from the upper triangle of normal equations (9, 9); write them."""
    for a in range(9):
        for b in range(a):
            product[a, b] = product[b, a]
    for p in range(5, 8):
        product[p, p] += 1e-9
    for p in range(5, 8):
        for a in range(9):
            if a < 5 or a > p:
                share = product[a, p] / product[p, p]
                for b in range(9):
                    product[a, b] -= share * product[p, b] if b < 5 or b > p else 0.0
    for p in (7, 6, 5):
        rest = product[p, 8]
        for q in range(p + 1, 8):
            rest -= product[p, q] * light[q - 5]
        light[p - 5] = rest / product[p, p]


@njit(cache=True, nogil=True, fastmath=_FAST)
def turn_equations(values, starts, places, away, gains, rises, side, splines):  # type: ignore[no-untyped-def]
    """Accumulate each view's normal equations for its turn, its centre's place and its lean, given the appearance.

    The view's brightness and blur are fitted too, for each plane, and eliminated.

    Parameters
    ----------
    values : ndarray
        (m, planes) grey levels of the pixels, view after view.
    starts : ndarray
        (views + 1,) index at which each view's pixels begin.
    places, away, gains, rises : ndarray
        From `anglecam.vision.registration.kernels.place_on_tiles`.
    side : int
        Side of a tile, px.
    splines : ndarray
        (tiles, planes, n, n) coefficients, y first: of one tile, or of one tile for each view.

    Returns
    -------
    tuple of ndarray
        The fields of `anglecam.vision.registration.appearance.TileFit`, in its order.
    """
    views, planes, n = len(starts) - 1, splines.shape[1], splines.shape[2]
    normals, gradients = np.zeros((views, 5, 5)), np.zeros((views, 5))
    squares, counts, lights = np.zeros(views), np.zeros(views, dtype=np.int64), np.zeros((views, planes, 3))
    block = np.zeros(_ROWS * _BLOCK, np.float32)
    design = block[_DESIGN * _BLOCK :].reshape(9, _BLOCK)
    design[6] = 1.0
    base, which, products = np.zeros(_BLOCK, np.int64), np.zeros(_BLOCK, np.int64), np.zeros((planes, 9, 9))
    flat, scale = splines.reshape(-1).astype(np.float32), (n - 3) / side
    for k in range(views):
        p = k if len(splines) > 1 else 0
        products[:] = 0.0
        leans = rises[k, 0] != 0.0 or rises[k, 1] != 0.0  # else all derivatives by them are zero
        count, m = 0, starts[k]
        while m < starts[k + 1]:
            pixels = 0
            while m < starts[k + 1] and pixels < _BLOCK:
                x, y = places[m, 0], places[m, 1]
                # Half a pixel inside the tile, where data on all sides determine the spline.
                if x >= 0.5 and y >= 0.5 and x < side - 0.5 and y < side - 0.5:
                    ix, iy = int(x * scale), int(y * scale)
                    which[pixels], base[pixels] = m, iy * n + ix
                    block[_U * _BLOCK + pixels], block[_V * _BLOCK + pixels] = x * scale - ix, y * scale - iy
                    block[_GAIN * _BLOCK + pixels] = gains[m]
                    block[_AWAY_X * _BLOCK + pixels], block[_AWAY_Y * _BLOCK + pixels] = away[m, 0], away[m, 1]
                    block[_RIGHT * _BLOCK + pixels], block[_DOWN * _BLOCK + pixels] = x - side / 2, y - side / 2
                    pixels += 1
                m += 1
            count += pixels
            for channel in range(planes):
                _evaluate(flat, (p * planes + channel) * n * n, base, n, block, pixels)
                for q in range(pixels):
                    design[8, q] = values[which[q], channel]
                _differentiate(block, np.float32(rises[k, 0]), np.float32(rises[k, 1]), np.float32(scale), pixels)
                for a in range(9):
                    for b in range(a, 9):
                        if leans or not (3 <= a < 5 or 3 <= b < 5):
                            products[channel, a, b] += _product(design[a], design[b], pixels)
        if count * planes < _FEWEST:
            continue
        counts[k] = count * planes
        for channel in range(planes):
            product = products[channel]
            _eliminate_light(product, lights[k, channel])
            normals[k] += product[:5, :5]
            gradients[k] += product[:5, 8]
            squares[k] += product[8, 8]
    return normals, gradients, squares, counts, lights
