"""The circle on which a mark on a rotating body moves: its centre is the centre of rotation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from skimage.measure import CircleModel

from anglecam.data.typing import Floats

_MAX_ROUNDS = 8
"""Rounds of fitting and rejecting outliers."""
_OUTLIER = 4.0
"""Robust standard deviations beyond which a point is rejected as an outlier."""
_FLOOR_PX = 0.02
"""Least robust standard deviation, px: no film locates a mark better. Without it, points of exact data are rejected."""
_SLOW_PX = 0.04
"""Least standard deviation of the part of a centroid's error that varies slowly along the path, px. The background
behind the mark's edge and chroma at half resolution shift the centroid by 0.02 to 0.08 px in MJPG films."""
_MAX_CONDITION = 1e6
"""Condition number of the fit beyond which the path counts as a line: an arc of less than a tenth of a degree, whose
covariance would have no correct digit."""
_SLOW_LENGTHS_PX = (4.0, 16.0)
"""Correlation lengths of that error along the path, px: the background behind the edge, a codec's blocks."""


@dataclass(frozen=True)
class Circle:
    """A circle fitted to a path."""

    centre_px: Floats
    """(2,) px."""
    radius_px: float
    """px."""
    scatter_px: float
    """Standard deviation of the distance from the circle over the points used, px."""
    covariance_px2: Floats
    """(3, 3) covariance of centre and radius, px², robust against errors that are common to neighbouring poses."""
    fits: NDArray[np.bool_]
    """(n,) which points were used."""

    @property
    def centre_covariance_px2(self) -> Floats:
        """(2, 2) covariance of the centre, px²."""
        return self.covariance_px2[:2, :2]


def circle_through(points_px: Floats) -> tuple[Floats, float]:
    """Fit a circle algebraically: in closed form through three points, else with scikit-image's `CircleModel`.

    Parameters
    ----------
    points_px : ndarray
        (n, 2) points, n ≥ 3.

    Returns
    -------
    centre_px : ndarray
        (2,) NaN where the points lie on a line or coincide.
    radius_px : float
        Infinite where the centre is NaN.
    """
    if len(points_px) == 3:  # hundreds of times for each clip, and a hundred times as fast
        return _circumcircle(*points_px.tolist())
    model = CircleModel.from_estimate(points_px)
    if not model:
        return np.full(2, np.nan), np.inf
    return np.asarray(model.center, dtype=float), float(model.radius)


def _circumcircle(first: list[float], second: list[float], third: list[float]) -> tuple[Floats, float]:
    """Return the circle through three points: |p − o|² is the same for all, which is linear in the centre o."""
    (x1, y1), (x2, y2) = ((x - first[0], y - first[1]) for x, y in (second, third))
    twice_area = x1 * y2 - x2 * y1
    if twice_area == 0.0:
        return np.full(2, np.nan), np.inf
    square1, square2 = x1 * x1 + y1 * y1, x2 * x2 + y2 * y2
    x = (y2 * square1 - y1 * square2) / (2.0 * twice_area)
    y = (x1 * square2 - x2 * square1) / (2.0 * twice_area)
    return np.array([first[0] + x, first[1] + y]), float(np.hypot(x, y))


def fit_circle(points_px: Floats, *, start: tuple[Floats, float] | None = None) -> Circle | None:
    """Fit a circle to a path by least squares of the distance, with outliers rejected.

    The cost is Σ (|p − o| − R)². The covariance is the cluster-robust sandwich (Liang & Zeger 1986) with poses closer
    than a pixel as one cluster: the error of a centroid depends on its position on the pixel grid, so a mark at rest
    repeats the same error in every frame.

    A second term is added for errors that the residual cannot show because the fit absorbs them on a short arc. An
    error that varies slowly along the path resembles curvature and moves the centre by its size divided by 1 − cos of
    half the arc. It is propagated as a Gaussian process, B·Jᵀ·K·J·B with B = (JᵀJ)⁻¹.

    Parameters
    ----------
    points_px : ndarray
        (n, 2) points.
    start : tuple of (ndarray, float), optional
        Initial centre and radius. Without them, or where they lead to no circle, the algebraic fit is the start.

    Returns
    -------
    Circle or None
        ``None`` with fewer than 4 points or fewer than 4 poses, or where the points lie on a line.
    """
    if len(points_px) < 4:
        return None
    from_start = None if start is None else _fit_from(points_px, *start)
    return from_start or _fit_from(points_px, *circle_through(points_px))


