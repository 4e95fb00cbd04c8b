"""A surface that turns before a light that stands still: how its brightness changes with its turn.

A matt surface is as bright as the cosine of the angle between its normal and the light. When it turns about the line of
sight, that is a constant, plus multiples of the cosine and the sine of the turn, whatever the normal (Lambert's law;
Basri and Jacobs, IEEE Transactions on Pattern Analysis and Machine Intelligence 25, 2003, treat lights likewise).
Without it, a wheel of five spokes is explained better by turns that jump back by a fifth whenever a spoke comes to
where the one before it was: each is then as bright as the last one there.
"""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

Picture = NDArray[np.float32]
_SHADE = 0.25
"""Usual change of a surface's brightness with the cosine of its turn, as a share of it."""
_FAR = 2.5
"""Standard deviations beyond which a value has no more weight in a regression."""
_FEWEST = 8
"""Values from which on a change is sought: it has three means and a variance."""


def shading_of(held: Picture, median: Picture, variance: Picture, lights: Picture, noise: float) -> Picture:
    """Return what cosine and sine of the turn add to the pixels of a body.

    Parameters
    ----------
    held : ndarray
        (m, h, w) pictures in the coordinates of the body, grey levels; NaN where they are unknown.
    median, variance : ndarray
        (h, w) of these, grey levels and grey levels².
    lights : ndarray
        (m, 2) cosine and sine of the turns.
    noise : float
        Standard deviation of a pixel at rest, grey levels.

    Returns
    -------
    ndarray
        (2, h, w) grey levels; nothing where a constant explains a pixel as well, for the number of its parameters
        (Schwarz, Annals of Statistics 6, 1978).
    """
    columns = np.ascontiguousarray(held.reshape(len(held), -1).T)
    spread = np.sqrt(variance.ravel() + np.float32(noise**2))
    likely = np.float32(noise) / (np.float32(_SHADE) * np.maximum(median.ravel(), np.float32(1.0)))
    found = _regressed(columns, median.ravel(), spread, lights - lights.mean(axis=0), likely**2)
    return np.asarray(found.T.reshape(2, *held.shape[1:]))


def without_motion(shading: Picture, appearance: Picture, variance: Picture) -> Picture:
    """Return a change with the light (2, …) without what a motion adds to a body's appearance.

    Where the centre is off, or the turns are, the body is displaced by a cosine and a sine of its turn: to first order
    by multiples of its slopes to the right, downwards and around. These are left to the poses.
    """
    lit = shading.any(axis=0)
    if not lit.any():
        return shading
    across, down = slopes(appearance)
    y, x = np.mgrid[: lit.shape[0], : lit.shape[1]]
    motions = np.stack([across, down, (x - x[lit].mean()) * down - (y - y[lit].mean()) * across])[:, lit]
    weight = 1.0 / np.sqrt(variance[lit])
    of_motion = np.linalg.lstsq((motions * weight).T, (shading[:, lit] * weight).T, rcond=None)[0]
    left = np.zeros_like(shading)
    left[:, lit] = shading[:, lit] - of_motion.T @ motions
    return left


@njit(
    "float32[:, ::1](float32[:, ::1], float32[::1], float32[::1], float32[:, ::1], float32[::1])",
    cache=True,
    nogil=True,
)
def _regressed(values, middle, spread, terms, prior):  # type: ignore[no-untyped-def]
    """Return the coefficients (n, 2) of terms (m, 2) in values (n, m), where they are worth it.

    Values that are off by more than `_FAR` times their spread count as if they were off by so much.
    """
    found = np.zeros((len(values), 2), np.float32)
    for i in range(len(values)):
        n, sx, sy, sr, sxx, sxy, syy, sxr, syr, srr = 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        far = _FAR * spread[i]
        for k in range(values.shape[1]):
            off = values[i, k] - middle[i]
            if not off * off >= 0.0:
                continue
            off = min(max(off, -far), far)
            x, y = terms[k, 0], terms[k, 1]
            n, sx, sy, sr = n + 1, sx + x, sy + y, sr + off
            sxx, sxy, syy = sxx + x * x, sxy + x * y, syy + y * y
            sxr, syr, srr = sxr + x * off, syr + y * off, srr + off * off
        if n < _FEWEST:
            continue
        sxx, sxy, syy = sxx - sx * sx / n + prior[i], sxy - sx * sy / n, syy - sy * sy / n + prior[i]
        sxr, syr, srr = sxr - sx * sr / n, syr - sy * sr / n, srr - sr * sr / n
        determinant = sxx * syy - sxy * sxy
        a, b = (syy * sxr - sxy * syr) / determinant, (sxx * syr - sxy * sxr) / determinant
        left = srr - a * sxr - b * syr
        if left < srr * np.exp(-2.0 * np.log(n) / n):
            found[i, 0], found[i, 1] = a, b
    return found


def slopes(picture: Picture) -> tuple[Picture, Picture]:
    """Return the gradient to the right and downwards, grey levels per px."""
    filled = np.nan_to_num(picture)
    across = cv2.Sobel(filled, cv2.CV_32F, 1, 0, scale=0.125)
    down = cv2.Sobel(filled, cv2.CV_32F, 0, 1, scale=0.125)
    return np.asarray(across), np.asarray(down)
