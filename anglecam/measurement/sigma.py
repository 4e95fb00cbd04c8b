"""From errors in pixels to errors of the angle: worst cases, and the standard uncertainty of each frame.

The paper allows the mouth to be misplaced by 6 px to 10 px and states 0.28° and 0.68° for it (Section on Fig. 8).
No single lever arm gives both: as worst cases they belong to arms of 1228 px and 842.5 px, and at 842.5 px a miss
of 6 px is at most 0.408°. The 0.28° is one particular point on the circle of possible places; what is computed here
is the worst of them, at the arm that was measured.

A worst case is no uncertainty. The standard uncertainty joins what is known to err (GUM 5.1.2): the noise of the
picture, the mouth's place on the pixel grid and in the codec's blocks, and the pivot, each times its sensitivity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

_FAR = 4.0
"""Standard deviations beyond which a place's distance from the circle is told for that frame alone."""


def worst_case(radius_px: float, lever_px: ArrayLike) -> NDArray[np.float64]:
    """Return the largest angle error of a lever whose one end lies anywhere within a circle: asin(r/R).

    The line from the pivot is farthest from the true direction where it touches the circle about the true point.

    Parameters
    ----------
    radius_px : float
        Radius r of the circle about the true mouth point, px.
    lever_px : array_like
        Lever arm R, pivot to mouth, px; NaN stays NaN.

    Returns
    -------
    ndarray
        rad, in the shape of ``lever_px``; π where the circle reaches the pivot, for then any direction is possible.
    """
    return _asin_or_pi(radius_px, lever_px)


def worst_case_both_ends(radius_px: float, lever_px: ArrayLike) -> NDArray[np.float64]:
    """Return the largest angle error where pivot and mouth may each lie anywhere within a circle: asin(2r/R).

    Parameters
    ----------
    radius_px : float
        Radius r of both circles, px.
    lever_px : array_like
        Lever arm R, px; NaN stays NaN.

    Returns
    -------
    ndarray
        rad, in the shape of ``lever_px``; π where the circles meet.
    """
    return _asin_or_pi(2.0 * radius_px, lever_px)


@dataclass(frozen=True)
class PlaceErrors:
    """How wrong the mouth's place is, in two parts."""

    noise_px: NDArray[np.float64]
    """(n,) standard deviation along the path of what differs from frame to frame even at rest, px."""
    pose_px: float
    """Standard deviation of what depends on the pose alone, the same whenever the mouth is in that place, px."""


def place_errors(
    mark_px: NDArray[np.float64],
    off_px: NDArray[np.float64],
    across_px: NDArray[np.float64],
    along_px: NDArray[np.float64],
) -> PlaceErrors:
    """Tell how well the mouth is placed from its distance to the pivot, which motion does not change.

    Frames on the same pixel share a pose. What varies among them is noise; what their means still vary by, from
    pose to pose, is the error of the pose. The poses count alike, however long the mouth stays in one.

    Parameters
    ----------
    mark_px : ndarray
        (n, 2) places, px.
    off_px : ndarray
        (n,) distance from the pivot less the fitted radius, px.
    across_px, along_px : ndarray
        (n,) standard deviations that the noise of the pixels alone would give, px, along the lever and along the
        path; they set the share of each frame, and how much less or more the noise is along the path.

    Returns
    -------
    PlaceErrors
        Both parts.
    """
    _, pose, count = np.unique(np.round(mark_px).astype(int), axis=0, return_inverse=True, return_counts=True)
    pose = pose.reshape(-1)
    mean = np.bincount(pose, off_px) / count
    share = (across_px / np.median(across_px)) ** 2
    noise2 = float(np.median(across_px)) ** 2
    repeats = (off_px - mean[pose])[count[pose] > 1] / np.sqrt(share * (1.0 - 1.0 / count[pose]))[count[pose] > 1]
    if len(repeats) >= 20:
        noise2 = (1.4826 * float(np.median(np.abs(repeats)))) ** 2
    fitted = 3  # centre and radius have taken their part of the scatter
    pose2 = 0.0
    if len(count) > 2 * fitted:
        robust = 1.4826 * float(np.median(np.abs(mean - np.median(mean))))
        inlying = np.abs(mean - np.median(mean)) <= _FAR * max(robust, np.sqrt(noise2))
        between = float((mean[inlying] ** 2).sum()) / max(int(inlying.sum()) - fitted, 1)
        pose2 = max(between - noise2 * float((1 / count[inlying]).mean()), 0.0)
    # A place far off the circle is wrong by that much in one direction, and may be in the other.
    usual = np.sqrt(noise2 * share + pose2)
    far = np.where(np.abs(off_px) > _FAR * usual, np.abs(off_px), 0.0)
    noise = np.sqrt(noise2 * share) * along_px / across_px
    return PlaceErrors(np.hypot(noise, far), float(np.sqrt(pose2)))


def angle_sigma(
    mark_px: NDArray[np.float64],
    pivot_px: NDArray[np.float64],
    pivot_covariance_px2: NDArray[np.float64],
    errors: PlaceErrors,
    neutral: NDArray[np.bool_] | None,
) -> NDArray[np.float64]:
    """Return the standard uncertainty of the angle from neutral in each frame.

    With t the unit vector along the path and R the lever arm, a place wrong by e turns the line by t·e/R and a
    pivot wrong by p by −t·p/R; the neutral line's own error is subtracted. What both lines share cancels::

        u² = [noise² + noise₀²/n₀ + pose²·(1 + 1/k − 2ρ/k) + (t − t₀)ᵀ·C·(t − t₀)] / R²

    where k is the number of poses in neutral and ρ = exp(−d²/2) says how much of a pose's error is the same at a
    distance of d pixels.

    Parameters
    ----------
    mark_px : ndarray
        (n, 2) places, px.
    pivot_px, pivot_covariance_px2 : ndarray
        (2,) px and (2, 2) px².
    errors : PlaceErrors
        Of those places.
    neutral : ndarray, optional
        (n,) frames whose mean line is neutral; ``None`` where neutral is declared, which has no error of its own.

    Returns
    -------
    ndarray
        (n,) rad.
    """
    arm = mark_px - pivot_px
    lever = np.hypot(*arm.T)
    along = np.column_stack([-arm[:, 1], arm[:, 0]]) / lever[:, None]
    if neutral is None:
        place = errors.noise_px**2 + errors.pose_px**2
        turned = along
    else:
        apart2 = ((mark_px - mark_px[neutral].mean(axis=0)) ** 2).sum(axis=1)
        poses = len(np.unique(np.round(mark_px[neutral]).astype(int), axis=0))
        rest = float((errors.noise_px[neutral] ** 2).mean()) / int(neutral.sum())
        # A neutral that is the mean over many poses errs little, and little of it is shared with any one of them.
        pose = errors.pose_px**2 * (1.0 + 1.0 / poses - 2.0 / poses * np.exp(-apart2 / 2.0))
        place = errors.noise_px**2 + rest + pose
        turned = along - along[neutral].mean(axis=0)
    pivot = np.einsum("ni,ij,nj->n", turned, pivot_covariance_px2, turned)
    return np.sqrt(place + pivot) / lever


def _asin_or_pi(reach_px: float, lever_px: ArrayLike) -> NDArray[np.float64]:
    lever = np.asarray(lever_px, float)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = reach_px / lever
    angle = np.arcsin(np.clip(ratio, 0.0, 1.0))
    return np.where(ratio >= 1.0, np.pi, angle)
