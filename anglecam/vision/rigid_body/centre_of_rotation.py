"""The turns of a body that turns about one centre, from where single frames have it.

A body that turns by θ about c moves its middle m by s = (R(θ) − 1)(m − c). What the frames' own places leave over
from that, beyond their noise, is how far the centre wanders; a place says as much about the turn as that allows.
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

_FEWEST = 10
"""Frames."""
_TRUST = 4.0
"""Degrees of freedom that the whole clip's scatter between groups has against a single frame's."""
_SHARED_PX = 0.025
"""Standard uncertainty of a key's place that no number of points improves: light, interpolation."""
_BLUR_SHARE = 0.025
"""Standard uncertainty for each radian that the head turns from frame to frame. Levels are no measure of light (gamma),
so a blurred edge seems to move towards its dark side, and a dark back of a head and a bright face move alike: measured
0.03 with gamma 2.2 and a shutter open for a third of the time."""
_ALIKE = 5.0
"""Neighbours among the 30 turns at which the centre of rotation is told: light, codec and blur err alike in them."""
_OUTLYING = 4.0
"""Times the usual distance from the fit beyond which a place is left out."""


@dataclass(frozen=True)
class RigidMotion:
    """The head's motion in the n frames of a clip."""

    turn: Floats
    """(n,) counter-clockwise as seen, from the median pose, rad; NaN where it was lost."""
    sigma: Floats
    """(n,) standard uncertainty of ``turn``, rad."""
    pivot_px: Floats
    """(2,) centre of rotation, px."""
    pivot_covariance_px2: Floats
    """(2, 2) px²."""
    pivot_scatter_px: float
    """Standard deviation, in either direction, of the head's place about what a fixed centre of rotation allows."""
    centre_px: Floats
    """(2,) middle of what was followed on the head, in the median pose, px."""
    status: tuple[str, ...]
    """``ok``, or ``no_mouth`` (the head is lost), ``occluded``, ``undecodable``."""


@dataclass(frozen=True)
class FramePose:
    """Where one frame has the body."""

    status: str
    """``ok``, or why not."""
    pose: Floats = field(default_factory=lambda: np.full((3, 3), np.nan))
    """(3, 3) from the reference into this frame."""
    information: Floats = field(default_factory=lambda: np.full((3, 3), np.nan))
    """(3, 3) about its turn, rad, and the shift of the middle, px."""
    grouped: float = float("nan")
    """By how much more groups of its points scatter in turn than single points would let them."""


def pose_information(pose: Floats, arm: Floats) -> Floats:
    """Return what points say of a pose, (3, 3) for its turn (rad) and the shift of the middle (px), at 1 px² each.

    Parameters
    ----------
    pose : ndarray
        (3, 3) from the reference.
    arm : ndarray
        (n, 2) from the middle to the points, in the reference, px.
    """
    slope = arm @ rotation(turn_of(pose) + np.pi / 2)
    total = slope.sum(axis=0)
    return np.block(
        [[np.array([[(slope**2).sum()]]), total[None]], [total[:, None], len(arm) * np.eye(2)]],
    )


