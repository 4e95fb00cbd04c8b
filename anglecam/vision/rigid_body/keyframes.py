"""Keyframes: frames in which the body's pose is known, and the measurement of any other frame against one of them.

A frame is rotated back onto a keyframe by a guess, and the remaining displacement of the keyframe's points is tracked
by the method of Lucas and Kanade (1981), forwards and backwards. Points that return to their start and move as one
rigid body belong to the body.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats, Image
from anglecam.vision.image.clusters import group_neighbours
from anglecam.vision.image.transforms import apply_motion, fit_rigid, inverse_motion, turn_of, turned_about
from anglecam.vision.rigid_body.feature_matching import MIN_POINTS, MIN_TURN, fit_body_motion

POINT_GROUPS = 8
"""Groups of neighbouring points in a keyframe."""
_INTERVAL = np.radians(8.0)
"""Least angle between keyframes, rad."""
_MAX_KEYFRAMES = 15
_BLURRED_INTERVAL = np.radians(25.0)
"""Least angle from a blurred keyframe to the others, rad."""
_SHARP_SHARE = 0.9
"""Share of the sharpest frame's fine detail below which a frame is blurred by its motion. A blurred frame becomes a
keyframe only where there is no sharp one."""
_WITNESSES = 5
"""Samples in which a keyframe's points must move with the body."""
_ROUNDS = 20
"""Rounds of the adjustment of the keyframes' poses."""
_MAX_POINTS = 400
_SEPARATION_PX = 6.0
"""Least distance between points, px."""
_CORNER_QUALITY = 0.002
"""Least strength of a corner, relative to the strongest. Corners too weak to be tracked back are rejected later."""
_MARGIN_PX = 32
"""Margin around a keyframe's points, in which they are searched for, px."""
_PYRAMID_LEVELS = 3
"""Pyramid levels of Lucas and Kanade's method."""
_WINDOW_PX = 17
"""Side of its window, px."""
_RETURN_PX = 0.5
"""Distance from its start, px, within which a point that is tracked forwards and backwards must return."""
_FINE_PX = 1.5
"""Tolerance for tracked points to move as one body, px."""
_REPEAT_TURN = np.radians(1.0)
"""Remaining rotation, rad, beyond which a patch is not tracked exactly: the frame is rotated back by the result, and
tracked again."""
_TRIED = np.radians(15.0)
"""Angle between the rotations at which a body is compared with itself, rad: the displacement of a point at an arm of
150 px is then tracked from half of it."""
_SAME_TURN = 0.05
"""Largest rotation of a body that counts as none, rad: less than half the pitch of sixty teeth."""
_FLOOR_PX = 0.02
"""Least standard deviation of a tracked point, px: not even points of the keyframe itself are tracked better."""


@dataclass(frozen=True)
class Keyframe:
    """A frame with a known pose with which others are compared."""

    pose: Floats
    """(3, 3) from the reference into this frame."""
    corner: Floats
    """(2,) upper left corner of the part that is kept, px."""
    image: Image
    """That part, grey."""
    points: Floats
    """(k, 2) of the body, px of the whole frame."""
    group: NDArray[np.intp]
    """(k,) group of neighbours to which each point belongs."""


@dataclass(frozen=True)
class KeyframeMatch:
    """The body in one frame, measured against a keyframe."""

    motion: Floats
    """(3, 3) from keyframe to frame."""
    inlier: NDArray[np.bool_]
    """(k,) which of the keyframe's points follow the motion."""
    variance: float
    """Variance of a point's place in each direction, px²."""
    group_ratio: float
    """Scatter of the rotation between groups of points over that of independent points; around 1 if independent."""


