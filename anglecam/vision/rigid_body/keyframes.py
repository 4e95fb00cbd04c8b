"""Frames in which the head is known, and how it is found in any other frame by holding that against one of them.

A frame is turned back onto a key by a guess, and what is left is followed by the method of Lucas and Kanade (1981),
forwards and backwards; what comes home and moves as one body is the head.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats, Image
from anglecam.vision.image.clusters import group_neighbours
from anglecam.vision.image.transforms import apply_motion, fit_rigid, inverse_motion, turn_of
from anglecam.vision.rigid_body.feature_matching import MIN_POINTS, MIN_TURN, fit_body_motion

POINT_GROUPS = 8
"""Of points that lie together."""
_KEY_EVERY = np.radians(8.0)
_MOST_KEYS = 15
_BLURRED_KEY_EVERY = np.radians(25.0)
_SHARP_SHARE = 0.9
"""Of the sharpest frame's fine detail; with less a frame is blurred by its motion, and a key only where it must be."""
_WITNESSES = 5
"""Samples in which a key's corners must move with the head."""
_ROUNDS = 20
_CORNERS = 400
_APART_PX = 6.0
_CORNER_SHARE = 0.002
"""Of the best corner's strength; what is too faint to be followed back again is left out later."""
_MARGIN_PX = 32
"""Around a key's points, in which they are sought."""
_LEVELS = 3
_WINDOW_PX = 17
"""Of Lucas and Kanade."""
_RETURN_PX = 0.5
"""A point that is followed there and back comes home to within this."""
_FINE_PX = 1.5
"""Tolerance for tracked points to move as one body."""
_AGAIN = np.radians(1.0)
"""A patch turned by more than this is not followed exactly: turn the frame back by what was found, and repeat."""
_FLOOR_PX = 0.02
"""No point is followed better, even in a key itself."""


@dataclass(frozen=True)
class Keyframe:
    """A frame that others are held against."""

    pose: Floats
    """(3, 3) from the reference into this frame."""
    corner: Floats
    """(2,) of the part of it that is kept."""
    image: Image
    """That part, grey."""
    points: Floats
    """(k, 2) of the head, px of the whole frame."""
    group: NDArray[np.intp]
    """(k,) which of them lie together."""


@dataclass(frozen=True)
class KeyframeMatch:
    """The head in one frame, held against a key."""

    motion: Floats
    """(3, 3) from key to frame."""
    inlier: NDArray[np.bool_]
    """(k,) of the key's points."""
    variance: float
    """Of a point's place in either direction, px²."""
    grouped: float
    """By how much more groups of points scatter in turn than single points would let them; about 1 if independent."""


def match_keyframe(key: Keyframe, grey: Image, guess: Floats) -> KeyframeMatch | None:
    """Find the motion from key to frame: turn the frame back by the guess, and follow what is still off.

    Parameters
    ----------
    key : Key
        Preferably one in which the head is turned nearly alike.
    grey : ndarray
        (h, w) the frame.
    guess : ndarray
        (3, 3) motion from key to frame, some pixels and degrees off at most.

    Returns
    -------
    Seen or None
        ``None`` where too few points move as one body.
    """
    if len(key.points) < MIN_POINTS:
        return None
    at = (key.points - key.corner).astype(np.float32)
    seen = None
    for _ in range(3):
        from_part = guess @ np.array([[1.0, 0.0, key.corner[0]], [0.0, 1.0, key.corner[1]], [0.0, 0.0, 1.0]])
        flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
        straight = cv2.warpAffine(
            grey, from_part[:2], key.image.shape[::-1], flags=flags, borderMode=cv2.BORDER_REPLICATE
        )
        there, forth = _follow(key.image, straight, at)
        back, home = _follow(straight, key.image, there)
        found = apply_motion(from_part, there.astype(float))
        height, width = grey.shape
        inside = ((found >= 0) & (found <= [width - 1, height - 1])).all(axis=1)
        followed = forth & home & inside & (np.hypot(*(back - at).T) < _RETURN_PX)
        body = fit_body_motion(key.points[followed], found[followed], _FINE_PX)
        if body is None:
            return None
        motion, among = body
        inlier = np.zeros(len(key.points), bool)
        inlier[np.flatnonzero(followed)[among]] = True
        seen = KeyframeMatch(motion, inlier, *_scatter(motion, key.points[inlier], found[inlier], key.group[inlier]))
        if abs(turn_of(motion @ inverse_motion(guess))) < _AGAIN:
            break
        guess = motion
    return seen


