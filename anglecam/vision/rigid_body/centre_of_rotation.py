"""Fit one centre of rotation to the poses of a rigid body, and the body's angle around it in every frame.

A body that rotates by θ around c displaces its middle m by s = (R(θ) − 1)(m − c). The residual of the frames' poses
from this relation, beyond their noise, is the scatter of the centre between frames. It limits how much a frame's place
contributes to its angle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from anglecam.data.series import OK
from anglecam.data.typing import Floats
from anglecam.vision.image.transforms import rotation, turn_of
from anglecam.vision.rigid_body.feature_matching import MIN_TURN
from anglecam.vision.rigid_body.keyframes import POINT_GROUPS

_MIN_FRAMES = 10
_CLIP_FREEDOM = 4.0
"""Weight of the whole clip's scatter between groups against a single frame's, in degrees of freedom."""
_SHARED_PX = 0.025
"""Standard uncertainty of a keyframe's place that no number of points reduces, px: light, interpolation."""
_BLUR_SHARE = 0.025
"""Standard uncertainty of the angle, rad, for each radian that the body rotates from frame to frame. Grey levels are
not proportional to light (gamma), so a blurred edge appears to move towards its dark side, and the dark back and the
bright face of a head move alike. Measured 0.03 with gamma 2.2 and a shutter open for a third of the time."""
_CORRELATED = 5.0
"""Variance factor for the correlation between neighbours among the 30 angles at which the centre of rotation is fitted:
light, codec and blur cause similar errors in them."""
_EVEN_PX = 0.3
"""Noise of a place up to which all places count alike, px."""
_OUTLIER = 4.0
"""Multiple of the median distance from the fit beyond which a place is rejected."""


@dataclass(frozen=True)
class RigidMotion:
    """The body's motion in the n frames of a clip."""

    turn: Floats
    """(n,) counter-clockwise as seen, from the median pose, rad; NaN where the body was lost."""
    sigma: Floats
    """(n,) standard uncertainty of ``turn`` about a known centre, rad."""
    pivot_sensitivity: Floats
    """(n, 2) change of ``turn`` with an error of the centre, rad/px."""
    pivot_px: Floats
    """(2,) centre of rotation, px."""
    pivot_covariance_px2: Floats
    """(2, 2) px²."""
    pivot_scatter_px: float
    """Standard deviation, in each direction, of the body's place around that for a fixed centre of rotation, px."""
    centre_px: Floats
    """(2,) middle of the tracked points, in the median pose, px."""
    extent_px: float
    """Root mean square distance of the tracked points from their middle, px."""
    status: tuple[str, ...]
    """``ok``, ``no_mouth`` (the body was lost), ``occluded`` or ``undecodable``."""


@dataclass(frozen=True)
class FramePose:
    """The body's pose in one frame."""

    status: str
    """``ok`` or the cause."""
    pose: Floats = field(default_factory=lambda: np.full((3, 3), np.nan))
    """(3, 3) from the reference into this frame."""
    information: Floats = field(default_factory=lambda: np.full((3, 3), np.nan))
    """(3, 3) information matrix of its rotation, rad, and of the displacement of the middle, px."""
    group_ratio: float = float("nan")
    """Scatter of the rotation between groups of points over that of independent points."""


def pose_information(pose: Floats, arm: Floats) -> Floats:
    """Return the information matrix of a pose from points with a variance of 1 px².

    Parameters
    ----------
    pose : ndarray
        (3, 3) from the reference.
    arm : ndarray
        (n, 2) from the middle to the points, in the reference, px.

    Returns
    -------
    ndarray
        (3, 3) for the rotation, rad, and the displacement of the middle, px.
    """
    slope = arm @ rotation(turn_of(pose) + np.pi / 2)
    total = slope.sum(axis=0)
    return np.block(
        [[np.array([[(slope**2).sum()]]), total[None]], [total[:, None], len(arm) * np.eye(2)]],
    )


