"""The standard uncertainty of each angle: every source of error, the parts they form, and what counts as random.

The standard uncertainty combines the known sources of error (GUM 5.1.2): the noise of the picture, the mark's position
on the pixel grid and in the codec's blocks, and the pivot, each times its sensitivity. Errors that differ from frame to
frame are scatter, which a mean or a filter reduces. Errors of pivot, zero and view are common to all frames. An error
that depends on the pose lies between: it scatters where the pose changes much from frame to frame, and not at rest. The
scatter of the angles themselves says how much of it counts as random.

`anglecam.measurement.angles` and `anglecam.measurement.fine_angles` name the sources of an angle; how a source becomes
an uncertainty, and how sources add, is here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_LEAST_DIFFERENCES = 30
"""Fewest differences from which a scatter is estimated; its standard uncertainty is then about a fifth."""
_FAR = 4.0
"""Standard deviations beyond which a position's distance from the circle counts as an error of that frame alone."""


@dataclass(frozen=True)
class Sigma:
    """Standard uncertainty of n angles, in three independent parts, rad."""

    noise: NDArray[np.float64]
    """(n,) of what differs from frame to frame even at rest."""
    pose: NDArray[np.float64]
    """(n,) of what is equal whenever pose and motion recur."""
    common: NDArray[np.float64]
    """(n,) of what all frames share."""

    @property
    def total(self) -> NDArray[np.float64]:
        """(n,) all parts, added in squares."""
        return in_squares(self.noise, self.pose, self.common)

    def with_sources(
        self, *, pose: Sequence[NDArray[np.float64]] = (), common: Sequence[NDArray[np.float64]] = ()
    ) -> Sigma:
        """Return this with further independent sources, (n,) rad each, added to two of its parts."""
        return Sigma(self.noise, in_squares(self.pose, *pose), in_squares(self.common, *common))

    def random(self, scatter: Scatter) -> NDArray[np.float64]:
        """Return the part that is independent from frame to frame, given the `scatter` of the angles, rad.

        The noise counts, and of the part that depends on the pose what the usual scatter shows beyond the noise. If the
        noise exceeds even the RMS scatter, only that much of it is noise: the mark's distance from the pivot, from
        which noise is estimated, also varies slowly. Where the scatter is not known (NaN), both parts count whole.
        """
        noise2, pose2 = float(np.median(self.noise**2)), float(np.median(self.pose**2))
        known = np.isfinite(scatter.usual)
        shown = (scatter.usual**2 - noise2) / pose2 if known and pose2 > 0.0 else 1.0
        scatters = scatter.rms**2 / noise2 if known and noise2 > 0.0 else 1.0
        return np.sqrt(min(scatters, 1.0) * self.noise**2 + min(max(shown, 0.0), 1.0) * self.pose**2)


@dataclass(frozen=True)
class Scatter:
    """Standard deviation of what differs from frame to frame in a smooth motion, rad, by two estimates."""

    usual: float
    """From the median of the absolute differences: that of most frames."""
    rms: float
    """From their mean square: at least a third of the scatter in any tenth of the frames."""


def scatter_of(time: NDArray[np.float64], angle: NDArray[np.float64]) -> Scatter:
    """Estimate the standard deviation of what differs from frame to frame in a smooth motion.

    Fourth differences of five evenly spaced frames remove any cubic; of independent errors they have √70 times the
    standard deviation. A motion that is not smooth makes both estimates larger.

    Parameters
    ----------
    time : ndarray
        (n,) s, increasing.
    angle : ndarray
        (n,) rad.

    Returns
    -------
    Scatter
        NaN with fewer than `_LEAST_DIFFERENCES`.

    Examples
    --------
    >>> time = np.arange(3000) / 30
    >>> noise = 1e-3 * np.random.default_rng(0).standard_normal(3000)
    >>> found = scatter_of(time, 0.2 * np.sin(3.0 * time) + noise)
    >>> round(1e3 * found.usual, 1), round(1e3 * found.rms, 1)
    (1.0, 1.0)
    """
    if len(time) < _LEAST_DIFFERENCES + 4:
        return Scatter(float("nan"), float("nan"))
    steps = np.lib.stride_tricks.sliding_window_view(np.diff(time), 4)
    even = np.ptp(steps, axis=1) < 0.5 * steps.min(axis=1)  # no frame is missing; time stamps may be rounded
    differences = np.diff(angle, n=4)[even] / np.sqrt(70.0)
    if len(differences) < _LEAST_DIFFERENCES:
        return Scatter(float("nan"), float("nan"))
    return Scatter(1.4826 * float(np.median(np.abs(differences))), float(np.sqrt((differences**2).mean())))


