"""How much better a frame is explained with a body in a pose than without it: the sum over the body's pixels.

    L(pose) = Σᵢ log p(picture(xᵢ) | body's pixel i) − log p(picture(xᵢ) | background at xᵢ),     xᵢ = pose(yᵢ)

Pixels that the body does not cover are the same in both explanations and cancel. Pixels that are unknown, NaN, say
nothing for either.
"""

from __future__ import annotations

from math import log, pi, sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray

_OUTLIERS = 0.02
"""Share of pixels that may have any of 256 grey levels: an occluder, a glint."""
_SCALE = (1.0 - _OUTLIERS) / sqrt(2.0 * pi)
"""Of the normal part of the density."""
_FLOOR = np.float32(_OUTLIERS / 256.0 / _SCALE)
_UNKNOWN = np.float32(1.0 / 256.0 / _SCALE)
_HALF = np.float32(-0.5)
_SMALLEST = np.float32(-25.0)
"""Exponents below it are that; the floor is 10⁷ times larger."""
_TOGETHER = 64
"""Ratios of densities, each between 10⁻⁴ and 10⁴, whose product a double holds: one logarithm serves them all."""
_MATHS = {"nsz", "arcp", "contract", "afn", "reassoc"}  # all but that no value is NaN


@njit(inline="always")
def _exp(z):  # type: ignore[no-untyped-def]
    """Return e to a power that is not positive: (e^(z/64))^64, within 10⁻⁵ of it, by many pixels at once."""
    x = max(z, _SMALLEST) * np.float32(1.0 / 64.0)
    e = np.float32(1.0 / 24.0) + x * (np.float32(1.0 / 120.0) + x * np.float32(1.0 / 720.0))
    e = np.float32(1.0) + x * (np.float32(1.0) + x * (np.float32(0.5) + x * (np.float32(1.0 / 6.0) + x * e)))
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    e = e * e
    return e * e


@njit(inline="always")
def _density(off, precision):  # type: ignore[no-untyped-def]
    """Return the density at a distance from the mean, over `_SCALE`."""
    return sqrt(precision) * _exp(_HALF * off * off * precision) + _FLOOR


