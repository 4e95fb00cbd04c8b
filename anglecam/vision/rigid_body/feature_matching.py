"""Rigid bodies between two pictures: matched features and the motions on which they agree.

Features that are recognised at any rotation (SIFT, Lowe 2004) are matched between the pictures. Sets of matches that
move as one rigid body are found by random sampling (RANSAC, Fischler and Bolles 1981), the largest first, and removed
one after another until one of them rotates. Scenery, a shoulder and a thing that swings past are other bodies, or
belong to none.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats, Image
from anglecam.vision.image.transforms import apply_motion, fit_rigid, rotation, turn_of

MIN_POINTS = 10
"""Fewest points that count as a body."""
MIN_TURN = np.radians(1.0)
"""Least rotation of a body that counts as rotating, rad."""
_FEATURES = 1000
_FEATURE_CONTRAST = 0.015
"""SIFT's contrast threshold. Its default is 0.04, too high for skin."""
_SIFT_WIDTH_PX = 960
"""Wider pictures are reduced before features are detected; coarse poses do not need more."""
_DISTINCT = 0.8
"""Lowe's ratio: largest distance of the best match, relative to that of the second best."""
_COARSE_PX = 2.5
"""Tolerance for matched features to move as one body, px."""
_STILL_PX = 1.0
"""Displacement up to which a feature may be at rest, px. A ball that swings around a screw keeps its distance from it,
but neither rotates."""
_BODIES = 4
"""Rigid bodies that are removed from a pair of pictures in search of one that rotates."""
_TRIALS = 200
"""Random samples of two points each."""
_OUTLIER = 4.0
"""Multiple of the median distance from the body's motion beyond which a point is rejected."""


@dataclass(frozen=True)
class Features:
    """The features of one picture."""

    points: Floats
    """(k, 2) px."""
    descriptors: NDArray[np.float32]
    """(k, 128) of unit length."""


def find_features(grey: Image) -> Features:
    """Detect a picture's features.

    Parameters
    ----------
    grey : ndarray
        (h, w) grey levels.

    Returns
    -------
    Features
        At most 1000.
    """
    reduction = max(1, -(-grey.shape[1] // _SIFT_WIDTH_PX))
    if reduction > 1:
        grey = cv2.resize(grey, None, fx=1 / reduction, fy=1 / reduction, interpolation=cv2.INTER_AREA)
    sift = cv2.SIFT_create(_FEATURES, contrastThreshold=_FEATURE_CONTRAST)  # type: ignore[attr-defined]
    keypoints, descriptors = sift.detectAndCompute(grey, None)
    points = np.array([keypoint.pt for keypoint in keypoints]).reshape(-1, 2)
    if descriptors is None:
        return Features(points, np.zeros((0, 128), np.float32))
    return Features((points + 0.5) * reduction - 0.5, descriptors / np.linalg.norm(descriptors, axis=1, keepdims=True))


def find_body_pose(body: Features, picture: Features) -> Floats | None:
    """Return the motion (3, 3) from a body's features to a picture's; ``None`` where too few agree on any."""
    pairs = _match(body, picture)
    found = fit_body_motion(body.points[pairs[:, 0]], picture.points[pairs[:, 1]], _COARSE_PX)
    return None if found is None else found[0]


def find_turning_body(one: Features, other: Features) -> tuple[NDArray[np.intp], NDArray[np.intp]] | None:
    """Find the largest set of features that moves as one rigid body and rotates, without those that may be at rest.

    Parameters
    ----------
    one, other : Features
        Of two pictures.

    Returns
    -------
    tuple or None
        (k, 2) indices of all features that match between the two pictures, and the rows of them that belong to the
        body; ``None`` where no body rotates.
    """
    pairs = _match(one, other)
    start, end = one.points[pairs[:, 0]], other.points[pairs[:, 1]]
    remaining = np.arange(len(pairs))
    for _ in range(_BODIES):
        body = fit_body_motion(start[remaining], end[remaining], _COARSE_PX)
        if body is None:
            return None
        motion, members = body
        if abs(turn_of(motion)) >= MIN_TURN:
            moving = remaining[members[np.hypot(*(end - start)[remaining[members]].T) > _STILL_PX]]
            alone = fit_body_motion(start[moving], end[moving], _COARSE_PX)
            if alone is not None and abs(turn_of(alone[0])) >= MIN_TURN:
                return pairs, moving[alone[1]]
        remaining = np.delete(remaining, members)
    return None


def fit_body_motion(start: Floats, end: Floats, tolerance_px: float) -> tuple[Floats, NDArray[np.intp]] | None:
    """Find the rigid motion on which most points agree, by random samples of two points, and refine it on them.

    Parameters
    ----------
    start, end : ndarray
        (n, 2) the same points in one picture and in the other, px.
    tolerance_px : float
        Largest distance of a point of the body from the motion, px.

    Returns
    -------
    tuple or None
        The motion (3, 3) and the indices of the points that follow it; ``None`` where fewer than `MIN_POINTS` do.
    """
    n = len(start)
    if n < MIN_POINTS:
        return None
    first, second = np.random.default_rng(0).integers(0, n, (2, _TRIALS))
    a, b = start[second] - start[first], end[second] - end[first]
    length = np.hypot(*a.T)
    stiff = (length > 4 * tolerance_px) & (np.abs(length - np.hypot(*b.T)) < 2 * tolerance_px)
    if not stiff.any():
        return None
    first, second, a, b = first[stiff], second[stiff], a[stiff], b[stiff]
    turn = np.arctan2(a[:, 0] * -b[:, 1] + a[:, 1] * b[:, 0], (a * b).sum(axis=1))
    half = 0.5 * (start[first] + start[second])
    place = 0.5 * (end[first] + end[second]) - np.einsum("tj,tji->ti", half, rotation(turn))
    c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
    off_x = c * start[:, 0] + s * start[:, 1] + place[:, :1] - end[:, 0]
    off_y = c * start[:, 1] - s * start[:, 0] + place[:, 1:] - end[:, 1]
    agree = off_x**2 + off_y**2 < tolerance_px**2
    members = np.flatnonzero(agree[agree.sum(axis=1).argmax()])
    motion = np.eye(3)
    for _ in range(3):
        if len(members) < MIN_POINTS:
            return None
        motion = fit_rigid(start[members], end[members])
        off = np.hypot(*(end - apply_motion(motion, start)).T)
        usual = float(np.median(off[members]))
        members = np.flatnonzero(off < min(tolerance_px, _OUTLIER * max(usual, 0.02)))
    return (motion, members) if len(members) >= MIN_POINTS else None


def _match(one: Features, other: Features) -> NDArray[np.intp]:
    """Return (k, 2) indices of each feature and its best match that pass Lowe's ratio test."""
    if len(one.points) < 2 or len(other.points) < 2:
        return np.zeros((0, 2), np.intp)
    similarity = one.descriptors @ other.descriptors.T
    rows = np.arange(len(similarity))
    best = similarity.argmax(axis=1)
    first = similarity[rows, best]
    similarity[rows, best] = -1.0
    # The squared distance of unit vectors is 2 − 2·similarity.
    distinct = 1.0 - first < _DISTINCT**2 * (1.0 - similarity.max(axis=1))
    return np.column_stack([rows, best])[distinct]