def in_squares(*parts: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """Return the root of the sum of the squares of independent uncertainties.

    Examples
    --------
    >>> float(in_squares(3.0, 4.0, 12.0))
    13.0
    """
    return np.sqrt(sum(np.square(part) for part in parts))


def sigma_by_pivot(
    sensitivity: NDArray[np.float64], covariance_px2: NDArray[np.float64], neutral: NDArray[np.bool_] | None
) -> NDArray[np.float64]:
    """Return the uncertainty that the pivot contributes; what a frame shares with neutral cancels.

    Parameters
    ----------
    sensitivity : ndarray
        (n, 2) change of the direction by a displacement of the pivot, rad/px.
    covariance_px2 : ndarray
        (2, 2) of the pivot, px².
    neutral : ndarray, optional
        (n,) frames whose mean is subtracted; ``None`` where neutral is declared.

    Returns
    -------
    ndarray
        (n,) rad.
    """
    against = sensitivity if neutral is None else sensitivity - sensitivity[neutral].mean(axis=0)
    return np.sqrt(np.einsum("ni,ij,nj->n", against, covariance_px2, against))


def sigma_of_mean(
    turn: NDArray[np.float64], noise: NDArray[np.float64], pose: float, filmed_px: NDArray[np.float64]
) -> float:
    """Return the standard uncertainty of the mean rotation of frames in few poses, rad.

    The error that depends on the position on the pixel grid does not average out at rest. Where frames at rest scatter
    more than the pixels' noise explains, that excess part differs from frame to frame and does average out: errors of a
    codec that noise varies, or of a shaking camera.

    Parameters
    ----------
    turn, noise : ndarray
        (n,) rotations and their noise, rad.
    pose : float
        Standard deviation of the part that depends on the pose, rad.
    filmed_px : ndarray
        (n, 2) positions of the mark in the picture; frames on the same pixel share a pose, px.
    """
    n, places = len(turn), np.unique(np.round(filmed_px).astype(int), axis=0, return_inverse=True)[1].ravel()
    count = np.bincount(places)
    independent = 0.0
    if n > len(count):
        within = turn - (np.bincount(places, turn) / count)[places]
        independent = float(np.clip((within**2).sum() / (n - len(count)) - (noise**2).mean(), 0.0, pose**2))
    return float(np.sqrt(((noise**2).mean() + independent) / n + (pose**2 - independent) / len(count)))


@dataclass(frozen=True)
class PlaceErrors:
    """Error of the mark's position, in two parts."""

    noise_px: NDArray[np.float64]
    """(n,) standard deviation along the path of the part that differs from frame to frame even at rest, px."""
    pose_px: float
    """Standard deviation of the part that depends on the pose alone and is equal whenever the pose recurs, px."""


def place_errors(
    mark_px: NDArray[np.float64],
    off_px: NDArray[np.float64],
    across_px: NDArray[np.float64],
    along_px: NDArray[np.float64],
) -> PlaceErrors:
    """Estimate the error of the mark's position from its distance to the pivot, which motion does not change.

    Frames on the same pixel share a pose. The variation among them is noise. The variation of their means from pose to
    pose is the error of the pose. All poses have the same weight, however long the mark stays in one.

    Parameters
    ----------
    mark_px : ndarray
        (n, 2) positions, px.
    off_px : ndarray
        (n,) distance from the pivot minus the fitted radius, px.
    across_px, along_px : ndarray
        (n,) standard deviations due to the noise of the pixels alone, px, along the lever and along the path; they set
        the relative noise of each frame, and the ratio of the noise along the path to that along the lever.

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
    fitted = 3  # degrees of freedom used by centre and radius
    pose2 = 0.0
    if len(count) > 2 * fitted:
        robust = 1.4826 * float(np.median(np.abs(mean - np.median(mean))))
        inlying = np.abs(mean - np.median(mean)) <= _FAR * max(robust, np.sqrt(noise2))
        between = float((mean[inlying] ** 2).sum()) / max(int(inlying.sum()) - fitted, 1)
        pose2 = max(between - noise2 * float((1 / count[inlying]).mean()), 0.0)
    # a position far off the circle is wrong by that much in one direction, and may be in the other
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
) -> Sigma:
    """Return the standard uncertainty of the angle from neutral in each frame.

    With t the unit vector along the path and R the lever arm, an error e of the position rotates the line by t·e/R,
    and an error p of the pivot by −t·p/R. The error of the neutral line is subtracted, and the part that both lines
    share cancels::

        u² = [noise² + noise₀²/n₀ + pose²·(1 + 1/k − 2ρ/k) + (t − t₀)ᵀ·C·(t − t₀)] / R²

    where k is the number of poses in neutral and ρ = exp(−d²/2) is the correlation of a pose's error over a distance of
    d pixels. noise₀ and C are common to all frames.

    Parameters
    ----------
    mark_px : ndarray
        (n, 2) positions, px.
    pivot_px, pivot_covariance_px2 : ndarray
        (2,) px and (2, 2) px².
    errors : PlaceErrors
        Of these positions.
    neutral : ndarray, optional
        (n,) frames whose mean line is neutral; ``None`` where neutral is declared and therefore without error.

    Returns
    -------
    Sigma
        (n,) rad.
    """
    arm = mark_px - pivot_px
    lever = np.hypot(*arm.T)
    along = np.column_stack([-arm[:, 1], arm[:, 0]]) / lever[:, None]
    if neutral is None:
        pose, rest = np.full(len(lever), errors.pose_px**2), 0.0
    else:
        distance2 = ((mark_px - mark_px[neutral].mean(axis=0)) ** 2).sum(axis=1)
        poses = len(np.unique(np.round(mark_px[neutral]).astype(int), axis=0))
        rest = float((errors.noise_px[neutral] ** 2).mean()) / int(neutral.sum())
        # the mean over many poses has a small error, and shares little of it with any single pose
        pose = errors.pose_px**2 * (1.0 + 1.0 / poses - 2.0 / poses * np.exp(-distance2 / 2.0))
    pivot = sigma_by_pivot(along, pivot_covariance_px2, neutral)
    return Sigma(errors.noise_px / lever, np.sqrt(pose) / lever, np.sqrt(rest + pivot**2) / lever)