def _fit_from(points_px: Floats, centre: Floats, radius: float) -> Circle | None:
    if not np.isfinite(radius):
        return None
    # Robust loss first: an inexact start would reject one of the two places in which a mark rests as outliers.
    centre, radius = _solve(points_px, centre, radius, loss="soft_l1")
    fits = np.ones(len(points_px), bool)
    for _ in range(_MAX_ROUNDS):
        residual = np.hypot(*(points_px - centre).T) - radius
        middle = np.median(residual)
        limit = _OUTLIER * max(1.4826 * np.median(np.abs(residual - middle)), _FLOOR_PX)
        now = np.abs(residual - middle) <= limit
        if now.sum() < 4:
            return None
        centre, radius = _solve(points_px[now], centre, radius)
        if np.array_equal(now, fits):
            break
        fits = now
    used = points_px[fits]
    pose = _poses(used)
    if pose.max() < 3:
        return None
    d = used - centre
    distance = np.hypot(*d.T)
    residual = distance - radius
    J = np.column_stack([-d / distance[:, None], -np.ones(len(used))])
    if np.linalg.cond(J) > _MAX_CONDITION:
        return None
    bread = np.linalg.inv(J.T @ J)
    scatter = float(np.sqrt((residual**2).sum() / max(len(used) - 3, 1)))
    n_poses = pose.max() + 1
    scores = np.zeros((n_poses, 3))
    np.add.at(scores, pose, J * residual[:, None])
    meat = scores.T @ scores * n_poses / max(n_poses - 3, 1) + _slow_error(used, pose, J, scatter)
    return Circle(centre, float(radius), scatter, bread @ meat @ bread, fits)


def _solve(points: Floats, centre: Floats, radius: float, loss: str = "linear") -> tuple[Floats, float]:
    def residual(x: Floats) -> Floats:
        return np.hypot(points[:, 0] - x[0], points[:, 1] - x[1]) - x[2]

    def jacobian(x: Floats) -> Floats:
        d = points - x[:2]
        distance = np.maximum(np.hypot(*d.T), 1e-9)
        return np.column_stack([-d / distance[:, None], -np.ones(len(points))])

    found = least_squares(residual, [*centre, radius], jacobian, loss=loss, x_scale="jac", method="trf", max_nfev=200)
    return found.x[:2], float(abs(found.x[2]))


def _slow_error(points: Floats, pose: NDArray[np.int64], J: Floats, scatter: float) -> Floats:
    """Return Jᵀ·K·J for an error that varies slowly along the path, with variance `_SLOW_PX`² plus the scatter's."""
    n_poses = pose.max() + 1
    count = np.bincount(pose)
    place = np.column_stack([np.bincount(pose, points[:, axis]) / count for axis in (0, 1)])
    slope = np.zeros((n_poses, 3))
    np.add.at(slope, pose, J)
    distance2 = ((place[:, None, :] - place[None, :, :]) ** 2).sum(axis=2)
    correlation = np.mean([np.exp(-distance2 / (2.0 * length**2)) for length in _SLOW_LENGTHS_PX], axis=0)
    K = (_SLOW_PX**2 + scatter**2) * correlation
    return slope.T @ K @ slope


def _poses(points: Floats) -> NDArray[np.int64]:
    """Return the pose index (n,) of each point: points in the same square pixel are one pose."""
    _, pose = np.unique(np.round(points).astype(np.int64), axis=0, return_inverse=True)
    return pose.reshape(-1)