def fit_common_centre(
    frames: Sequence[FramePose], middle: Floats, spread: float, place_px: float = 0.0
) -> RigidMotion | str:
    """Fit a centre of rotation that is common to all frames, and the body's angle around it in each.

    Parameters
    ----------
    frames : sequence of FramePose
        Of the whole clip.
    middle : ndarray
        (2,) of the body in the reference, px.
    spread : float
        Standard uncertainty of an angle that no number of points reduces, rad.
    place_px : float
        The same of a place, px, which varies with the angle.

    Returns
    -------
    RigidMotion or str
        The cause in a few words where too little is seen or nothing rotates.
    """
    status = tuple(frame.status for frame in frames)
    poses = np.array([frame.pose for frame in frames])
    information = np.array([frame.information for frame in frames])
    group_ratio = np.array([frame.group_ratio for frame in frames])
    ok = np.array([s == OK for s in status])
    if ok.sum() < _MIN_FRAMES:
        return "the rotating body is seen in too few frames"
    turn = np.arctan2(poses[:, 0, 1], poses[:, 0, 0])
    turn[ok] = np.unwrap(turn[ok])
    shift = np.einsum("nij,j->ni", poses[:, :2, :2], middle) + poses[:, :2, 2] - middle
    # A frame blurred by motion scatters more. So few groups estimate this only roughly, hence the weighted mean.
    usual = max(1.0, float(np.median(group_ratio[ok])))
    ratio = (_CLIP_FREEDOM * usual + POINT_GROUPS * group_ratio[ok]) / (_CLIP_FREEDOM + POINT_GROUPS)
    covariance = np.linalg.inv(information[ok]) * np.maximum(ratio, 1.0)[:, None, None]
    place, arm, centre_covariance, scatter = _fit_centre(turn[ok], shift[ok], covariance[:, 1:, 1:], place_px)
    covariance[:, 1:, 1:] += (scatter**2 + place_px**2) * np.eye(2)
    weight = np.linalg.inv(covariance)
    measured = np.column_stack([turn[ok], shift[ok]])
    fitted = turn[ok]
    for _ in range(3):
        model = np.column_stack([fitted, place + arm @ rotation(fitted) - arm])
        slope = np.column_stack([np.ones(len(fitted)), arm @ rotation(fitted + np.pi / 2)])
        gain = np.einsum("ni,nij->nj", slope, weight)
        fitted = fitted + np.einsum("ni,ni->n", gain, measured - model) / np.einsum("ni,ni->n", gain, slope)
    median = float(np.median(fitted))
    turns, sigma = np.full(len(turn), np.nan), np.full(len(turn), np.nan)
    turns[ok] = fitted - median
    blur = _BLUR_SHARE * np.abs(np.gradient(fitted))
    reach = float(np.sqrt(np.median(information[ok, 0, 0] / information[ok, 1, 1])))
    sigma[ok] = np.sqrt(1.0 / np.einsum("ni,ni->n", gain, slope) + spread**2 + (_SHARED_PX / reach) ** 2 + blur**2)
    if np.ptp(turns[ok]) < MIN_TURN:
        return "nothing rigid rotates"
    sensitivity = np.full((len(turn), 2), np.nan)
    total = np.einsum("ni,ni->n", gain, slope)
    sensitivity[ok] = np.einsum("nj,nkj->nk", gain[:, 1:], rotation(fitted) - np.eye(2)) / total[:, None]
    pivot = middle + place - arm
    centre = pivot + arm @ rotation(median)
    return RigidMotion(turns, sigma, sensitivity, pivot, centre_covariance, scatter, centre, reach, status)


def _fit_centre(turn: Floats, shift: Floats, noise: Floats, place_px: float) -> tuple[Floats, Floats, Floats, float]:
    """Fit shift = place + (R − 1)·arm, each angle counted once however long the body rests there.

    A direction in which the body's place is hardly seen, such as that along a stick, counts little.

    Parameters
    ----------
    turn : ndarray
        (n,) rad.
    shift : ndarray
        (n, 2) px.
    noise : ndarray
        (n, 2, 2) covariance of the shifts, px².
    place_px : float
        Standard uncertainty of a place that varies with the angle, px: no number of frames reduces its effect.

    Returns
    -------
    place, arm : ndarray
        (2,) px.
    covariance : ndarray
        (2, 2) of the centre of rotation, middle + place − arm, px².
    scatter : float
        Standard deviation of the centre between frames, px.
    """
    width = max(np.ptp(turn) / 30, 1e-6)
    pose = np.unique(np.round(turn / width), return_inverse=True)[1]
    count = np.bincount(pose)
    mean_turn = np.bincount(pose, turn) / count
    mean_shift = np.column_stack([np.bincount(pose, axis) / count for axis in shift.T])
    share = _EVEN_PX**2 * np.linalg.inv(noise + _EVEN_PX**2 * np.eye(2))
    mean_share = np.column_stack([np.bincount(pose, part) / count for part in share.reshape(-1, 4).T])
    weight = np.linalg.cholesky(mean_share.reshape(-1, 2, 2)).swapaxes(1, 2)
    A = np.concatenate(
        [np.broadcast_to(np.eye(2), (len(count), 2, 2)), rotation(mean_turn).swapaxes(1, 2) - np.eye(2)], axis=2
    )
    A, b = weight @ A, np.einsum("nij,nj->ni", weight, mean_shift)
    keep = np.ones(len(count), bool)
    for _ in range(3):
        design, right = A[keep].reshape(-1, 4), b[keep].ravel()
        solution = np.linalg.lstsq(design, right, rcond=None)[0]
        off = np.hypot(*(b - A @ solution).T)
        keep = off <= _OUTLIER * max(float(np.median(off)), 1e-6)
    residual = right - design @ solution
    variance = float(residual @ residual) / max(len(residual) - 4, 1)
    to_centre = np.hstack([np.eye(2), -np.eye(2)])
    variance = _CORRELATED * variance + len(right) * place_px**2
    covariance = variance * to_centre @ np.linalg.pinv(design.T @ design) @ to_centre.T
    off_px = shift - (solution[:2] + solution[2:] @ (rotation(turn) - np.eye(2)))
    seen = np.einsum("ni,nij,nj->n", off_px, share, off_px)
    excess = np.median(seen) - np.median(np.trace(share @ noise, axis1=1, axis2=2))
    # The median squared distance in the plane is 2 ln 2 times the variance of either coordinate.
    return solution[:2], solution[2:], covariance, float(np.sqrt(max(excess, 0.0) / (2 * np.log(2))))
