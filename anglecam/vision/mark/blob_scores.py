"""How much the blobs on a circle, one of each picture, are like a mark; compiled, as hundreds of circles are tried.

The score is the product of the share of pictures in which a blob is seen, of contrast, of how constant its size is, of
its size and travel, of how close the blobs lie to the circle, and of how distinctly their path is curved.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from anglecam.data.typing import Floats
from anglecam.vision.mark.blob_circles import MOVED_PX, TOLERANCE_PX
from anglecam.vision.mark.blobs import Blobs

_UNLIKE = 0.6
"""Largest difference of a blob from the drawn ones: the logarithms of the ratios of areas and of contrasts, added."""
_LEAST_CONTRAST = 1e-3
_FEWEST = 3
"""A track has at least as many blobs."""
_BENT_PX = 0.5
"""RMS distance from the best straight line, px, that makes a path distinctly curved."""
_STRAIGHT_WEIGHT = 0.1
"""Score of a straight path relative to a curved one. It is not zero, because a mark that hardly moves has no curved
path."""
_NONE = -1


def score_circles(
    blobs: Blobs, draws: NDArray[np.int64], centres_px: Floats, radii_px: Floats, frames: int
) -> tuple[Floats, NDArray[np.int64]]:
    """Take from each picture the blob on a circle that is most like the drawn ones, and score those of each circle.

    Parameters
    ----------
    blobs : Blobs
        The blobs of all pictures.
    draws : ndarray
        (n, 3) indices of the blobs through which each circle was drawn; -1 for the third of two.
    centres_px, radii_px : ndarray
        (n, 2) and (n,) the circles.
    frames : int
        Number of pictures.

    Returns
    -------
    scores : ndarray
        (n,) larger is more like a mark; negative where too few blobs lie on the circle, or they do not move.
    members : ndarray
        (n, frames) index of the blob of each picture, -1 where it has none.
    """
    alike = np.log(blobs.area), np.log(np.maximum(blobs.contrast, _LEAST_CONTRAST))
    return _scored(blobs.frame, blobs.plane_px, blobs.area, blobs.contrast, *alike, draws, centres_px, radii_px, frames)


@njit("(float64[::1],)", cache=True, nogil=True)
def _median(values):  # type: ignore[no-untyped-def]
    """Return the median of a few numbers, sorted by insertion; NumPy's median takes a second to compile."""
    ordered = values.copy()
    for i in range(1, len(ordered)):
        here, k = ordered[i], i
        while k > 0 and ordered[k - 1] > here:
            ordered[k] = ordered[k - 1]
            k -= 1
        ordered[k] = here
    middle = len(ordered) // 2
    return ordered[middle] if len(ordered) % 2 else (ordered[middle - 1] + ordered[middle]) / 2


@njit("(float64[::1], float64[::1], float64, float64)", cache=True, nogil=True)
def score_blobs(area: Floats, contrast: Floats, share: float, extent_px: float) -> float:
    """Score blobs whatever circle they lie on.

    Parameters
    ----------
    area, contrast : ndarray
        (n,) px² and units of a*, b*.
    share : float
        Of the pictures, in which there is one.
    extent_px : float
        Of their path, px.

    Returns
    -------
    float
        Larger is more like a mark.
    """
    sizes = np.log(area)
    mean, square = sizes.sum() / len(sizes), 0.0
    for size in sizes:
        square += (size - mean) ** 2
    constancy = np.exp(-4.0 * (square / len(sizes)) ** 0.5)
    travel = 1.0 - np.exp(-extent_px / 10.0)
    return share**2 * _median(contrast) * constancy * _median(area) ** 0.25 * (0.1 + travel)


@njit("(float64[::1], float64[::1])", cache=True, nogil=True)
def _square_off_line(x, y):  # type: ignore[no-untyped-def]
    """Return the mean square distance of places from the straight line that fits them best, px²."""
    x, y, freedom = x - x.mean(), y - y.mean(), len(x) - 1
    xx, yy, xy = (x * x).sum() / freedom, (y * y).sum() / freedom, (x * y).sum() / freedom
    return max((xx + yy) / 2.0 - np.hypot((xx - yy) / 2.0, xy), 0.0)


@njit(
    "(int64[::1], float64[:, ::1], float64[::1], float64[::1], float64[::1], float64[::1], int64[:, ::1], "
    "float64[:, ::1], float64[::1], int64)",
    cache=True,
    nogil=True,
)
def _scored(frame, place, area, contrast, log_area, log_contrast, draws, centres, radii, frames):  # type: ignore[no-untyped-def]
    scores, members = np.full(len(draws), -1.0), np.full((len(draws), frames), _NONE)
    unlike, off = np.empty(frames), np.empty(frames)
    for k in range(len(draws)):
        drawn = draws[k] if draws[k, 2] != _NONE else draws[k, :2]
        size, standing_out = np.log(_median(area[drawn])), np.log(_median(contrast[drawn]))
        unlike[:] = np.inf
        for b in range(len(frame)):
            away = abs(np.hypot(place[b, 0] - centres[k, 0], place[b, 1] - centres[k, 1]) - radii[k])
            if not away < TOLERANCE_PX:
                continue
            other = abs(log_area[b] - size) + abs(log_contrast[b] - standing_out)
            t = frame[b]
            if other < _UNLIKE and other + away / TOLERANCE_PX < unlike[t]:
                unlike[t], off[t], members[k, t] = other + away / TOLERANCE_PX, away, b
        taken = members[k] != _NONE
        some = members[k][taken]
        if len(some) < _FEWEST:
            continue
        x, y = place[some, 0], place[some, 1]
        extent = np.hypot(x.max() - x.min(), y.max() - y.min())
        if extent < MOVED_PX:
            continue
        close = np.exp(-np.mean((off[taken] / TOLERANCE_PX) ** 2))
        # Motion to and fro on a straight line shows no centre of rotation.
        bent = 1.0 - np.exp(-_square_off_line(x, y) / _BENT_PX**2)
        scores[k] = score_blobs(area[some], contrast[some], len(some) / frames, extent) * close
        scores[k] *= _STRAIGHT_WEIGHT + (1.0 - _STRAIGHT_WEIGHT) * bent
    return scores, members
