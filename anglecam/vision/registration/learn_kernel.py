"""Compiled sums over pixels for learning the appearance of a tile, which is a cubic B-spline with a gain.

A pixel has a place on the tile, where its value is a weighted sum of the 4 × 4 coefficients around it. A weight is a
factor along x times one along y. So the product of two weights is one of ten products of factors along x times one of
ten along y, and their sums over pixels are sums of a hundred products of rows.

A block of pixels is a set of rows at fixed distances, which lets the compiler work on several pixels at once. The
pixels of a block lie between the same knots, or in the same view. No compiled function here calls one of another file,
so that the compiler's cache is never out of date.
"""

from __future__ import annotations

import numpy as np
from numba import njit

_BLOCK = 136
"""Pixels of a block: its rows fit into a processor's first cache."""
_PAIRS = 10
"""Products of two of the four factors along an axis."""
_FACTORS_X, _FACTORS_Y, _BY_X = 2 * _PAIRS, 2 * _PAIRS + 4, 2 * _PAIRS + 8
"""Rows of a block, behind the products along both axes: factors along both axes, and those along x times a value."""
_ROWS = 2 * _PAIRS + 12
_FAST = {"contract", "reassoc", "nsz"}
"""What the compiler may do with sums: their order and rounding are free, NaN and infinity keep their meaning."""


@njit(inline="always")
def _weights(u):  # type: ignore[no-untyped-def]
    v = 1 - u
    return v * v * v / 6, ((3 * u - 6) * u * u + 4) / 6, ((3 * v - 6) * v * v + 4) / 6, u * u * u / 6


@njit(inline="always")
def _write_pairs(rows, first, k, weights, factor):  # type: ignore[no-untyped-def]
    """Write the products of two weights, the first one's number rising slowest."""
    a, b, c, d = weights
    rows[first, k], rows[first + 1, k] = factor * a * a, factor * a * b
    rows[first + 2, k], rows[first + 3, k] = factor * a * c, factor * a * d
    rows[first + 4, k], rows[first + 5, k] = factor * b * b, factor * b * c
    rows[first + 6, k], rows[first + 7, k] = factor * b * d, factor * c * c
    rows[first + 8, k], rows[first + 9, k] = factor * c * d, factor * d * d


@njit(inline="always")
def _write_four(rows, first, k, weights):  # type: ignore[no-untyped-def]
    rows[first, k], rows[first + 1, k], rows[first + 2, k], rows[first + 3, k] = weights


@njit("(float64[:, ::1], int64, float64[:, ::1])", cache=True, fastmath=_FAST)
def _add_products(rows, pixels, products):  # type: ignore[no-untyped-def]
    """Add the sums over pixels of every row along x times every row along y."""
    for p in range(_PAIRS):
        x = rows[p]
        for q in (0, 5):
            at = _PAIRS + q
            y0, y1, y2, y3, y4 = rows[at], rows[at + 1], rows[at + 2], rows[at + 3], rows[at + 4]
            s0 = s1 = s2 = s3 = s4 = 0.0
            for k in range(pixels):
                s0 += x[k] * y0[k]
                s1 += x[k] * y1[k]
                s2 += x[k] * y2[k]
                s3 += x[k] * y3[k]
                s4 += x[k] * y4[k]
            products[p, q] += s0
            products[p, q + 1] += s1
            products[p, q + 2] += s2
            products[p, q + 3] += s3
            products[p, q + 4] += s4


@njit("(float64[:, ::1], int64, float64[:, ::1])", cache=True, fastmath=_FAST)
def _add_values(rows, pixels, values):  # type: ignore[no-untyped-def]
    """Add the sums over pixels of the value times each of the 4 × 4 weights, y first."""
    y0, y1, y2, y3 = rows[_FACTORS_Y], rows[_FACTORS_Y + 1], rows[_FACTORS_Y + 2], rows[_FACTORS_Y + 3]
    for i in range(4):
        x = rows[_BY_X + i]
        s0 = s1 = s2 = s3 = 0.0
        for k in range(pixels):
            s0 += x[k] * y0[k]
            s1 += x[k] * y1[k]
            s2 += x[k] * y2[k]
            s3 += x[k] * y3[k]
        values[0, i] += s0
        values[1, i] += s1
        values[2, i] += s2
        values[3, i] += s3


