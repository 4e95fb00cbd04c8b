"""The circle that a mark on a turning body draws: its centre is the centre of rotation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from skimage.measure import CircleModel

from anglecam.data.typing import Floats

_STEPS = 8
_GATE = 4.0
"""Robust standard deviations beyond which a point is taken to lie off the circle."""
_FLOOR_PX = 0.02
"""No film places a mark better than this; keeps the gate open on exact data."""
_SLOW_PX = 0.04
"""Least standard deviation of a centroid's error that changes slowly along the path, px: what passes behind the
mark's edge, and chroma at half resolution, shift it by 0.02 to 0.08 px in MJPG films."""
_FLATTEST = 1e6
"""Condition of the fit beyond which a path is a line: an arc of less than a tenth of a degree, of whose covariance no
digit would be left."""
_SLOW_LENGTHS_PX = (4.0, 16.0)
"""Ways along the path over which that error changes: what passes behind the edge, a codec's blocks."""


@dataclass(frozen=True)
class Circle:
    """A circle fitted to a path."""

    centre_px: Floats
    """(2,) px."""
    radius_px: float
    """px."""
    scatter_px: float
    """Standard deviation of the distance from the circle over the points that fit it, px."""
    covariance_px2: Floats
    """(3, 3) covariance of centre and radius, px², robust against errors that neighbouring poses share."""
    fits: NDArray[np.bool_]
    """(n,) which points were used."""

    @property
    def centre_covariance_px2(self) -> Floats:
        """(2, 2) covariance of the centre, px²."""
        return self.covariance_px2[:2, :2]


def circle_through(points_px: Floats) -> tuple[Floats, float]:
    """Fit a circle algebraically, with scikit-image.

    Parameters
    ----------
    points_px : ndarray
        (n, 2) points, n ≥ 3.

    Returns
    -------
    centre_px : ndarray
        (2,), NaN where the points stand on a line or on one spot.
    radius_px : float
        Infinite there.
    """
    model = CircleModel.from_estimate(points_px)
    if not model:
        return np.full(2, np.nan), np.inf
    return np.asarray(model.center, dtype=float), float(model.radius)


def fit_circle(points_px: Floats, *, start: tuple[Floats, float] | None = None) -> Circle | None:
    """Fit a circle to a path, least squares of the distance, points that lie off it left out.

    The cost is Σ (|p − o| − R)². The covariance is the cluster-robust sandwich (Liang & Zeger 1986) with poses
    closer than a pixel as one cluster: the error of a centroid depends on where it falls on the pixel grid, so a
    mark at rest tells the same story a hundred times. To it comes what the residual cannot show, because on a short
    arc the fit swallows it: an error that changes slowly along the path looks like curvature and moves the centre
    by its size over 1 − cos of half the arc. It is propagated as a Gaussian process, B·Jᵀ·K·J·B with B = (JᵀJ)⁻¹.

    Parameters
    ----------
    points_px : ndarray
        (n, 2) points.
    start : tuple of (ndarray, float), optional
        Centre and radius to begin with; where they lead nowhere, and without them, the algebraic fit.

    Returns
    -------
    Circle or None
        ``None`` with fewer than 4 points on fewer than 4 poses, or where they stand on a line.
    """
    if len(points_px) < 4:
        return None
    begun = None if start is None else _fit_from(points_px, *start)
    return begun or _fit_from(points_px, *circle_through(points_px))


def _fit_from(points_px: Floats, centre: Floats, radius: float) -> Circle | None:
    if not np.isfinite(radius):
        return None
    # near is not there: of a mouth that rests in two places one would lie beyond the gate of the start's own circle
    centre, radius = _solve(points_px, centre, radius, loss="soft_l1")
    fits = np.ones(len(points_px), bool)
    for _ in range(_STEPS):
        residual = np.hypot(*(points_px - centre).T) - radius
        middle = np.median(residual)
        wide = _GATE * max(1.4826 * np.median(np.abs(residual - middle)), _FLOOR_PX)
        now = np.abs(residual - middle) <= wide
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
    if np.linalg.cond(J) > _FLATTEST:
        return None
    bread = np.linalg.inv(J.T @ J)
    scatter = float(np.sqrt((residual**2).sum() / max(len(used) - 3, 1)))
    n_poses = pose.max() + 1
    told = np.zeros((n_poses, 3))
    np.add.at(told, pose, J * residual[:, None])
    meat = told.T @ told * n_poses / max(n_poses - 3, 1) + _slow_error(used, pose, J, scatter)
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
    """Return Jᵀ·K·J for an error that changes slowly along the path and is at least as large as what the fit left."""
    n_poses = pose.max() + 1
    count = np.bincount(pose)
    place = np.column_stack([np.bincount(pose, points[:, axis]) / count for axis in (0, 1)])
    slope = np.zeros((n_poses, 3))
    np.add.at(slope, pose, J)
    apart2 = ((place[:, None, :] - place[None, :, :]) ** 2).sum(axis=2)
    alike = np.mean([np.exp(-apart2 / (2.0 * length**2)) for length in _SLOW_LENGTHS_PX], axis=0)
    K = (_SLOW_PX**2 + scatter**2) * alike
    return slope.T @ K @ slope


def _poses(points: Floats) -> NDArray[np.int64]:
    """Give each pose of a path its number: points in the same square pixel share a number."""
    _, pose = np.unique(np.round(points).astype(np.int64), axis=0, return_inverse=True)
    return pose.reshape(-1)
