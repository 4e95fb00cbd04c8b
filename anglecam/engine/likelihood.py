"""How much better a frame is explained with a body in a pose than without it: the sum over the body's pixels.

    L(pose) = Σᵢ log p(picture(xᵢ) | body's pixel i) − log p(picture(xᵢ) | background at xᵢ),     xᵢ = pose(yᵢ)

Pixels that the body does not cover are the same in both explanations and cancel. Pixels that are unknown, NaN, say
nothing for either.
"""

from __future__ import annotations

from math import exp, log, pi, sqrt

import numpy as np
from numba import njit

_OUTLIERS = 0.02
"""Share of pixels that may have any of 256 grey levels: an occluder, a glint."""


@njit("float32[:, ::1](float32[:, ::1], float32[:, ::1], float32[:, ::1])", cache=True, nogil=True)
def log_density(picture, mean, variance):  # type: ignore[no-untyped-def]
    """Return the log density of each pixel: normal, and a share that may have any of 256 grey levels.

    Parameters
    ----------
    picture, mean, variance : ndarray
        (h, w) float32; grey levels, and grey levels².
    """
    result = np.empty_like(picture)
    floor, unknown = np.float32(_OUTLIERS / 256.0), np.float32(log(1.0 / 256.0))
    scale, half = np.float32((1.0 - _OUTLIERS) / sqrt(2.0 * pi)), np.float32(-0.5)
    for i in range(picture.shape[0]):
        for j in range(picture.shape[1]):
            off, spread = picture[i, j] - mean[i, j], variance[i, j]
            if not (off * off >= 0.0 and spread > 0.0):
                result[i, j] = unknown
                continue
            result[i, j] = log(scale / sqrt(spread) * exp(half * off * off / spread) + floor)
    return result


@njit(
    "void(float32[:, ::1], float32[:, ::1], float32[:, ::1], float32[:, ::1], float32, float32[:, ::1], "
    "float32[:, ::1])",
    cache=True,
    nogil=True,
    fastmath={"nsz", "arcp", "contract", "afn", "reassoc"},  # all but that no value is NaN
    error_model="numpy",
)
def add_gain(gain, picture, body, body_variance, excess, background, background_variance):  # type: ignore[no-untyped-def]
    """Add to ``gain`` (h, w) the log density of each pixel of a body over that of the background.

    Parameters
    ----------
    gain, picture, body, body_variance : ndarray
        (h, w) float32; grey levels, and grey levels². Where the picture is NaN nothing is added. Where a mean is, any
        grey level is as probable.
    excess : float
        By how much the variance of a pixel is larger in this picture than usual, grey levels².
    background, background_variance : ndarray
        (h, w) float32, the same of the background.
    """
    scale = (1.0 - _OUTLIERS) / sqrt(2.0 * pi)
    floor, unknown, half = np.float32(_OUTLIERS / 256.0 / scale), np.float32(1.0 / 256.0 / scale), np.float32(-0.5)
    for i in range(gain.shape[0]):
        for j in range(gain.shape[1]):
            seen = picture[i, j]
            if not seen * seen >= 0.0:
                continue
            off, off_behind = seen - body[i, j], seen - background[i, j]
            as_body, as_background = unknown, unknown
            if off * off >= 0.0:
                sharp = np.float32(1.0) / (body_variance[i, j] + excess)
                as_body = sqrt(sharp) * exp(half * off * off * sharp) + floor
            if off_behind * off_behind >= 0.0:
                sharp = np.float32(1.0) / (background_variance[i, j] + excess)
                as_background = sqrt(sharp) * exp(half * off_behind * off_behind * sharp) + floor
            gain[i, j] += log(as_body / as_background)


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
    fastmath={"nsz", "arcp", "contract", "afn", "reassoc"},  # all but that no value is NaN
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
        (h, w) float32, its mean, grey levels.
    precision : ndarray
        (h, w) float32, inverse variance of its pixels in this picture, 1/grey levels².
    excess : float
        By how much the variance of a pixel is larger in this picture than usual, grey levels².
    places : ndarray
        (n, 2) float32, the body's pixels in its own coordinates.
    body : ndarray
        (n, 2) float32, their mean, grey levels, and variance, grey levels².
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
    gains = np.zeros((len(poses), parts))
    floor = np.float32(_OUTLIERS / 256.0 * sqrt(2.0 * pi) / (1.0 - _OUTLIERS))
    half = np.float32(-0.5)
    n = len(places)
    sharp = np.empty(n, np.float32)
    for i in range(n):
        sharp[i] = np.float32(1.0) / (body[i, 1] + excess)
    for m in range(len(poses)):
        a, b, c = np.float32(poses[m, 0, 0]), np.float32(poses[m, 0, 1]), np.float32(poses[m, 0, 2])
        d, e, f = np.float32(poses[m, 1, 0]), np.float32(poses[m, 1, 1]), np.float32(poses[m, 1, 2])
        for i in range(n):
            x = a * places[i, 0] + b * places[i, 1] + c
            y = d * places[i, 0] + e * places[i, 1] + f
            if x < 0.0 or y < 0.0 or x >= width - 1 or y >= height - 1:
                continue
            seen = _between(picture, x, y)
            off = seen - body[i, 0]
            if not off * off >= 0.0:
                continue
            off_behind = seen - _between(background, x, y)
            behind = precision[int(y + np.float32(0.5)), int(x + np.float32(0.5))]
            as_body = sqrt(sharp[i]) * exp(half * off * off * sharp[i]) + floor
            as_background = sqrt(behind) * exp(half * off_behind * off_behind * behind) + floor
            gains[m, part[i]] += log(as_body / as_background)
    return gains
