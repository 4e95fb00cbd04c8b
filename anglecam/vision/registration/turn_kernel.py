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


@njit(inline="always")
def _weights(u):  # type: ignore[no-untyped-def]
    v = _ONE - u
    near, far = (_THREE * u - _SIX) * u * u + _FOUR, (_THREE * v - _SIX) * v * v + _FOUR
    return v * v * v * _SIXTH, near * _SIXTH, far * _SIXTH, u * u * u * _SIXTH


@njit(inline="always")
def _slopes(u):  # type: ignore[no-untyped-def]
    v = _ONE - u
    return -v * v * _HALF, (_THREE * u - _FOUR) * u * _HALF, ((_TWO - _THREE * u) * u + _ONE) * _HALF, u * u * _HALF


@njit(inline="always")
def _bends(u):  # type: ignore[no-untyped-def]
    return _ONE - u, _THREE * u - _TWO, _ONE - _THREE * u, u


@njit(inline="always")
def _dot(w, block, row, k):  # type: ignore[no-untyped-def]
    at = row * _BLOCK + k
    return w[0] * block[at] + w[1] * block[at + _BLOCK] + w[2] * block[at + 2 * _BLOCK] + w[3] * block[at + 3 * _BLOCK]


@njit("(float32[::1], int64, int64[::1], int64, float32[::1], int64)", cache=True, fastmath=_FAST)
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


@njit("(float32[::1], float32, float32, float32, int64)", cache=True, fastmath=_FAST)
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


@njit("(float32[::1], float32[::1], int64)", cache=True, fastmath=_FAST)
def _product(one, other, pixels):  # type: ignore[no-untyped-def]
    total = _ONE - _ONE
    for k in range(pixels):
        total += one[k] * other[k]
    return total


@njit("(float64[:, ::1], float64[::1])", cache=True, fastmath=_FAST)
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


@njit("()", cache=True)
def _new_block():  # type: ignore[no-untyped-def]
    block = np.zeros(_ROWS * _BLOCK, np.float32)
    block[(_DESIGN + 6) * _BLOCK : (_DESIGN + 7) * _BLOCK] = 1.0
    return block


@njit(inline="always")
def _put(block, which, base, pixels, m, x, y, scale, side, n, gain, away_x, away_y):  # type: ignore[no-untyped-def]
    """Write the pixel with the number m, at (x, y) on its tile, into a block."""
    ix, iy = int(x * scale), int(y * scale)
    which[pixels], base[pixels] = m, iy * n + ix
    block[_U * _BLOCK + pixels], block[_V * _BLOCK + pixels] = x * scale - ix, y * scale - iy
    block[_GAIN * _BLOCK + pixels] = gain
    block[_AWAY_X * _BLOCK + pixels], block[_AWAY_Y * _BLOCK + pixels] = away_x, away_y
    block[_RIGHT * _BLOCK + pixels], block[_DOWN * _BLOCK + pixels] = x - side / 2, y - side / 2


@njit(inline="always")
def _put_values(block, values, which, channel, pixels):  # type: ignore[no-untyped-def]
    """Write one plane of a block's pixels into the residual's row."""
    for q in range(pixels):
        block[(_DESIGN + 8) * _BLOCK + q] = values[which[q], channel]


@njit(inline="always")
def _columns(start, stop, first, slope, side):  # type: ignore[no-untyped-def]
    """Narrow a range of columns to those, and one more on each side, whose place first + slope·x is on a tile."""
    if abs(slope) < 1e-9:
        return start, stop if -1.0 < first < side + 1.0 else start
    one, other = -first / slope, (side - first) / slope
    low, high = min(one, other), max(one, other)
    return max(start, int(max(low, 0.0)) - 1), min(stop, int(max(high, 0.0)) + 2)


@njit(
    "(float32[::1], int64, int64[::1], int64, float32[::1], float64[::1], float64, float64[:, :, ::1], int64, int64)",
    cache=True,
    fastmath=_FAST,
)
def _add_products(flat, first, base, n, block, rise, scale, products, channel, pixels):  # type: ignore[no-untyped-def]
    """Add one plane of a block of pixels, whose values `_put_values` has written, to the products of derivatives."""
    design = block[_DESIGN * _BLOCK :].reshape(9, _BLOCK)
    _evaluate(flat, first, base, n, block, pixels)
    _differentiate(block, np.float32(rise[0]), np.float32(rise[1]), np.float32(scale), pixels)
    leans = rise[0] != 0.0 or rise[1] != 0.0  # else all derivatives by them are zero
    for a in range(9):
        for b in range(a, 9):
            if leans or not (3 <= a < 5 or 3 <= b < 5):
                products[channel, a, b] += _product(design[a], design[b], pixels)


