"""Small windows with edges, tracked from one picture to another, and the motions that displace all of them.

They are tracked by the method of Lucas and Kanade (1981) through a pyramid of reduced pictures. A window on a straight
edge determines only the motion across that edge, so each window has a metric by which its distances count.
"""

from __future__ import annotations

import cv2
import numpy as np

from anglecam.data.typing import Floats, Image

WINDOW_SIDE_PX = 20
"""Side of a window, px."""
TOLERANCE_PX = 0.3
"""Deviation of a window from the common motion at which its weight falls to 1/e, px. The errors of Lucas and Kanade's
method are a tenth of that."""
_PYRAMID_LEVELS = 3
"""Times that the picture is halved, which allows displacements of some twenty pixels."""
_LOCAL_PX = 15
"""Side of the square over which the local mean of brightness is taken, px. Subtracting it removes flicker."""
_MIN_SLOPE = 1.0
"""Least RMS slope of a window's brightness over the pixels' noise, 1/px: its place is then accurate to 1/20 px."""
_EDGE = 0.05
"""Ratio of a window's smaller to its larger information below which it shows a straight edge and determines only the
motion across it."""
_MAX_WINDOWS = 300
"""Of more windows, every second, third, … is taken."""
_WINDOW_PX, _ROLL = 0.1, 0.01
"""Standard deviation of a window's place, px, and prior standard deviation of the roll, rad."""


def subtract_local_mean(picture: Image) -> Image:
    """Return brightness (h, w) relative to its local mean, plus 128."""
    mean = cv2.boxFilter(picture, -1, (_LOCAL_PX, _LOCAL_PX))
    return cv2.addWeighted(picture, 1.0, mean, -1.0, 128.0)


def find_windows(picture: Image, noise: float) -> tuple[Floats, Floats]:
    """Divide a picture into squares, and keep those with edges.

    Parameters
    ----------
    picture : ndarray
        (h, w) brightness.
    noise : float
        Standard deviation of the pixels, grey levels.

    Returns
    -------
    tuple of ndarray
        Their middles (n, 2), px, and structure tensors (n, 2, 2), (grey levels/px)².
    """
    smooth = cv2.GaussianBlur(picture, (0, 0), 0.7)
    gx, gy = (cv2.Scharr(smooth, cv2.CV_32F, *axis, scale=1 / 32) for axis in ((1, 0), (0, 1)))
    side = WINDOW_SIDE_PX
    half = side // 2
    inner = np.s_[side : -half - 1 : side, side : -half - 1 : side]
    xx, xy, yy = (cv2.boxFilter(part, -1, (side, side))[inner] for part in (gx * gx, gx * gy, gy * gy))
    tensor = np.stack([np.stack([xx, xy], axis=-1), np.stack([xy, yy], axis=-1)], axis=-2).astype(float)
    row, column = np.nonzero(np.linalg.eigvalsh(tensor)[..., 1] > (_MIN_SLOPE * max(noise, 1.0)) ** 2)
    thinned = np.s_[:: 1 + len(row) // _MAX_WINDOWS]
    centres = np.asarray(side * (np.column_stack([column, row])[thinned] + 1.0), dtype=float)
    return centres, tensor[row, column][thinned]


def edge_metric(tensor: Floats) -> tuple[Floats, Floats]:
    """Scale structure tensors to 1 across the main edge; along straight edges the metric is 0.

    Parameters
    ----------
    tensor : ndarray
        (n, 2, 2) from `find_windows`.

    Returns
    -------
    metric : ndarray
        (n, 2, 2).
    information : ndarray
        (n,) larger eigenvalue of the tensor, (grey levels/px)².
    """
    values, vectors = np.linalg.eigh(tensor)
    most: Floats = values[:, 1]
    along = np.where(values[:, 0] < _EDGE * most, 0.0, values[:, 0] / most)
    scale = np.stack([along, np.ones(len(most))], axis=-1)
    return np.einsum("nai,ni,nbi->nab", vectors, scale, vectors), most


def follow_windows(first: Image, other: Image, centres_px: Floats) -> Floats:
    """Track the windows of one picture into another and return their displacements.

    Parameters
    ----------
    first, other : ndarray
        (h, w) from `subtract_local_mean`.
    centres_px : ndarray
        (n, 2) of the windows in the first picture, px.

    Returns
    -------
    ndarray
        (n, 2) px, accurate to some hundredths; arbitrary where the window is not visible.
    """
    start = centres_px.astype(np.float32)[:, None]
    found, _, _ = cv2.calcOpticalFlowPyrLK(
        first,
        other,
        start,
        start.copy(),
        winSize=(WINDOW_SIDE_PX + 1, WINDOW_SIDE_PX + 1),
        maxLevel=_PYRAMID_LEVELS,
        criteria=(cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 15, 0.01),
        minEigThreshold=1e-6,
    )
    return np.asarray((found - start)[:, 0], dtype=float)


def displacements(arms_px: Floats, shifts_px: Floats, rolls: Floats) -> Floats:
    """Return the displacements (n, m, 2), px, of points (n, 2) from the origin by shifts (m, 2) and rolls (m,)."""
    x, y = arms_px[:, :1], arms_px[:, 1:]
    c, s = np.cos(rolls) - 1.0, np.sin(rolls)
    return np.stack([x * c + y * s, y * c - x * s], axis=-1) + shifts_px


def fit_motion(
    arms_px: Floats, moved: Floats, metric: Floats, weight: Floats, shifts_px: Floats, rolls: Floats
) -> tuple[Floats, Floats]:
    """Improve shifts and rolls by one weighted Gauss-Newton step.

    Parameters
    ----------
    arms_px : ndarray
        (n, 2) windows relative to the origin, px.
    moved : ndarray
        (n, m, 2) their displacements in each frame, px.
    metric : ndarray
        (n, 2, 2) from `edge_metric`.
    weight : ndarray
        (n, m).
    shifts_px, rolls : ndarray
        (m, 2) px and (m,) rad so far.

    Returns
    -------
    tuple of ndarray
        Shifts and rolls.
    """
    rest = moved - displacements(arms_px, shifts_px, rolls)
    by_roll = np.stack([arms_px[:, 1], -arms_px[:, 0]], axis=-1)
    J = np.concatenate([np.broadcast_to(np.eye(2), (len(arms_px), 2, 2)), by_roll[..., None]], axis=-1)
    MJ = metric @ J / _WINDOW_PX**2
    normal = np.einsum("nk,nai,naj->kij", weight, J, MJ) + np.diag([1e-6, 1e-6, 1.0 / _ROLL**2])
    right = np.einsum("nk,nka,nai->ki", weight, rest, MJ)
    right[:, 2] -= rolls / _ROLL**2
    step = np.linalg.solve(normal, right[..., None])[..., 0]
    return shifts_px + step[:, :2], rolls + step[:, 2]


def squared_deviations(rest: Floats, metric: Floats) -> Floats:
    """Return squared distances across edges (n, m), in units of `TOLERANCE_PX`, of deviations (n, m, 2), px."""
    return np.einsum("nka,nab,nkb->nk", rest, metric, rest) / TOLERANCE_PX**2