def match_keyframe(keyframe: Keyframe, grey: Image, guess: Floats) -> KeyframeMatch | None:
    """Find the motion from keyframe to frame: rotate the frame back by the guess, and track what remains.

    Parameters
    ----------
    keyframe : Keyframe
        Preferably one in which the body has nearly the same angle.
    grey : ndarray
        (h, w) the frame.
    guess : ndarray
        (3, 3) motion from keyframe to frame, at most some pixels and degrees off.

    Returns
    -------
    KeyframeMatch or None
        ``None`` where too few points move as one body.
    """
    if len(keyframe.points) < MIN_POINTS:
        return None
    at = (keyframe.points - keyframe.corner).astype(np.float32)
    match = None
    for _ in range(3):
        corner = keyframe.corner
        from_part = guess @ np.array([[1.0, 0.0, corner[0]], [0.0, 1.0, corner[1]], [0.0, 0.0, 1.0]])
        flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
        size = keyframe.image.shape[::-1]
        straight = cv2.warpAffine(grey, from_part[:2], size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
        there, tracked = _track(keyframe.image, straight, at)
        back, tracked_back = _track(straight, keyframe.image, there)
        found = apply_motion(from_part, there.astype(float))
        height, width = grey.shape
        inside = ((found >= 0) & (found <= [width - 1, height - 1])).all(axis=1)
        followed = tracked & tracked_back & inside & (np.hypot(*(back - at).T) < _RETURN_PX)
        body = fit_body_motion(keyframe.points[followed], found[followed], _FINE_PX)
        if body is None:
            return None
        motion, members = body
        inlier = np.zeros(len(keyframe.points), bool)
        inlier[np.flatnonzero(followed)[members]] = True
        scatter = _scatter(motion, keyframe.points[inlier], found[inlier], keyframe.group[inlier])
        match = KeyframeMatch(motion, inlier, *scatter)
        if abs(turn_of(motion @ inverse_motion(guess))) < _REPEAT_TURN:
            break
        guess = motion
    return match


def repetition(keyframe: Keyframe, centre_px: Floats, share: float) -> float | None:
    """Return the least rotation after which a body looks like itself, as a gear does from tooth to tooth.

    Parameters
    ----------
    keyframe : Keyframe
        Of the body.
    centre_px : ndarray
        (2,) centre of rotation.
    share : float
        Share of the keyframe's points that has to be found again: as many as make a frame measured.

    Returns
    -------
    float or None
        In rad; ``None`` for a body that shows its angle in the whole turn.
    """
    itself = replace(keyframe, corner=np.zeros(2), points=keyframe.points - keyframe.corner)
    centre, found = centre_px - keyframe.corner, []
    for turn in np.arange(_TRIED, 2.0 * np.pi - _TRIED / 2.0, _TRIED):
        match = match_keyframe(itself, keyframe.image, turned_about(centre, turn))
        if match is not None and match.inlier.sum() >= share * len(keyframe.points):
            found.append(abs(turn_of(match.motion)))
    return min((turn for turn in found if turn > _SAME_TURN), default=None)


def choose_keyframes(images: Sequence[Image], poses: dict[int, Floats], body: Floats) -> tuple[list[Keyframe], float]:
    """Choose sharp frames at different angles, with the corners that move with the body in other samples.

    Parameters
    ----------
    images : sequence of ndarray
        (h, w) grey.
    poses : dict
        (3, 3) motion of the body from the reference, for the images in which it was found.
    body : ndarray
        (n, 2) places of its features in the reference, px.

    Returns
    -------
    keyframes : list of Keyframe
        Empty where too little of the body can be tracked.
    spread : float
        Standard deviation of the angle of one keyframe as measured against another, rad.
    """
    turns = {i: turn_of(pose) for i, pose in poses.items()}
    hulls = {i: _hull(images[i], apply_motion(pose, body)) for i, pose in poses.items()}
    sharpness = {i: _sharpness(images[i], hulls[i]) for i in poses}
    enough = _SHARP_SHARE * max(sharpness.values())
    apart = max(MIN_TURN, np.ptp(list(turns.values())) / 6)
    chosen: dict[int, Keyframe] = {}
    for i in sorted(poses, key=lambda i: -sharpness[i]):
        gap = _INTERVAL if sharpness[i] >= enough else _BLURRED_INTERVAL
        if len(chosen) == _MAX_KEYFRAMES or any(abs(turns[i] - turns[k]) < gap for k in chosen):
            continue
        keyframe = _keyframe(images[i], poses[i], hulls[i])
        witnesses = sorted((k for k in turns if abs(turns[k] - turns[i]) >= apart), key=lambda k: turns[k])
        votes, voters = np.zeros(len(keyframe.points)), 0
        for k in witnesses[:: max(1, len(witnesses) // _WITNESSES)]:
            match = match_keyframe(keyframe, images[k], poses[k] @ inverse_motion(poses[i]))
            if match is not None:
                votes, voters = votes + match.inlier, voters + 1
        kept = votes > 0.5 * voters
        if kept.sum() >= MIN_POINTS:
            group = group_neighbours(keyframe.points[kept], POINT_GROUPS)
            chosen[i] = replace(keyframe, points=keyframe.points[kept], group=group)
    return _adjust_poses(list(chosen.values()), [images[i] for i in chosen])


def _hull(image: Image, points: Floats) -> Image:
    """Return the mask of the points' convex hull with a margin."""
    hull = np.zeros(image.shape, np.uint8)
    cv2.fillConvexPoly(hull, cv2.convexHull(points.astype(np.float32)).round().astype(np.int32), 255)
    return cv2.dilate(hull, np.ones((_MARGIN_PX, _MARGIN_PX), np.uint8))


def _sharpness(image: Image, hull: Image) -> float:
    return float(cv2.Laplacian(cv2.GaussianBlur(image, (0, 0), 1.5), cv2.CV_32F)[hull > 0].std())


def _adjust_poses(keyframes: list[Keyframe], images: Sequence[Image]) -> tuple[list[Keyframe], float]:
    """Measure every keyframe against every other, and set each pose to the mean of its measurements.

    Returns
    -------
    keyframes : list of Keyframe
        With adjusted poses.
    spread : float
        Standard deviation of the angle of one keyframe as measured against another, rad.
    """
    pairs: dict[tuple[int, int], Floats] = {}
    for i, keyframe in enumerate(keyframes):
        for j, other in enumerate(keyframes):
            guess = other.pose @ inverse_motion(keyframe.pose)
            match = None if i == j else match_keyframe(keyframe, images[j], guess)
            if match is not None:
                pairs[i, j] = match.motion
    poses, turns = [keyframe.pose for keyframe in keyframes], np.zeros(0)
    for _ in range(_ROUNDS if pairs else 0):
        off = {(i, j): motion @ poses[i] @ inverse_motion(poses[j]) for (i, j), motion in pairs.items()}
        turns = np.array([turn_of(o) for o in off.values()])
        for j in range(1, len(keyframes)):
            points = keyframes[j].points
            measured = [apply_motion(o, points) for (_, of), o in off.items() if of == j]
            if measured:
                poses[j] = fit_rigid(points, np.mean([points, *measured], axis=0)) @ poses[j]
    spread = float(np.sqrt(np.mean(turns**2))) if len(turns) else 0.0
    return [replace(keyframe, pose=pose) for keyframe, pose in zip(keyframes, poses, strict=True)], spread


def _keyframe(image: Image, pose: Floats, hull: Image) -> Keyframe:
    """Make a keyframe with the corners inside the hull."""
    corners = cv2.goodFeaturesToTrack(image, _MAX_POINTS, _CORNER_QUALITY, _SEPARATION_PX, mask=hull, blockSize=5)
    points = np.zeros((0, 2)) if corners is None else np.array(corners, dtype=float)[:, 0]
    if not len(points):
        return Keyframe(pose, np.zeros(2), image[:0], points, np.zeros(0, np.intp))
    low = np.maximum(np.floor(points.min(axis=0)).astype(int) - _MARGIN_PX, 0)
    high = np.minimum(np.ceil(points.max(axis=0)).astype(int) + _MARGIN_PX, image.shape[::-1])
    part = np.ascontiguousarray(image[low[1] : high[1], low[0] : high[0]])
    return Keyframe(pose, low.astype(float), part, points, group_neighbours(points, POINT_GROUPS))


def _track(first: Image, second: Image, points: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Track points (k, 2) from one image to another; return their places (k, 2) and which were found (k,)."""
    window = (_WINDOW_PX, _WINDOW_PX)
    found, status, _ = cv2.calcOpticalFlowPyrLK(  # type: ignore[call-overload]
        first, second, points[:, None], None, winSize=window, maxLevel=_PYRAMID_LEVELS
    )
    return found[:, 0], status[:, 0] == 1


def _scatter(motion: Floats, start: Floats, end: Floats, group: NDArray[np.intp]) -> tuple[float, float]:
    """Return the variance of a point's place, px², and the scatter of the rotation between groups of neighbours.

    The second is the sum over groups of the squared torque Σ off × arm, divided by its value for independent points.
    """
    off = end - apply_motion(motion, start)
    variance = max(float((off**2).sum() / (2 * len(off) - 3)), _FLOOR_PX**2)
    arm = end - end.mean(axis=0)
    torque = off[:, 0] * arm[:, 1] - off[:, 1] * arm[:, 0]
    by_group = np.bincount(group, torque)
    return variance, float((by_group**2).sum() / (variance * (arm**2).sum()))