@njit("(float64[:, :, ::1], float64[:, ::1], float64[::1], float64[:, ::1])", cache=True, fastmath=_FAST)
def _sum_planes(products, normal, gradient, lights):  # type: ignore[no-untyped-def]
    """Eliminate the light of each plane, add the planes' normal equations, and return the sum of squares."""
    squares = 0.0
    for channel in range(len(products)):
        product = products[channel]
        _eliminate_light(product, lights[channel])
        for a in range(5):
            for b in range(5):
                normal[a, b] += product[a, b]
            gradient[a] += product[a, 8]
        squares += product[8, 8]
    return squares


@njit(
    "(float32[:, ::1], int64[::1], float64[:, ::1], float64[:, ::1], float64[::1], float64[:, ::1], int64, "
    "float64[:, :, :, ::1])",
    cache=True,
    nogil=True,
    fastmath=_FAST,
)
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
    block = _new_block()
    base, which, products = np.zeros(_BLOCK, np.int64), np.zeros(_BLOCK, np.int64), np.zeros((planes, 9, 9))
    flat, scale = splines.reshape(-1).astype(np.float32), (n - 3) / side
    for k in range(views):
        p = k if len(splines) > 1 else 0
        products[:] = 0.0
        count, m = 0, starts[k]
        while m < starts[k + 1]:
            pixels = 0
            while m < starts[k + 1] and pixels < _BLOCK:
                x, y = places[m, 0], places[m, 1]
                # Half a pixel inside the tile, where data on all sides determine the spline.
                if x >= 0.5 and y >= 0.5 and x < side - 0.5 and y < side - 0.5:
                    _put(block, which, base, pixels, m, x, y, scale, side, n, gains[m], away[m, 0], away[m, 1])
                    pixels += 1
                m += 1
            count += pixels
            for channel in range(planes):
                first = (p * planes + channel) * n * n
                _put_values(block, values, which, channel, pixels)
                _add_products(flat, first, base, n, block, rises[k], scale, products, channel, pixels)
        if count * planes < _FEWEST:
            continue
        counts[k] = count * planes
        squares[k] = _sum_planes(products, normals[k], gradients[k], lights[k])
    return normals, gradients, squares, counts, lights


