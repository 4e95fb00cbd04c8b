"""Small windows with edges, followed from one picture into another, and the motions that carry all of them.

They are followed by the method of Lucas and Kanade (1981), through a pyramid of ever smaller pictures. Where a window
shows a straight edge it tells the motion across that edge only: distances count by a metric of its own.
"""

from __future__ import annotations

import cv2
import numpy as np

from anglecam.data.typing import Floats, Image

WINDOW_SIDE_PX = 20
"""Of a window."""
_HALVINGS = 3
"""Of the picture: shifts of some twenty pixels are found."""
_LOCAL_PX = 15
"""Brightness is told from its mean over a square of this side, so that flicker moves nothing."""
_LEAST_SLOPE = 1.0
"""Root mean square slope of a window's brightness over the pixels' noise, px⁻¹: its place is good to 1/20 px."""
_EDGE = 0.05
"""Ratio of a window's lesser to its greater information below which it is a straight edge and tells only across."""
TOLERANCE_PX = 0.3
"""Distance from where the motion has it at which a window is half lost; Lucas and Kanade err by a tenth of that."""
_MOST = 300
"""Windows; of more, every so many are taken."""
_WINDOW_PX, _ROLL = 0.1, 0.01
"""Standard deviations of a window's place, px, and of the roll before any is seen, rad."""


def subtract_local_mean(picture: Image) -> Image:
    """Tell brightness (h, w) from its local mean."""
    mean = cv2.boxFilter(picture, -1, (_LOCAL_PX, _LOCAL_PX))
    return cv2.addWeighted(picture, 1.0, mean, -1.0, 128.0)


def find_windows(picture: Image, noise: float) -> tuple[Floats, Floats]:
    """Cut a picture into squares, and keep those with edges.

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
    half = WINDOW_SIDE_PX // 2
    inner = np.s_[WINDOW_SIDE_PX : -half - 1 : WINDOW_SIDE_PX, WINDOW_SIDE_PX : -half - 1 : WINDOW_SIDE_PX]
    xx, xy, yy = (
        cv2.boxFilter(part, -1, (WINDOW_SIDE_PX, WINDOW_SIDE_PX))[inner] for part in (gx * gx, gx * gy, gy * gy)
    )
    tensor = np.stack([np.stack([xx, xy], axis=-1), np.stack([xy, yy], axis=-1)], axis=-2).astype(float)
    row, column = np.nonzero(np.linalg.eigvalsh(tensor)[..., 1] > (_LEAST_SLOPE * max(noise, 1.0)) ** 2)
    thin = np.s_[:: 1 + len(row) // _MOST]
    centres = np.asarray(WINDOW_SIDE_PX * (np.column_stack([column, row])[thin] + 1.0), dtype=float)
    return centres, tensor[row, column][thin]


def edge_metric(tensor: Floats) -> tuple[Floats, Floats]:
    """Scale structure tensors (n, 2, 2) to 1 across the main edge, which is returned too, (n,).

    Straight edges say nothing along.
    """
    values, vectors = np.linalg.eigh(tensor)
    most: Floats = values[:, 1]
    along = np.where(values[:, 0] < _EDGE * most, 0.0, values[:, 0] / most)
    scale = np.stack([along, np.ones(len(most))], axis=-1)
    return np.einsum("nai,ni,nbi->nab", vectors, scale, vectors), most


def follow_windows(first: Image, other: Image, centres_px: Floats) -> Floats:
    """Find by how much windows of a levelled picture are displaced in another one.

    Parameters
    ----------
    first, other : ndarray
        (h, w) from `level`.
    centres_px : ndarray
        (n, 2) of the windows in the first picture, px.

    Returns
    -------
    ndarray
        (n, 2) px, good to some hundredths; anything where the window is not to be seen.
    """
    start = centres_px.astype(np.float32)[:, None]
    found, _, _ = cv2.calcOpticalFlowPyrLK(
        first,
        other,
        start,
        start.copy(),
        winSize=(WINDOW_SIDE_PX + 1, WINDOW_SIDE_PX + 1),
        maxLevel=_HALVINGS,
        criteria=(cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 15, 0.01),
        minEigThreshold=1e-6,
    )
    return np.asarray((found - start)[:, 0], dtype=float)


def displacements(arms_px: Floats, shifts_px: Floats, rolls: Floats) -> Floats:
    """Displace points (n, 2), given from the origin, by shifts (m, 2) and rolls (m,): (n, m, 2) px."""
    x, y = arms_px[:, :1], arms_px[:, 1:]
    c, s = np.cos(rolls) - 1.0, np.sin(rolls)
    return np.stack([x * c + y * s, y * c - x * s], axis=-1) + shifts_px


def fit_motion(
    arms_px: Floats, moved: Floats, metric: Floats, weight: Floats, shifts_px: Floats, rolls: Floats
) -> tuple[Floats, Floats]:
    """Improve shifts and rolls by one weighted step of Gauss and Newton.

    Parameters
    ----------
    arms_px : ndarray
        (n, 2) windows from the origin, px.
    moved : ndarray
        (n, m, 2) their displacements in each frame, px.
    metric : ndarray
        (n, 2, 2) from `metric_of`.
    weight : ndarray
        (n, m).
    shifts_px, rolls : ndarray
        (m, 2) px and (m,) rad so far.

    Returns
    -------
    tuple of ndarray
        Both, improved.
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
    """Square distances (n, m, 2) across edges, in gates."""
    return np.einsum("nka,nab,nkb->nk", rest, metric, rest) / TOLERANCE_PX**2
