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
def _between(picture, at, below, across, down):  # type: ignore[no-untyped-def]
    """Interpolate linearly between the pixels ``at`` and ``below``, and the ones to their right, of a flat picture."""
    next_to = np.uint32(1)
    upper = picture[at] + across * (picture[at + next_to] - picture[at])
    lower = picture[below] + across * (picture[below + next_to] - picture[below])
    return upper + down * (lower - upper)


@njit(
    "float64[:, ::1](float32[:, ::1], float32[:, ::1], float32[:, ::1], float32, float32[:, ::1], float32[:, ::1], "
    "int64[::1], float64[:, :, ::1])",
    cache=True,
    nogil=True,
    fastmath=_MATHS,
    error_model="numpy",
)
def pose_gains(picture, background, precision, excess, places, body, ends, poses):  # type: ignore[no-untyped-def]
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
        (2, n) float32, the body's pixels in its own coordinates, one part after the other.
    body : ndarray
        (4, n) float32, their mean, grey levels, and variance, grey levels²; cosine and sine of the turn add the two
        other rows, grey levels, to the mean.
    ends : ndarray
        (parts,) number of pixels of each part and those before it.
    poses : ndarray
        (m, 2, 3) from the body's coordinates to the picture.

    Returns
    -------
    ndarray
        (m, parts) nats.
    """
    height, width = picture.shape
    n, parts = places.shape[1], len(ends)
    gains = np.zeros((len(poses), parts))
    # rows that are arrays of their own and indices without a sign: otherwise the loops are checked and not vectorised
    x_of, y_of, mean, with_cosine, with_sine = places[0], places[1], body[0], body[2], body[3]
    sharp = np.float32(1.0) / (body[1] + excess)
    pictured, behind, precisions = picture.ravel(), background.ravel(), precision.ravel()
    line, wide, high = np.int32(width), np.float32(width - 1), np.float32(height - 1)
    zero, half = np.float32(0.0), np.float32(0.5)
    across, down = np.empty(n, np.float32), np.empty(n, np.float32)
    corner, nearest = np.empty(n, np.int32), np.empty(n, np.int32)
    off, off_behind, precise, precise_behind = np.empty((4, n), np.float32)
    for m in range(len(poses)):
        a, b, c = np.float32(poses[m, 0, 0]), np.float32(poses[m, 0, 1]), np.float32(poses[m, 0, 2])
        d, e, f = np.float32(poses[m, 1, 0]), np.float32(poses[m, 1, 1]), np.float32(poses[m, 1, 2])
        # this loop reads no picture, so that the compiler turns it into instructions for many pixels at once
        for i in range(n):
            x = a * x_of[i] + b * y_of[i] + c
            y = d * x_of[i] + e * y_of[i] + f
            inside = (x >= zero) & (y >= zero) & (x < wide) & (y < high)
            x, y = x if inside else zero, y if inside else zero
            column, row = np.int32(x), np.int32(y)
            across[i], down[i] = x - np.float32(column), y - np.float32(row)
            corner[i] = row * line + column if inside else np.int32(-1)
            nearest[i] = np.int32(y + half) * line + np.int32(x + half)
        first = 0
        for k in range(parts):
            shown = 0
            for i in range(first, ends[k]):
                if corner[i] < 0:
                    continue
                at, below = np.uint32(corner[i]), np.uint32(corner[i] + line)
                seen = _between(pictured, at, below, across[i], down[i])
                away = seen - (mean[i] + a * with_cosine[i] + b * with_sine[i])
                if not away * away >= zero:
                    continue
                off[shown], precise[shown] = away, sharp[i]
                off_behind[shown] = seen - _between(behind, at, below, across[i], down[i])
                precise_behind[shown] = precisions[np.uint32(nearest[i])]
                shown += 1
            for i in range(shown):
                as_background = _density(off_behind[i], precise_behind[i])
                known = off_behind[i] * off_behind[i] * precise_behind[i] >= zero
                off[i] = _density(off[i], precise[i]) / (as_background if known else _UNKNOWN)
            for start in range(0, shown, _TOGETHER):
                product = 1.0
                for i in range(start, min(start + _TOGETHER, shown)):
                    product *= off[i]
                gains[m, k] += log(product)
            first = ends[k]
    return gains
