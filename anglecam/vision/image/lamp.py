"""The lamp that lights at the first command change: when, as far as the frames tell."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats

_PATCH_RADIUS_PX = 2
"""Of the patch that is looked at, px."""
_MIN_RISE = 20.0
"""Grey levels, of 255; no lamp is worth its name that brightens by less."""
_MIN_RISE_SCATTERS = 8.0
"""Scatters from frame to frame by which the lamp must rise."""
_LEVEL_FRAMES = 5
"""Frames that say how dark and how bright it is."""
_UNLIT_SHARE, _LIT_SHARE = 0.1, 0.9
"""Shares of the rise; between them it was lit within the exposure."""


def patch_levels(image: NDArray[np.uint8], place_px: tuple[float, float]) -> Floats:
    """Return the mean level of each channel, 0–255, in a small patch that lies in the picture."""
    x, y = (round(v) for v in place_px)
    patch = image[
        max(y - _PATCH_RADIUS_PX, 0) : y + _PATCH_RADIUS_PX + 1, max(x - _PATCH_RADIUS_PX, 0) : x + _PATCH_RADIUS_PX + 1
    ]
    return patch.reshape(-1, image.shape[2]).mean(axis=0)


def lit_between(time: Floats, levels: Floats) -> tuple[float, float] | None:
    """Tell between which two frames a lamp was lit first.

    Parameters
    ----------
    time : (n,) ndarray
        Instants, s, increasing.
    levels : (n, channels) ndarray
        What `patch_levels` gave; NaN for a frame that could not be decoded.

    Returns
    -------
    (float, float) or None
        The last instant at which it was surely dark and the first at which it was fully lit, s; ``None`` where it is
        lit from the beginning or never.
    """
    known = np.isfinite(levels).all(axis=1)
    time, levels = time[known], levels[known]
    if len(time) <= 2 * _LEVEL_FRAMES:
        return None
    rise = levels - np.median(levels[:_LEVEL_FRAMES], axis=0)
    channel = int(np.argmax(rise.max(axis=0)))  # a red lamp may be no brighter than its housing
    course = rise[:, channel]
    scatter = 1.4826 * np.median(np.abs(np.diff(course))) / np.sqrt(2.0)
    least = max(_MIN_RISE, _MIN_RISE_SCATTERS * scatter)
    bright = course > least
    begins = np.flatnonzero(bright[:-1] & bright[1:])
    if not len(begins):
        return None
    first = int(begins[0])
    height = float(np.median(course[first + 1 : first + 1 + _LEVEL_FRAMES]))
    lit = first + int(np.argmax(course[first:] >= _LIT_SHARE * height))
    dark = np.flatnonzero(course[: lit + 1] <= max(_UNLIT_SHARE * height, _MIN_RISE_SCATTERS * scatter))
    return (float(time[dark[-1]]), float(time[lit])) if len(dark) else None
