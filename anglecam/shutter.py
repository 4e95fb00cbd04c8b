"""When a mark was seen: what a rolling shutter adds to a frame's time.

A frame's time stamp is taken as the middle of the exposure of its middle row, (height − 1)/2. The exposure itself
then moves no time: it blurs, and the blur of a mark is centred on where the mark was in the middle of its exposure.
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
