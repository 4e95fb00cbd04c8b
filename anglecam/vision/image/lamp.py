"""The synchronisation lamp: when it lights at the first command change, as precisely as the frame rate allows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats

_PATCH_RADIUS_PX = 2
"""Half the side of the square patch whose mean level is read."""
_MIN_RISE = 20.0
"""Least rise of the lamp's level, grey levels of 255. A useful lamp brightens by more."""
_MIN_RISE_SCATTERS = 8.0
"""Least rise of the lamp's level, in standard deviations of the change from frame to frame."""
_LEVEL_FRAMES = 5
"""Frames whose median gives the dark level and the bright level."""
_UNLIT_SHARE, _LIT_SHARE = 0.1, 0.9
"""Shares of the rise below which the lamp counts as dark and above which it counts as lit. Between the two, the lamp
lit up during the exposure."""


def patch_levels(image: NDArray[np.uint8], place_px: tuple[float, float]) -> Floats:
    """Return the mean level of each channel in a small square patch.

    Parameters
    ----------
    image : ndarray
        (h, w, channels) levels 0–255.
    place_px : tuple of float
        Centre of the patch (x, y), inside the picture, px.

    Returns
    -------
    ndarray
        (channels,) levels 0–255.
    """
    x, y = (round(v) for v in place_px)
    rows = slice(max(y - _PATCH_RADIUS_PX, 0), y + _PATCH_RADIUS_PX + 1)
    columns = slice(max(x - _PATCH_RADIUS_PX, 0), x + _PATCH_RADIUS_PX + 1)
    return image[rows, columns].reshape(-1, image.shape[2]).mean(axis=0)


def lit_between(time: Floats, levels: Floats) -> tuple[float, float] | None:
    """Return the interval between two frames in which a lamp first lit up.

    Parameters
    ----------
    time : (n,) ndarray
        Instants, s, increasing.
    levels : (n, channels) ndarray
        Levels from `patch_levels`; NaN for a frame that could not be decoded.

    Returns
    -------
    (float, float) or None
        The last instant at which the lamp was certainly dark and the first at which it was fully lit, s. ``None``
        where the lamp is lit from the beginning or never lights.
    """
    known = np.isfinite(levels).all(axis=1)
    time, levels = time[known], levels[known]
    if len(time) <= 2 * _LEVEL_FRAMES:
        return None
    rise = levels - np.median(levels[:_LEVEL_FRAMES], axis=0)
    # One channel and not their sum: a red lamp may be no brighter than its housing.
    channel = int(np.argmax(rise.max(axis=0)))
    level = rise[:, channel]
    scatter = 1.4826 * np.median(np.abs(np.diff(level))) / np.sqrt(2.0)
    least = max(_MIN_RISE, _MIN_RISE_SCATTERS * scatter)
    bright = level > least
    begins = np.flatnonzero(bright[:-1] & bright[1:])
    if not len(begins):
        return None
    first = int(begins[0])
    height = float(np.median(level[first + 1 : first + 1 + _LEVEL_FRAMES]))
    lit = first + int(np.argmax(level[first:] >= _LIT_SHARE * height))
    dark = np.flatnonzero(level[: lit + 1] <= max(_UNLIT_SHARE * height, _MIN_RISE_SCATTERS * scatter))
    return (float(time[dark[-1]]), float(time[lit])) if len(dark) else None