def fit_common_centre(frames: Sequence[FramePose], middle: Floats, spread: float) -> RigidMotion | str:
    """Fit a centre of rotation that all frames share, and find the turns again about it.

    Parameters
    ----------
    frames : sequence of Placed
        Of the whole clip.
    middle : ndarray
        (2,) of the body in the reference, px.
    spread : float
        Standard uncertainty of a turn that no number of points improves, rad.

    Returns
    -------
    RigidMotion or str
        Why not, in a few words, where too little is seen or nothing turns.
    """
    status = tuple(frame.status for frame in frames)
    poses = np.array([frame.pose for frame in frames])
    information, grouped = np.array([frame.information for frame in frames]), np.array([f.grouped for f in frames])
    ok = np.array([s == OK for s in status])
    if ok.sum() < _FEWEST:
        return "what turns is seen in too few frames"
    turn = np.arctan2(poses[:, 0, 1], poses[:, 0, 0])
    turn[ok] = np.unwrap(turn[ok])
    shift = np.einsum("nij,j->ni", poses[:, :2, :2], middle) + poses[:, :2, 2] - middle
    # a frame that motion blurs scatters more than others, as far as so few groups can tell
    usual = max(1.0, float(np.median(grouped[ok])))
    more = (_TRUST * usual + POINT_GROUPS * grouped[ok]) / (_TRUST + POINT_GROUPS)
    covariance = np.linalg.inv(information[ok]) * np.maximum(more, 1.0)[:, None, None]
    place, arm, arm_covariance, wander = _fit_centre(turn[ok], shift[ok], covariance[:, 1:, 1:])
    covariance[:, 1:, 1:] += wander**2 * np.eye(2)
    weight = np.linalg.inv(covariance)
    free = np.column_stack([turn[ok], shift[ok]])
    about = turn[ok]
    for _ in range(3):
        model = np.column_stack([about, place + arm @ rotation(about) - arm])
        pull = np.column_stack([np.ones(len(about)), arm @ rotation(about + np.pi / 2)])
        gain = np.einsum("ni,nij->nj", pull, weight)
        about = about + np.einsum("ni,ni->n", gain, free - model) / np.einsum("ni,ni->n", gain, pull)
    median = float(np.median(about))
    turns, sigma = np.full(len(turn), np.nan), np.full(len(turn), np.nan)
    turns[ok] = about - median
    blur = _BLUR_SHARE * np.abs(np.gradient(about))
    reach = float(np.sqrt(np.median(information[ok, 0, 0] / information[ok, 1, 1])))
    sigma[ok] = np.sqrt(1.0 / np.einsum("ni,ni->n", gain, pull) + spread**2 + (_SHARED_PX / reach) ** 2 + blur**2)
    if np.ptp(turns[ok]) < MIN_TURN:
        return "nothing rigid is seen to turn"
    pivot = middle + place - arm
    centre = pivot + arm @ rotation(median)
    return RigidMotion(turns, sigma, pivot, arm_covariance, wander, centre, status)


def _fit_centre(turn: Floats, shift: Floats, noise: Floats) -> tuple[Floats, Floats, Floats, float]:
    """Fit shift = place + (R − 1)·arm, each turn counted once however long the head rests there.

    Returns
    -------
    place, arm : ndarray
        (2,) px.
    covariance : ndarray
        (2, 2) of the centre of rotation, middle + place − arm, px².
    wander : float
        px.
    """
    width = max(np.ptp(turn) / 30, 1e-6)
    pose = np.unique(np.round(turn / width), return_inverse=True)[1]
    count = np.bincount(pose)
    mean_turn = np.bincount(pose, turn) / count
    mean_shift = np.column_stack([np.bincount(pose, axis) / count for axis in shift.T])
    A = np.concatenate(
        [np.broadcast_to(np.eye(2), (len(count), 2, 2)), rotation(mean_turn).swapaxes(1, 2) - np.eye(2)], axis=2
    )
    keep = np.ones(len(count), bool)
    for _ in range(3):
        design, right = A[keep].reshape(-1, 4), mean_shift[keep].ravel()
        solution = np.linalg.lstsq(design, right, rcond=None)[0]
        off = np.hypot(*(mean_shift - A @ solution).T)
        keep = off <= _OUTLYING * max(float(np.median(off)), 1e-6)
    left = right - design @ solution
    variance = float(left @ left) / max(len(left) - 4, 1)
    to_centre = np.hstack([np.eye(2), -np.eye(2)])
    covariance = _ALIKE * variance * to_centre @ np.linalg.pinv(design.T @ design) @ to_centre.T
    every = shift - (solution[:2] + solution[2:] @ (rotation(turn) - np.eye(2)))
    excess = np.median((every**2).sum(axis=1)) - np.median(np.trace(noise, axis1=1, axis2=2))
    # the median of the square of a distance in the plane is 2 ln 2 of the variance of either coordinate
    return solution[:2], solution[2:], covariance, float(np.sqrt(max(excess, 0.0) / (2 * np.log(2))))