def log_density(
    picture: NDArray[np.float32], mean: NDArray[np.float32], variance: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return the log density of each pixel: normal, and a share that may have any of 256 grey levels.

    Parameters
    ----------
    picture, mean, variance : ndarray
        (h, w) float32; grey levels, and grey levels².
    """
    density = _densities(picture, mean, variance)
    return np.log(density, out=density)


@njit("float32[:, ::1](float32[:, ::1], float32[:, ::1], float32[:, ::1])", cache=True, nogil=True, error_model="numpy")
def _densities(picture, mean, variance):  # type: ignore[no-untyped-def]
    result = np.empty_like(picture)
    scale = np.float32(_SCALE)
    for i in range(picture.shape[0]):
        for j in range(picture.shape[1]):
            off = picture[i, j] - mean[i, j]
            density = _density(off, np.float32(1.0) / variance[i, j])
            known = off * off >= 0.0 and variance[i, j] > 0.0
            result[i, j] = scale * (density if known else _UNKNOWN)
    return result


@njit(
    "void(float64[:, ::1], float32[:, ::1], float32[:, ::1], float32[:, ::1], float32, float32[:, ::1], "
    "float32[:, ::1])",
    cache=True,
    nogil=True,
    fastmath=_MATHS,
    error_model="numpy",
)
def multiply_odds(odds, picture, body, body_variance, excess, background, background_variance):  # type: ignore[no-untyped-def]
    """Multiply ``odds`` (h, w) with the density of each pixel of a body over that of the background.

    Parameters
    ----------
    odds : ndarray
        (h, w) float64, the product over some pictures, `_TOGETHER` at most.
    picture, body, body_variance : ndarray
        (h, w) float32; grey levels, and grey levels². Where the picture is NaN nothing changes. Where a mean is, any
        grey level is as probable.
    excess : float
        By how much the variance of a pixel is larger in this picture than usual, grey levels².
    background, background_variance : ndarray
        (h, w) float32, the same of the background.
    """
    for i in range(odds.shape[0]):
        for j in range(odds.shape[1]):
            seen = picture[i, j]
            off, off_behind = seen - body[i, j], seen - background[i, j]
            as_body = _density(off, np.float32(1.0) / (body_variance[i, j] + excess))
            as_background = _density(off_behind, np.float32(1.0) / (background_variance[i, j] + excess))
            as_body = as_body if off * off >= 0.0 else _UNKNOWN
            as_background = as_background if off_behind * off_behind >= 0.0 else _UNKNOWN
            odds[i, j] *= as_body / as_background if seen * seen >= 0.0 else np.float32(1.0)


@njit(inline="always")
def _between(picture, x, y):  # type: ignore[no-untyped-def]
    """Interpolate linearly; the place lies inside."""
    column, row = int(x), int(y)
    u, v = x - np.float32(column), y - np.float32(row)
    above = picture[row, column] + u * (picture[row, column + 1] - picture[row, column])
    below = picture[row + 1, column] + u * (picture[row + 1, column + 1] - picture[row + 1, column])
    return above + v * (below - above)


@njit(
    "float64[:, ::1](float32[:, ::1], float32[:, ::1], float32[:, ::1], float32, float32[:, ::1], float32[:, ::1], "
    "int64[::1], int64, float64[:, :, ::1])",
    cache=True,
    nogil=True,
    fastmath=_MATHS,
    error_model="numpy",
)
def pose_gains(picture, background, precision, excess, places, body, part, parts, poses):  # type: ignore[no-untyped-def]
    """Return the gain L of each pose, by parts of the body.

    Between pixels, picture and background are interpolated alike, which averages the noise of either.

    Parameters
    ----------
    picture : ndarray
        (h, w) float32; NaN where it is unknown.
    background : ndarray
        (h, w) float32, its mean, grey levels. Where it is NaN, any grey level is as probable.
    precision : ndarray
        (h, w) float32, inverse variance of its pixels in this picture, 1/grey levels².
    excess : float
        By how much the variance of a pixel is larger in this picture than usual, grey levels².
    places : ndarray
        (n, 2) float32, the body's pixels in its own coordinates.
    body : ndarray
        (n, 4) float32, their mean, grey levels, and variance, grey levels²; cosine and sine of the turn add two more
        columns, grey levels, to the mean.
    part : ndarray
        (n,) part to which each of them belongs.
    parts : int
        Number of parts.
    poses : ndarray
        (m, 2, 3) from the body's coordinates to the picture.

    Returns
    -------
    ndarray
        (m, parts) nats.
    """
    height, width = picture.shape
    gains, product = np.zeros((len(poses), parts)), np.ones(parts)
    n = len(places)
    sharp = np.float32(1.0) / (body[:, 1] + excess)
    off, off_behind, precise, behind = np.empty((4, n), np.float32)
    of_part = np.empty(n, np.int64)
    for m in range(len(poses)):
        a, b, c = np.float32(poses[m, 0, 0]), np.float32(poses[m, 0, 1]), np.float32(poses[m, 0, 2])
        d, e, f = np.float32(poses[m, 1, 0]), np.float32(poses[m, 1, 1]), np.float32(poses[m, 1, 2])
        shown = 0
        for i in range(n):
            x = a * places[i, 0] + b * places[i, 1] + c
            y = d * places[i, 0] + e * places[i, 1] + f
            if x < 0.0 or y < 0.0 or x >= width - 1 or y >= height - 1:
                continue
            seen = _between(picture, x, y)
            off[shown] = seen - (body[i, 0] + a * body[i, 2] + b * body[i, 3])
            if not off[shown] * off[shown] >= 0.0:
                continue
            off_behind[shown] = seen - _between(background, x, y)
            precise[shown], of_part[shown] = sharp[i], part[i]
            behind[shown] = precision[int(y + np.float32(0.5)), int(x + np.float32(0.5))]
            shown += 1
        for i in range(shown):
            as_background = _density(off_behind[i], behind[i])
            known = off_behind[i] * off_behind[i] * behind[i] >= 0.0
            off[i] = _density(off[i], precise[i]) / (as_background if known else _UNKNOWN)
        for first in range(0, shown, _TOGETHER):
            for i in range(first, min(first + _TOGETHER, shown)):
                product[of_part[i]] *= off[i]
            for k in range(parts):
                gains[m, k] += log(product[k])
                product[k] = 1.0
    return gains