def choose_keyframes(images: Sequence[Image], poses: dict[int, Floats], head: Floats) -> tuple[list[Keyframe], float]:
    """Keep sharp frames at turns that differ, with the corners that move with the head in other samples.

    Parameters
    ----------
    images : sequence of ndarray
        (h, w) grey.
    poses : dict
        (3, 3) motion of the head from the reference, for the images in which it was found.
    head : ndarray
        (n, 2) places of its features in the reference, px.

    Returns
    -------
    keys : list
        None, where too little of the head can be followed.
    spread : float
        Standard deviation of one key's word on the turn of another, rad.
    """
    turns = {i: turn_of(pose) for i, pose in poses.items()}
    hulls = {i: _hull(images[i], apply_motion(pose, head)) for i, pose in poses.items()}
    sharp = {i: _sharpness(images[i], hulls[i]) for i in poses}
    enough = _SHARP_SHARE * max(sharp.values())
    apart = max(MIN_TURN, np.ptp(list(turns.values())) / 6)
    keys: dict[int, Keyframe] = {}
    for i in sorted(poses, key=lambda i: -sharp[i]):
        gap = _KEY_EVERY if sharp[i] >= enough else _BLURRED_KEY_EVERY
        if len(keys) == _MOST_KEYS or any(abs(turns[i] - turns[k]) < gap for k in keys):
            continue
        key = _key(images[i], poses[i], hulls[i])
        witnesses = sorted((k for k in turns if abs(turns[k] - turns[i]) >= apart), key=lambda k: turns[k])
        votes, asked = np.zeros(len(key.points)), 0
        for k in witnesses[:: max(1, len(witnesses) // _WITNESSES)]:
            seen = match_keyframe(key, images[k], poses[k] @ inverse_motion(poses[i]))
            if seen is not None:
                votes, asked = votes + seen.inlier, asked + 1
        kept = votes > 0.5 * asked
        if kept.sum() >= MIN_POINTS:
            keys[i] = replace(key, points=key.points[kept], group=group_neighbours(key.points[kept], POINT_GROUPS))
    return _hold_together(list(keys.values()), [images[i] for i in keys])


def _hull(image: Image, points: Floats) -> Image:
    hull = np.zeros(image.shape, np.uint8)
    cv2.fillConvexPoly(hull, cv2.convexHull(points.astype(np.float32)).round().astype(np.int32), 255)
    return cv2.dilate(hull, np.ones((_MARGIN_PX, _MARGIN_PX), np.uint8))


def _sharpness(image: Image, hull: Image) -> float:
    return float(cv2.Laplacian(cv2.GaussianBlur(image, (0, 0), 1.5), cv2.CV_32F)[hull > 0].std())


def _hold_together(keys: list[Keyframe], images: Sequence[Image]) -> tuple[list[Keyframe], float]:
    """Measure every key against every other, and give it the mean of what they say of its pose.

    Returns
    -------
    keys : list
        With better poses.
    spread : float
        Standard deviation of one key's word on the turn of another, rad.
    """
    pairs: dict[tuple[int, int], Floats] = {}
    for i, key in enumerate(keys):
        for j, other in enumerate(keys):
            seen = None if i == j else match_keyframe(key, images[j], other.pose @ inverse_motion(key.pose))
            if seen is not None:
                pairs[i, j] = seen.motion
    poses, said = [key.pose for key in keys], np.zeros(0)
    for _ in range(_ROUNDS if pairs else 0):
        off = {(i, j): motion @ poses[i] @ inverse_motion(poses[j]) for (i, j), motion in pairs.items()}
        said = np.array([turn_of(o) for o in off.values()])
        for j in range(1, len(keys)):
            about = keys[j].points
            votes = [apply_motion(o, about) for (_, of), o in off.items() if of == j]
            if votes:
                poses[j] = fit_rigid(about, np.mean([about, *votes], axis=0)) @ poses[j]
    spread = float(np.sqrt(np.mean(said**2))) if len(said) else 0.0
    return [replace(key, pose=pose) for key, pose in zip(keys, poses, strict=True)], spread


def _key(image: Image, pose: Floats, hull: Image) -> Keyframe:
    corners = cv2.goodFeaturesToTrack(image, _CORNERS, _CORNER_SHARE, _APART_PX, mask=hull, blockSize=5)
    points = np.zeros((0, 2)) if corners is None else np.array(corners, dtype=float)[:, 0]
    if not len(points):
        return Keyframe(pose, np.zeros(2), image[:0], points, np.zeros(0, np.intp))
    low = np.maximum(np.floor(points.min(axis=0)).astype(int) - _MARGIN_PX, 0)
    high = np.minimum(np.ceil(points.max(axis=0)).astype(int) + _MARGIN_PX, image.shape[::-1])
    part = np.ascontiguousarray(image[low[1] : high[1], low[0] : high[0]])
    return Keyframe(pose, low.astype(float), part, points, group_neighbours(points, POINT_GROUPS))


def _follow(here: Image, there: Image, points: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    window = (_WINDOW_PX, _WINDOW_PX)
    found, status, _ = cv2.calcOpticalFlowPyrLK(  # type: ignore[call-overload]
        here, there, points[:, None], None, winSize=window, maxLevel=_LEVELS
    )
    return found[:, 0], status[:, 0] == 1


def _scatter(motion: Floats, start: Floats, end: Floats, group: NDArray[np.intp]) -> tuple[float, float]:
    """Return the variance of a point's place, and how much more than that groups of neighbours scatter in turn."""
    off = end - apply_motion(motion, start)
    variance = max(float((off**2).sum() / (2 * len(off) - 3)), _FLOOR_PX**2)
    arm = end - end.mean(axis=0)
    pull = off[:, 0] * arm[:, 1] - off[:, 1] * arm[:, 0]
    by_group = np.bincount(group, pull)
    return variance, float((by_group**2).sum() / (variance * (arm**2).sum()))
