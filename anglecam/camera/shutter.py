"""When a mark was seen: what a rolling shutter adds to a frame's time, and what the exposure's length hides.

A frame's time stamp is taken as the middle of the exposure of its middle row, (height − 1)/2. The exposure itself
then moves no time: it blurs, and the blur of a mark is centred on its mean place. At a steady speed that is where it
was in the middle of the exposure; where it speeds up or slows down, it is not.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def measurement_time(
    time: ArrayLike, mouth_y_px: ArrayLike, height: int, row_time_s: float | None
) -> NDArray[np.float64]:
    """Return the time at which the mouth was where it was measured: t + row_time·(y − (height − 1)/2).

    Parameters
    ----------
    time : array_like
        (n,) the frames' time stamps, s.
    mouth_y_px : array_like
        (n,) the mouth's row in the picture as it was filmed, not as it was rectified, px; NaN where it was not found.
    height : int
        Rows of the picture.
    row_time_s : float or None
        How much later each row is exposed than the one above it, s; ``None``: all at once.

    Returns
    -------
    ndarray
        (n,) s, in the frames' order; the time stamp itself where the mouth was not found. Times of neighbouring
        frames can coincide or change places only if the mouth crosses the picture faster than the shutter does.
    """
    stamps = np.asarray(time, dtype=float)
    if row_time_s is None:
        return stamps
    rows = np.asarray(mouth_y_px, dtype=float) - (height - 1) / 2.0
    return stamps + row_time_s * np.where(np.isfinite(rows), rows, 0.0)


def mean_off_middle(time: ArrayLike, angle: ArrayLike, exposure_s: float | None) -> NDArray[np.float64]:
    """Return how far the mean over the exposure may lie from the angle at its middle: |θ̈|·T²/24.

    Frames are too far apart to undo it: where the motion sets off between two of them it would be made worse. So it
    is an uncertainty, about as large as the error is.

    Parameters
    ----------
    time : array_like
        (n,) s, of frames one after another.
    angle : array_like
        (n,) rad.
    exposure_s : float or None
        T, s; ``None``: not known, taken as short.

    Returns
    -------
    ndarray
        (n,) standard uncertainty, rad; the first and the last frame have that of their neighbour.
    """
    t, theta = np.asarray(time, dtype=float), np.asarray(angle, dtype=float)
    if exposure_s is None or len(t) < 3:
        return np.zeros(len(t))
    speed = np.diff(theta) / np.diff(t)
    acceleration = 2.0 * np.diff(speed) / (t[2:] - t[:-2])
    return np.abs(np.pad(acceleration, 1, mode="edge")) * exposure_s**2 / 24.0