@njit("(float64[:, ::1], int64, int64, float64[:, ::1])", cache=True)
def _add_to_band(products, first, n, band):  # type: ignore[no-untyped-def]
    """Add the products of the 4 × 4 coefficients around a cell, the first of which is ``first``."""
    r = 0
    for upper in range(4):
        for lower in range(upper, 4):
            p, row, down = 0, first + upper * n, (lower - upper) * n
            for near in range(4):
                for far in range(near, 4):
                    band[row + near, down + far - near] += products[p, r]
                    if near < far and upper < lower:
                        band[row + far, down + near - far] += products[p, r]
                    p += 1
            r += 1


@njit(
    "(float32[:, ::1], float64[:, ::1], int64[::1], int64[::1], int64, int64)",
    cache=True,
    nogil=True,
    fastmath=_FAST,
)
def spline_equations(values, placed, order, begins, side, n):  # type: ignore[no-untyped-def]
    """Accumulate the normal equations for a tile's coefficients.

    Parameters
    ----------
    values : ndarray
        (m, planes) grey levels of the pixels.
    placed : ndarray
        (3, m) from `place_on_tile`.
    order, begins : ndarray
        From `sort_by_cell`.
    side : int
        Side of the tile, px.
    n : int
        Number of coefficients along a side.

    Returns
    -------
    tuple of ndarray
        (n², 3·n + 4) products of each coefficient's spline with itself and with those that come after it, by their
        distance (the matrix is symmetric), and (planes, n²) right sides.
    """
    planes, cells = values.shape[1], n - 3
    band, right, scale = np.zeros((n * n, 3 * n + 4)), np.zeros((planes, n * n)), cells / side
    rows, here = np.zeros((_ROWS, _BLOCK)), np.zeros((4, _BLOCK))
    products, of_values = np.zeros((_PAIRS, _PAIRS)), np.zeros((planes, 4, 4))
    for cell in range(cells * cells):
        begin, end = begins[cell], begins[cell + 1]
        if begin == end:
            continue
        products[:], of_values[:] = 0.0, 0.0
        iy, ix = divmod(cell, cells)
        while begin < end:
            pixels = min(end - begin, _BLOCK)
            for k in range(pixels):
                m = order[begin + k]
                here[0, k], here[1, k], here[2, k] = placed[0, m], placed[1, m], placed[2, m]
            for k in range(pixels):
                g, wx, wy = here[2, k], _weights(here[0, k] * scale - ix), _weights(here[1, k] * scale - iy)
                _write_pairs(rows, 0, k, wx, g * g)
                _write_pairs(rows, _PAIRS, k, wy, 1.0)
                _write_four(rows, _FACTORS_X, k, wx)
                _write_four(rows, _FACTORS_Y, k, wy)
            _add_products(rows, pixels, products)
            for channel in range(planes):
                for k in range(pixels):
                    here[3, k] = here[2, k] * values[order[begin + k], channel]
                for i in range(4):
                    for k in range(pixels):
                        rows[_BY_X + i, k] = here[3, k] * rows[_FACTORS_X + i, k]
                _add_values(rows, pixels, of_values[channel])
            begin += pixels
        first = iy * n + ix
        _add_to_band(products, first, n, band)
        for channel in range(planes):
            for j in range(4):
                for i in range(4):
                    right[channel, first + j * n + i] += of_values[channel, j, i]
    return band, right


