"""The time at which a mark was measured: the delay of a rolling shutter and the error by the exposure's length.

A frame's time stamp is taken as the middle of the exposure of its middle row, (height − 1)/2. The length of the
exposure then shifts no time: it blurs the mark, and the blur is centred on the mark's mean position. At constant speed,
the mean position is the position in the middle of the exposure; under acceleration it is not.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anglecam.errors import RigError
from anglecam.io.rig import Rig
from anglecam.video.film import Film

SYMMETRICAL_PX = 4.0
"""Longest blur that leaves edges symmetrical, px: about the width of an edge in a film."""
BLUR_SHARE = 0.025
"""Error of the angle as a share of the longer part of the blur. In 1,151 frames of four rendered films with exposures
of 36 % to 90 % of the frame interval the errors beyond 11 px of blur are 0.16 px RMS and at most 0.39 px."""


def rig_as_shown(rig: Rig, film: Film) -> Rig:
    """Return a rig whose ``row_time_s`` counts the rows of the picture as a player shows it, not those of the sensor.

    Raises
    ------
    RigError
        Where it is declared, but the rows of the sensor are shown as columns.
    """
    if rig.camera.row_time_s is None:
        return rig
    shown = film.display.shown_row_time(rig.camera.row_time_s)
    if shown is None:
        raise RigError(
            f"{film.path}: camera: {{row_time_s}}: players turn this film by 90°, so the rows of its sensor are columns"
            " of the picture; a rolling shutter is corrected along rows only"
        )
    return rig.model_copy(update={"camera": rig.camera.model_copy(update={"row_time_s": shown})})


def measurement_time(
    time: ArrayLike, mark_y_px: ArrayLike, height: int, row_time_s: float | None
) -> NDArray[np.float64]:
    """Return the time at which the mark was at its measured position: t + row_time·(y − (height − 1)/2).

    Parameters
    ----------
    time : array_like
        (n,) time stamps of the frames, s.
    mark_y_px : array_like
        (n,) row of the mark in the picture as it was filmed, not as it was rectified, px; NaN where it was not found.
    height : int
        Number of rows of the picture.
    row_time_s : float or None
        Delay of the exposure from one row to the next, s; ``None``: all rows are exposed at the same time.

    Returns
    -------
    ndarray
        (n,) times, s, in the order of the frames; the time stamp itself where the mark was not found. Times of
        neighbouring frames can coincide or swap only if the mark crosses the picture faster than the shutter does.

    Examples
    --------
    A mark in the first of 480 rows is exposed half a read-out earlier than the middle row:

    >>> measurement_time([0.0, 0.04], [0.0, 239.5], 480, 1e-5).round(6)
    array([-0.002395,  0.04    ])
    """
    stamps = np.asarray(time, dtype=float)
    if row_time_s is None:
        return stamps
    rows = np.asarray(mark_y_px, dtype=float) - (height - 1) / 2.0
    return stamps + row_time_s * np.where(np.isfinite(rows), rows, 0.0)


def mean_off_middle(time: ArrayLike, angle: ArrayLike, exposure_s: float | None) -> NDArray[np.float64]:
    """Return the difference between the mean angle over the exposure and the angle at its middle: |θ̈|·T²/24.

    The difference is not corrected, because frames are too far apart: where a motion starts between two frames, the
    correction would increase the error. It is therefore stated as an uncertainty, of about the size of the error.

    Parameters
    ----------
    time : array_like
        (n,) times of consecutive frames, s.
    angle : array_like
        (n,) angles, rad.
    exposure_s : float or None
        Length T of the exposure, s; ``None``: unknown, taken as short.

    Returns
    -------
    ndarray
        (n,) standard uncertainty, rad; the first and the last frame get that of their neighbour.
    """
    t, theta = np.asarray(time, dtype=float), np.asarray(angle, dtype=float)
    if exposure_s is None or len(t) < 3:
        return np.zeros(len(t))
    speed = np.diff(theta) / np.diff(t)
    acceleration = 2.0 * np.diff(speed) / (t[2:] - t[:-2])
    return np.abs(np.pad(acceleration, 1, mode="edge")) * exposure_s**2 / 24.0


def blur_error(time: ArrayLike, angle: ArrayLike, lever_px: ArrayLike, exposure_s: float | None) -> NDArray[np.float64]:
    """Return the standard uncertainty of an angle found by comparing a blurred picture with a sharp one.

    A blur shorter than the edges' own width leaves every edge symmetrical. Over a longer one the images of neighbouring
    edges run into each other, and the best match is off the middle of the exposure by a few hundredths of the blur.

    Parameters
    ----------
    time : array_like
        (n,) times of consecutive frames, s.
    angle : array_like
        (n,) angles, rad.
    lever_px : array_like
        (n,) distance of the mark from the pivot, px.
    exposure_s : float or None
        Length of the exposure, s; ``None``: unknown, taken as short.

    Returns
    -------
    ndarray
        (n,) rad.
    """
    t, theta, lever = (np.asarray(x, dtype=float) for x in (time, angle, lever_px))
    if exposure_s is None or len(t) < 2:
        return np.zeros(len(t))
    blur_px = np.abs(np.gradient(theta, t)) * exposure_s * lever
    return np.asarray(BLUR_SHARE * np.maximum(blur_px - SYMMETRICAL_PX, 0.0) / lever)