@njit(
    "(uint8[:, :, ::1], float64[:, :, ::1], float64[:, ::1], float64, float64, float64, float64, "
    "float64[:, ::1], float64[:, ::1], float64[:, ::1], int64, float32[:, :, :, ::1], float64[:, :, ::1], "
    "float64[::1], float64[:, ::1])",
    cache=True,
    nogil=True,
    fastmath=_FAST,
)
def frame_equations(  # type: ignore[no-untyped-def]
    image,
    ground,
    middles,
    reach,
    turn,
    late,
    row,
    from_pivots,
    pivots,
    corners,
    side,
    splines,
    all_gains,
    parallax,
    leans,
):
    """Accumulate the normal equations of tiles in one frame, straight from its pixels.

    Parameters
    ----------
    image : ndarray
        (h, w, planes) bytes.
    ground : ndarray
        (h, w, 2) place of each pixel in the plane of motion, px; of another shape where that is the pixel's place in
        the picture.
    middles : ndarray
        (tiles, 2) about where the tiles are in the picture, px.
    reach : float
        Distance along both axes from there within which a tile's pixels are, px.
    turn : float
        Of the body from the reference frame, rad.
    late : float
        Rotation of the body while the rolling shutter advances by one row, rad.
    row : float
        Row whose exposure ``turn`` refers to.
    from_pivots, pivots : ndarray
        (tiles, 2) the tiles' centres of rotation in this frame and in the reference frame, px.
    corners : ndarray
        (tiles, 2) upper left corners in the reference frame, px.
    side : int
        Side of a tile, px.
    splines : ndarray
        (tiles, planes, n, n) coefficients in single precision, y first.
    all_gains : ndarray
        (tiles, powers, 3) coefficients of the gain.
    parallax : ndarray
        (2,) displacement of the centre for each px of height.
    leans : ndarray
        (tiles, 2) gradient of the height over the tile.

    Returns
    -------
    tuple of ndarray
        As from `turn_equations`, a view for each tile.
    """
    tiles, planes, n = len(corners), splines.shape[1], splines.shape[2]
    height, width = image.shape[:2]
    normals, gradients = np.zeros((tiles, 5, 5)), np.zeros((tiles, 5))
    squares, counts, lights = np.zeros(tiles), np.zeros(tiles, dtype=np.int64), np.zeros((tiles, planes, 3))
    block = _new_block()
    base, which, products = np.zeros(_BLOCK, np.int64), np.zeros(_BLOCK, np.int64), np.zeros((planes, 9, 9))
    values, flat, scale, half = image.reshape(height * width, planes), splines.reshape(-1), (n - 3) / side, side / 2
    rise, as_filmed = np.zeros(2), ground.shape[0] == height
    for t in range(tiles):
        products[:] = 0.0
        # a point that is higher than its tile by δ is displaced by (1 − R)·p·δ, and δ = lean·(point − middle)
        c, s = np.cos(turn), np.sin(turn)
        rise[0] = (1 - c) * parallax[0] + s * parallax[1]
        rise[1] = (1 - c) * parallax[1] - s * parallax[0]
        rest = 1 - leans[t, 0] * rise[0] - leans[t, 1] * rise[1]
        lean_x, lean_y = leans[t, 0] / rest, leans[t, 1] / rest
        square = not as_filmed and rise[0] == 0.0 and rise[1] == 0.0
        top, bottom = max(0, int(middles[t, 1] - reach)), min(height, int(middles[t, 1] + reach) + 2)
        left, right = max(0, int(middles[t, 0] - reach)), min(width, int(middles[t, 0] + reach) + 2)
        count, pixels = 0, 0
        for y in range(top, bottom):
            cl, sl = c, s
            if late != 0.0:  # a row exposed later shows the body rotated further
                cl, sl = np.cos(turn + late * (y - row)), np.sin(turn + late * (y - row))
            start, stop = left, right
            if square:
                at_x = pivots[t, 0] - corners[t, 0] - cl * from_pivots[t, 0] - sl * (y - from_pivots[t, 1])
                at_y = pivots[t, 1] - corners[t, 1] - sl * from_pivots[t, 0] + cl * (y - from_pivots[t, 1])
                start, stop = _columns(start, stop, at_x, cl, side)
                start, stop = _columns(start, stop, at_y, sl, side)
            for x in range(start, stop):
                gx, gy = float(x), float(y)
                if as_filmed:
                    gx, gy = ground[y, x, 0], ground[y, x, 1]
                gx, gy = gx - from_pivots[t, 0], gy - from_pivots[t, 1]
                away_x, away_y = cl * gx - sl * gy, sl * gx + cl * gy
                at_x, at_y = pivots[t, 0] + away_x - corners[t, 0], pivots[t, 1] + away_y - corners[t, 1]
                higher = lean_x * (at_x - half) + lean_y * (at_y - half)
                at_x, at_y = at_x + rise[0] * higher, at_y + rise[1] * higher
                # Half a pixel inside the tile, where data on all sides determine the spline.
                if not (at_x >= 0.5 and at_y >= 0.5 and at_x < side - 0.5 and at_y < side - 0.5):
                    continue
                gain, power = 1.0, 1.0
                for k in range(all_gains.shape[1]):
                    power *= turn
                    along_x, along_y = all_gains[t, k, 1] * (at_x / half - 1), all_gains[t, k, 2] * (at_y / half - 1)
                    gain += power * (all_gains[t, k, 0] + along_x + along_y)
                m = y * width + x
                _put(block, which, base, pixels, m, at_x, at_y, scale, side, n, gain, away_x, away_y)
                pixels += 1
                if pixels == _BLOCK:
                    for channel in range(planes):
                        first = (t * planes + channel) * n * n
                        _put_values(block, values, which, channel, pixels)
                        _add_products(flat, first, base, n, block, rise, scale, products, channel, pixels)
                    count, pixels = count + pixels, 0
        for channel in range(planes):
            first = (t * planes + channel) * n * n
            _put_values(block, values, which, channel, pixels)
            _add_products(flat, first, base, n, block, rise, scale, products, channel, pixels)
        count += pixels
        if count * planes < _FEWEST:
            continue
        counts[t] = count * planes
        squares[t] = _sum_planes(products, normals[t], gradients[t], lights[t])
    return normals, gradients, squares, counts, lights