@njit(
    "(float32[:, ::1], float64[:, ::1], int64[::1], int64[::1], int64, float64[:, :, ::1])",
    cache=True,
    nogil=True,
    fastmath=_FAST,
)
def _compare(values, placed, order, begins, side, coefficients):  # type: ignore[no-untyped-def]
    """Return (2, m) of each pixel, summed over the planes: the spline's square, and the spline times the residual."""
    planes, n = coefficients.shape[0], coefficients.shape[1]
    cells, compared, here = n - 3, np.zeros((2, placed.shape[1])), np.zeros((5, _BLOCK))
    scale = cells / side
    for cell in range(cells * cells):
        begin, end = begins[cell], begins[cell + 1]
        iy, ix = divmod(cell, cells)
        while begin < end:
            pixels = min(end - begin, _BLOCK)
            for k in range(pixels):
                m = order[begin + k]
                here[0, k], here[1, k] = placed[0, m] * scale - ix, placed[1, m] * scale - iy
            here[3:] = 0.0
            for channel in range(planes):
                for k in range(pixels):
                    here[2, k] = values[order[begin + k], channel]
                c0, c1 = coefficients[channel, iy, ix : ix + 4], coefficients[channel, iy + 1, ix : ix + 4]
                c2, c3 = coefficients[channel, iy + 2, ix : ix + 4], coefficients[channel, iy + 3, ix : ix + 4]
                for k in range(pixels):
                    wx, wy = _weights(here[0, k]), _weights(here[1, k])
                    level = wy[0] * (wx[0] * c0[0] + wx[1] * c0[1] + wx[2] * c0[2] + wx[3] * c0[3])
                    level += wy[1] * (wx[0] * c1[0] + wx[1] * c1[1] + wx[2] * c1[2] + wx[3] * c1[3])
                    level += wy[2] * (wx[0] * c2[0] + wx[1] * c2[1] + wx[2] * c2[2] + wx[3] * c2[3])
                    level += wy[3] * (wx[0] * c3[0] + wx[1] * c3[1] + wx[2] * c3[2] + wx[3] * c3[3])
                    here[3, k] += level * level
                    here[4, k] += level * (here[2, k] - level)
            for k in range(pixels):
                m = order[begin + k]
                compared[0, m], compared[1, m] = here[3, k], here[4, k]
            begin += pixels
    return compared


@njit(
    "(float32[:, ::1], float64[:, ::1], int64[::1], int64[::1], int64[::1], float64[::1], int64, float64[:, :, ::1])",
    cache=True,
    nogil=True,
    fastmath=_FAST,
)
def gain_equations(values, placed, order, begins, starts, turns, side, coefficients):  # type: ignore[no-untyped-def]
    """Accumulate the normal equations for a tile's gain, with the coefficients given.

    Parameters
    ----------
    values, placed, order, begins, side
        As in `spline_equations`.
    starts : ndarray
        (views + 1,) index at which each view's pixels begin.
    turns : ndarray
        (views,) rad.
    coefficients : ndarray
        (planes, n, n), y first.

    Returns
    -------
    tuple of ndarray
        Normal matrix (9, 9) and right side (9,), for constant, x and y of the first power of the turn, and so on.
    """
    compared = _compare(values, placed, order, begins, side, coefficients)
    normal, gradient, half = np.zeros((9, 9)), np.zeros(9), side / 2
    squares, products = np.empty((3, 3)), np.empty(3)
    for view in range(len(turns)):
        one = by_x = by_y = xx = xy = yy = rest = rest_x = rest_y = 0.0
        for m in range(starts[view], starts[view + 1]):
            x, y, square, product = placed[0, m] / half - 1, placed[1, m] / half - 1, compared[0, m], compared[1, m]
            one += square
            by_x += square * x
            by_y += square * y
            xx += square * x * x
            xy += square * x * y
            yy += square * y * y
            rest += product
            rest_x += product * x
            rest_y += product * y
        squares[0, 0], squares[0, 1], squares[0, 2] = one, by_x, by_y
        squares[1, 0], squares[1, 1], squares[1, 2] = by_x, xx, xy
        squares[2, 0], squares[2, 1], squares[2, 2] = by_y, xy, yy
        products[0], products[1], products[2] = rest, rest_x, rest_y
        for p in range(3):
            power = turns[view] ** (p + 1)
            scaled = power * products
            for a in range(3):
                gradient[3 * p + a] += scaled[a]
            for q in range(3):
                both = power * turns[view] ** (q + 1) * squares
                for a in range(3):
                    for b in range(3):
                        normal[3 * p + a, 3 * q + b] += both[a, b]
    return normal, gradient
