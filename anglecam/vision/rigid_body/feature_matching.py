"""What moves as one rigid body between two pictures.

Features that can be told apart at any angle (SIFT, Lowe 2004) are matched between the pictures; the sets that move as
one rigid body are found by random sampling (RANSAC, Fischler and Bolles 1981), the largest first, and peeled off one
after another until one of them turns. Scenery, a shoulder, a thing that swings by are other bodies or none.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats, Image
from anglecam.vision.image.transforms import apply_motion, fit_rigid, rotation, turn_of

MIN_POINTS = 10
"""Points; fewer are no body."""
MIN_TURN = np.radians(1.0)
"""Of a body that turns, rad."""
_FEATURES = 1000
_FEATURE_CONTRAST = 0.015
"""SIFT's own threshold is 0.04; skin has little contrast."""
_SIFT_WIDTH_PX = 960
"""Larger pictures are reduced before features are sought: coarse poses need no more."""
_DISTINCT = 0.8
"""Lowe's ratio of the best match's distance to the second best's."""
_COARSE_PX = 2.5
"""Tolerance for matched features to move as one body."""
_BODIES = 4
"""Rigid bodies that are peeled off a pair of frames in search of one that turns."""
_TRIALS = 200
"""Of two points each."""
_OUTLYING = 4.0
"""Times the usual distance from the body's motion beyond which a point is left out."""


@dataclass(frozen=True)
class Features:
    """Places in a picture that can be told apart at any angle."""

    points: Floats
    """(k, 2) px."""
    descriptors: NDArray[np.float32]
    """Of unit length."""


def find_features(grey: Image) -> Features:
    """Find a picture's features.

    Parameters
    ----------
    grey : ndarray
        (h, w).
    """
    reduction = max(1, -(-grey.shape[1] // _SIFT_WIDTH_PX))
    if reduction > 1:
        grey = cv2.resize(grey, None, fx=1 / reduction, fy=1 / reduction, interpolation=cv2.INTER_AREA)
    sift = cv2.SIFT_create(_FEATURES, contrastThreshold=_FEATURE_CONTRAST)  # type: ignore[attr-defined]
    marks, descriptors = sift.detectAndCompute(grey, None)
    points = np.array([mark.pt for mark in marks]).reshape(-1, 2)
    if descriptors is None:
        return Features(points, np.zeros((0, 128), np.float32))
    return Features((points + 0.5) * reduction - 0.5, descriptors / np.linalg.norm(descriptors, axis=1, keepdims=True))


def find_body_pose(body: Features, there: Features) -> Floats | None:
    """Find the motion (3, 3) that carries a body's features onto a picture's; ``None`` where too few agree on any."""
    pairs = _match(body, there)
    found = fit_body_motion(body.points[pairs[:, 0]], there.points[pairs[:, 1]], _COARSE_PX)
    return None if found is None else found[0]


def find_turning_body(one: Features, other: Features) -> tuple[NDArray[np.intp], NDArray[np.intp]] | None:
    """Find the largest set of features that moves as one rigid body and turns.

    Returns
    -------
    tuple or None
        (k, 2) numbers of all features that both pictures have, and which of these k move so; ``None`` where none do.
    """
    pairs = _match(one, other)
    start, end = one.points[pairs[:, 0]], other.points[pairs[:, 1]]
    left = np.arange(len(pairs))
    for _ in range(_BODIES):
        body = fit_body_motion(start[left], end[left], _COARSE_PX)
        if body is None:
            return None
        motion, among = body
        if abs(turn_of(motion)) >= MIN_TURN:
            return pairs, left[among]
        left = np.delete(left, among)
    return None


def fit_body_motion(start: Floats, end: Floats, tolerance_px: float) -> tuple[Floats, NDArray[np.intp]] | None:
    """Find the rigid motion on which most points agree, by random sampling of two, and refine it on them.

    Parameters
    ----------
    start, end : ndarray
        (n, 2) the same points in one picture and in the other, px.
    tolerance_px : float
        How far off a point of the body may be.

    Returns
    -------
    tuple or None
        The motion (3, 3) and the numbers of the points that go along; ``None`` where fewer than `FEWEST` do.
    """
    n = len(start)
    if n < MIN_POINTS:
        return None
    first, second = np.random.default_rng(0).integers(0, n, (2, _TRIALS))
    a, b = start[second] - start[first], end[second] - end[first]
    long = np.hypot(*a.T)
    stiff = (long > 4 * tolerance_px) & (np.abs(long - np.hypot(*b.T)) < 2 * tolerance_px)
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
    among = np.flatnonzero(agree[agree.sum(axis=1).argmax()])
    motion = np.eye(3)
    for _ in range(3):
        if len(among) < MIN_POINTS:
            return None
        motion = fit_rigid(start[among], end[among])
        off = np.hypot(*(end - apply_motion(motion, start)).T)
        usual = float(np.median(off[among]))
        among = np.flatnonzero(off < min(tolerance_px, _OUTLYING * max(usual, 0.02)))
    return (motion, among) if len(among) >= MIN_POINTS else None


def _match(one: Features, other: Features) -> NDArray[np.intp]:
    """Return (k, 2) numbers of features that are each other's likeness, and nobody else's."""
    if len(one.points) < 2 or len(other.points) < 2:
        return np.zeros((0, 2), np.intp)
    likeness = one.descriptors @ other.descriptors.T
    rows = np.arange(len(likeness))
    best = likeness.argmax(axis=1)
    first = likeness[rows, best]
    likeness[rows, best] = -1.0
    # unit vectors: the square of a distance is 2 − 2·likeness
    distinct = 1.0 - first < _DISTINCT**2 * (1.0 - likeness.max(axis=1))
    return np.column_stack([rows, best])[distinct]
