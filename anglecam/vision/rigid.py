"""The turn of a rigid head with no mark on it: what moves as one body, and turns, is the head.

A few frames, spread over the clip, teach what turns: features that can be told apart at any angle (SIFT, Lowe 2004)
are matched between them, and the sets that move as one rigid body are peeled off one after another (RANSAC, Fischler
and Bolles 1981) until one of them turns. Scenery, a shoulder, a thing that swings by are other bodies or none.

Frames at different turns are kept as keys. Every frame of the clip is turned back onto the nearest key and what is
left is followed by Lucas and Kanade's method, forwards and backwards. Each frame is held against a key and not against
the frame before it, so errors do not add up however long the clip.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2

from anglecam.series import OK
from anglecam.video.frames import Frame, Image

Floats = NDArray[np.float64]

LOST, HIDDEN, UNDECODABLE = "no_mouth", "occluded", "undecodable"

_LEARNT = 16
"""Samples from which the head is learnt, at most: they are compared in pairs."""
_FEATURES = 1000
_FEATURE_CONTRAST = 0.015
"""SIFT's own threshold is 0.04; skin has little contrast."""
_SIFT_WIDTH_PX = 960
"""Larger pictures are reduced before features are sought: coarse poses need no more."""
_DISTINCT = 0.8
"""Lowe's ratio of the best match's distance to the second best's."""
_COARSE_PX, _FINE_PX = 2.5, 1.5
"""Tolerances for points to move as one body: matched features, tracked points."""
_BODIES = 4
"""Rigid bodies that are peeled off a pair of frames in search of one that turns."""
_FEWEST = 10
"""Points; fewer are no body."""
_LEAST_TURN = np.radians(1.0)
_KEY_EVERY = np.radians(8.0)
_MOST_KEYS = 15
_BLURRED_KEY_EVERY = np.radians(25.0)
_SHARP_SHARE = 0.9
"""Of the sharpest frame's fine detail; with less a frame is blurred by its motion, and a key only where it must be."""
_ROUNDS = 20
_CORNERS = 400
_APART_PX = 6.0
_CORNER_SHARE = 0.002
"""Of the best corner's strength; what is too faint to be followed back again is left out later."""
_MARGIN_PX = 32
"""Around a key's points, in which they are sought."""
_RETURN_PX = 0.5
"""A point that is followed there and back comes home to within this."""
_AGREE_SHARE = 0.3
"""Of a key's points that must be seen, as one body, for a frame to be measured."""
_GROUPS = 8
_TRUST = 4.0
"""Degrees of freedom that the whole clip's scatter between groups has against a single frame's."""
_TRIALS = 200
"""Of two points each."""
_FLOOR_PX = 0.02
"""No point is followed better, even in a key itself."""
_SHARED_PX = 0.025
"""Standard uncertainty of a key's place that no number of points improves: light, interpolation."""
_BLUR_SHARE = 0.025
"""Standard uncertainty for each radian that the head turns from frame to frame. Levels are no measure of light (gamma),
so a blurred edge seems to move towards its dark side, and a dark back of a head and a bright face move alike: measured
0.03 with gamma 2.2 and a shutter open for a third of the time."""
_ALIKE = 5.0
"""Neighbours among the 30 turns at which the centre of rotation is told: light, codec and blur err alike in them."""
_OUTLYING = 4.0
"""Times the usual distance from a fit beyond which a point is left out."""
_LEVELS = 3
_WINDOW_PX = 17
"""Of Lucas and Kanade."""
_AGAIN = np.radians(1.0)
"""A patch turned by more than this is not followed exactly: turn the frame back by what was found, and repeat."""
_WITNESSES = 5
"""Samples in which a key's corners must move with the head."""


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
    wander_px: float
    """Standard deviation, in either direction, of the head's place about what a fixed centre of rotation allows."""
    centre_px: Floats
    """(2,) middle of what was followed on the head, in the median pose, px."""
    status: tuple[str, ...]
    """``ok``, or ``no_mouth`` (the head is lost), ``occluded``, ``undecodable``."""


@dataclass(frozen=True)
class _Features:
    points: Floats
    """(k, 2) px."""
    descriptors: NDArray[np.float32]
    """Of unit length."""


@dataclass(frozen=True)
class _Key:
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
class _Seen:
    """The head in one frame, held against a key."""

    motion: Floats
    """(3, 3) from key to frame."""
    inlier: NDArray[np.bool_]
    """(k,) of the key's points."""
    variance: float
    """Of a point's place in either direction, px²."""
    grouped: float
    """By how much more groups of points scatter in turn than single points would let them; about 1 if independent."""


def follow_head(frames: Iterator[Frame], samples: Sequence[Image], noise: float) -> RigidMotion | str:
    """Find how the head is turned in every frame, from nothing but that it is rigid and turns.

    Parameters
    ----------
    frames : iterator of Frame
        The whole clip; read once, one frame at a time.
    samples : sequence of ndarray
        Some of its frames, spread over the clip, (height, width, 3).
    noise : float
        Standard deviation of the pixels, grey levels.

    Returns
    -------
    RigidMotion or str
        Why not, in a few words, where nothing in the clip turns.
    """
    learnt = _learn([cv2.cvtColor(s, cv2.COLOR_BGR2GRAY) for s in samples], noise)
    if isinstance(learnt, str):
        return learnt
    head, keys, spread = learnt
    poses, information, grouped, status = [], [], [], []
    before: list[tuple[float, Floats]] = []
    middle = np.concatenate([_move(_back(k.pose), k.points) for k in keys]).mean(axis=0)
    for frame in frames:
        seen, key, partly = None, keys[0], False
        if frame.image is not None:
            grey = cv2.cvtColor(frame.image, cv2.COLOR_BGR2GRAY)
            for guess in _guesses(before, frame.time, head, grey):
                key = min(keys, key=lambda k: abs(_turn(guess @ _back(k.pose))))
                seen = _hold_against(key, grey, guess @ _back(key.pose))
                if seen is not None and seen.inlier.sum() >= _AGREE_SHARE * len(key.points):
                    break
                partly = partly or seen is not None
                seen = None
        if seen is None:
            before = []
            poses.append(np.full((3, 3), np.nan))
            information.append(np.full((3, 3), np.nan))
            grouped.append(np.nan)
            status.append(UNDECODABLE if frame.image is None else HIDDEN if partly else LOST)
            continue
        pose = seen.motion @ key.pose
        before = [*before[-1:], (frame.time, pose)]
        rigid = _move(_back(key.pose), key.points[seen.inlier])
        poses.append(pose)
        information.append(_information(pose, rigid - middle) / seen.variance)
        grouped.append(seen.grouped)
        status.append(OK)
    return _about_one_centre(np.array(poses), np.array(information), np.array(grouped), tuple(status), middle, spread)


def _guesses(before: list[tuple[float, Floats]], time: float, head: _Features, grey: Image) -> Iterator[Floats]:
    """Yield poses to start from: the motion goes on, it pauses, the head is found anew."""
    if len(before) == 2:
        (t0, first), (t1, last) = before
        step = last @ _back(first)
        yield np.linalg.matrix_power(step, max(1, round((time - t1) / (t1 - t0)))) @ last
    if before:
        yield before[-1][1]
    there = _describe(grey)
    pairs = _match(head, there)
    found = _consensus(head.points[pairs[:, 0]], there.points[pairs[:, 1]], _COARSE_PX)
    if found is not None:
        yield found[0]


def _learn(samples: Sequence[Image], noise: float) -> tuple[_Features, list[_Key], float] | str:
    """Find what turns, and frames to hold the others against."""
    images = _unlike(samples, noise)
    images = [images[i] for i in np.unique(np.linspace(0, len(images) - 1, _LEARNT).round().astype(int))]
    if len(images) < 2:
        return "nothing moves"
    features = [_describe(image) for image in images]
    turning = [np.zeros(len(f.points)) for f in features]
    matched = [np.zeros(len(f.points)) for f in features]
    for i, j in combinations(range(len(images)), 2):
        pairs = _match(features[i], features[j])
        inlier = _turning_body(features[i].points[pairs[:, 0]], features[j].points[pairs[:, 1]])
        if inlier is not None:
            matched[i][pairs[:, 0]] += 1
            matched[j][pairs[:, 1]] += 1
            turning[i][pairs[inlier, 0]] += 1
            turning[j][pairs[inlier, 1]] += 1
    reference = int(np.argmax([t.sum() for t in turning]))
    of_head = turning[reference] > 0.5 * matched[reference]
    if of_head.sum() < _FEWEST:
        return "nothing rigid is seen to turn"
    head = _Features(features[reference].points[of_head], features[reference].descriptors[of_head])
    poses: dict[int, Floats] = {}
    for i, there in enumerate(features):
        pairs = _match(head, there)
        found = _consensus(head.points[pairs[:, 0]], there.points[pairs[:, 1]], _COARSE_PX)
        if found is not None:
            poses[i] = found[0]
    if np.ptp([_turn(pose) for pose in poses.values()]) < _LEAST_TURN:
        return "nothing rigid is seen to turn"
    keys, spread = _choose_keys(images, poses, head.points)
    return (head, keys, spread) if keys else "too little of what turns can be followed"


def _unlike(samples: Sequence[Image], noise: float) -> list[Image]:
    """Leave out samples that look like one before them: they would cost time and teach nothing."""
    kept: list[Image] = []
    small: list[Floats] = []
    for sample in samples:
        reduced = cv2.resize(sample, None, fx=1 / 8, fy=1 / 8, interpolation=cv2.INTER_AREA).astype(float)
        if all(np.abs(reduced - other).max() > 3.0 + noise for other in small):
            kept.append(sample)
            small.append(reduced)
    return kept


def _choose_keys(images: Sequence[Image], poses: dict[int, Floats], head: Floats) -> tuple[list[_Key], float]:
    """Keep sharp frames at turns that differ, with the corners that move with the head in other samples."""
    turns = {i: _turn(pose) for i, pose in poses.items()}
    hulls = {i: _hull(images[i], _move(pose, head)) for i, pose in poses.items()}
    sharp = {i: _sharpness(images[i], hulls[i]) for i in poses}
    enough = _SHARP_SHARE * max(sharp.values())
    apart = max(_LEAST_TURN, np.ptp(list(turns.values())) / 6)
    keys: dict[int, _Key] = {}
    for i in sorted(poses, key=lambda i: -sharp[i]):
        gap = _KEY_EVERY if sharp[i] >= enough else _BLURRED_KEY_EVERY
        if len(keys) == _MOST_KEYS or any(abs(turns[i] - turns[k]) < gap for k in keys):
            continue
        key = _key(images[i], poses[i], hulls[i])
        witnesses = sorted((k for k in turns if abs(turns[k] - turns[i]) >= apart), key=lambda k: turns[k])
        votes, asked = np.zeros(len(key.points)), 0
        for k in witnesses[:: max(1, len(witnesses) // _WITNESSES)]:
            seen = _hold_against(key, images[k], poses[k] @ _back(poses[i]))
            if seen is not None:
                votes, asked = votes + seen.inlier, asked + 1
        kept = votes > 0.5 * asked
        if kept.sum() >= _FEWEST:
            keys[i] = replace(key, points=key.points[kept], group=_groups(key.points[kept]))
    return _hold_together(list(keys.values()), [images[i] for i in keys])


def _hull(image: Image, points: Floats) -> Image:
    hull = np.zeros(image.shape, np.uint8)
    cv2.fillConvexPoly(hull, cv2.convexHull(points.astype(np.float32)).round().astype(np.int32), 255)
    return cv2.dilate(hull, np.ones((_MARGIN_PX, _MARGIN_PX), np.uint8))


def _sharpness(image: Image, hull: Image) -> float:
    return float(cv2.Laplacian(cv2.GaussianBlur(image, (0, 0), 1.5), cv2.CV_32F)[hull > 0].std())


def _hold_together(keys: list[_Key], images: Sequence[Image]) -> tuple[list[_Key], float]:
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
            seen = None if i == j else _hold_against(key, images[j], other.pose @ _back(key.pose))
            if seen is not None:
                pairs[i, j] = seen.motion
    poses, said = [key.pose for key in keys], np.zeros(0)
    for _ in range(_ROUNDS if pairs else 0):
        off = {(i, j): motion @ poses[i] @ _back(poses[j]) for (i, j), motion in pairs.items()}
        said = np.array([_turn(o) for o in off.values()])
        for j in range(1, len(keys)):
            about = keys[j].points
            votes = [_move(o, about) for (_, of), o in off.items() if of == j]
            if votes:
                poses[j] = _rigid(about, np.mean([about, *votes], axis=0)) @ poses[j]
    spread = float(np.sqrt(np.mean(said**2))) if len(said) else 0.0
    return [replace(key, pose=pose) for key, pose in zip(keys, poses, strict=True)], spread


def _key(image: Image, pose: Floats, hull: Image) -> _Key:
    corners = cv2.goodFeaturesToTrack(image, _CORNERS, _CORNER_SHARE, _APART_PX, mask=hull, blockSize=5)
    points = np.zeros((0, 2)) if corners is None else np.array(corners, dtype=float)[:, 0]
    if not len(points):
        return _Key(pose, np.zeros(2), image[:0], points, np.zeros(0, np.intp))
    low = np.maximum(np.floor(points.min(axis=0)).astype(int) - _MARGIN_PX, 0)
    high = np.minimum(np.ceil(points.max(axis=0)).astype(int) + _MARGIN_PX, image.shape[::-1])
    part = np.ascontiguousarray(image[low[1] : high[1], low[0] : high[0]])
    return _Key(pose, low.astype(float), part, points, _groups(points))


def _hold_against(key: _Key, grey: Image, guess: Floats) -> _Seen | None:
    """Find the motion from key to frame: turn the frame back by the guess, and follow what is still off.

    Returns
    -------
    _Seen or None
        ``None`` where fewer than `_FEWEST` points move as one body.
    """
    if len(key.points) < _FEWEST:
        return None
    at = (key.points - key.corner).astype(np.float32)
    seen = None
    for _ in range(3):
        from_part = guess @ np.array([[1.0, 0.0, key.corner[0]], [0.0, 1.0, key.corner[1]], [0.0, 0.0, 1.0]])
        flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
        turned = cv2.warpAffine(
            grey, from_part[:2], key.image.shape[::-1], flags=flags, borderMode=cv2.BORDER_REPLICATE
        )
        there, forth = _follow(key.image, turned, at)
        back, home = _follow(turned, key.image, there)
        found = _move(from_part, there.astype(float))
        height, width = grey.shape
        inside = ((found >= 0) & (found <= [width - 1, height - 1])).all(axis=1)
        followed = forth & home & inside & (np.hypot(*(back - at).T) < _RETURN_PX)
        body = _consensus(key.points[followed], found[followed], _FINE_PX)
        if body is None:
            return None
        motion, among = body
        inlier = np.zeros(len(key.points), bool)
        inlier[np.flatnonzero(followed)[among]] = True
        seen = _Seen(motion, inlier, *_scatter(motion, key.points[inlier], found[inlier], key.group[inlier]))
        if abs(_turn(motion @ _back(guess))) < _AGAIN:
            break
        guess = motion
    return seen


def _follow(here: Image, there: Image, points: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    window = (_WINDOW_PX, _WINDOW_PX)
    found, status, _ = cv2.calcOpticalFlowPyrLK(  # type: ignore[call-overload]
        here, there, points[:, None], None, winSize=window, maxLevel=_LEVELS
    )
    return found[:, 0], status[:, 0] == 1


def _scatter(motion: Floats, start: Floats, end: Floats, group: NDArray[np.intp]) -> tuple[float, float]:
    """Return the variance of a point's place, and how much more than that groups of neighbours scatter in turn."""
    off = end - _move(motion, start)
    variance = max(float((off**2).sum() / (2 * len(off) - 3)), _FLOOR_PX**2)
    arm = end - end.mean(axis=0)
    pull = off[:, 0] * arm[:, 1] - off[:, 1] * arm[:, 0]
    by_group = np.bincount(group, pull)
    return variance, float((by_group**2).sum() / (variance * (arm**2).sum()))


def _about_one_centre(
    poses: Floats, information: Floats, grouped: Floats, status: tuple[str, ...], middle: Floats, spread: float
) -> RigidMotion | str:
    """Fit a centre of rotation that all frames share, and find the turns again about it.

    A body that turns by θ about c moves its middle m by s = (R(θ) − 1)(m − c). What the frames' own places leave over
    from that, beyond their noise, is how far the centre wanders; a place says as much about the turn as that allows.
    """
    ok = np.array([s == OK for s in status])
    if ok.sum() < _FEWEST:
        return "what turns is seen in too few frames"
    turn = np.arctan2(poses[:, 0, 1], poses[:, 0, 0])
    turn[ok] = np.unwrap(turn[ok])
    shift = np.einsum("nij,j->ni", poses[:, :2, :2], middle) + poses[:, :2, 2] - middle
    # a frame that motion blurs scatters more than others, as far as so few groups can tell
    usual = max(1.0, float(np.median(grouped[ok])))
    more = (_TRUST * usual + _GROUPS * grouped[ok]) / (_TRUST + _GROUPS)
    covariance = np.linalg.inv(information[ok]) * np.maximum(more, 1.0)[:, None, None]
    place, arm, arm_covariance, wander = _fit_centre(turn[ok], shift[ok], covariance[:, 1:, 1:])
    covariance[:, 1:, 1:] += wander**2 * np.eye(2)
    weight = np.linalg.inv(covariance)
    free = np.column_stack([turn[ok], shift[ok]])
    about = turn[ok]
    for _ in range(3):
        rotation, slope = _rotations(about), _rotations(about + np.pi / 2)
        model = np.column_stack([about, place + rotation @ arm - arm])
        pull = np.column_stack([np.ones(len(about)), slope @ arm])
        gain = np.einsum("ni,nij->nj", pull, weight)
        about = about + np.einsum("ni,ni->n", gain, free - model) / np.einsum("ni,ni->n", gain, pull)
    median = float(np.median(about))
    turns, sigma = np.full(len(turn), np.nan), np.full(len(turn), np.nan)
    turns[ok] = about - median
    blur = _BLUR_SHARE * np.abs(np.gradient(about))
    reach = float(np.sqrt(np.median(information[ok, 0, 0] / information[ok, 1, 1])))
    sigma[ok] = np.sqrt(1.0 / np.einsum("ni,ni->n", gain, pull) + spread**2 + (_SHARED_PX / reach) ** 2 + blur**2)
    if np.ptp(turns[ok]) < _LEAST_TURN:
        return "nothing rigid is seen to turn"
    pivot = middle + place - arm
    centre = pivot + _rotations(np.array([median]))[0] @ arm
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
    A = np.concatenate([np.broadcast_to(np.eye(2), (len(count), 2, 2)), _rotations(mean_turn) - np.eye(2)], axis=2)
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
    every = shift - (solution[:2] + (_rotations(turn) - np.eye(2)) @ solution[2:])
    excess = np.median((every**2).sum(axis=1)) - np.median(np.trace(noise, axis1=1, axis2=2))
    # the median of the square of a distance in the plane is 2 ln 2 of the variance of either coordinate
    return solution[:2], solution[2:], covariance, float(np.sqrt(max(excess, 0.0) / (2 * np.log(2))))


def _information(pose: Floats, arm: Floats) -> Floats:
    """Return what points say of a pose, (3, 3) for its turn (rad) and the shift of the middle (px), at 1 px² each."""
    slope = arm @ _rotations(np.array([_turn(pose) + np.pi / 2]))[0].T
    total = slope.sum(axis=0)
    return np.block(
        [[np.array([[(slope**2).sum()]]), total[None]], [total[:, None], len(arm) * np.eye(2)]],
    )


def _turning_body(start: Floats, end: Floats) -> NDArray[np.intp] | None:
    """Find the largest set of points that moves as one rigid body and turns; ``None`` where there is none."""
    left = np.arange(len(start))
    for _ in range(_BODIES):
        body = _consensus(start[left], end[left], _COARSE_PX)
        if body is None:
            return None
        motion, among = body
        if abs(_turn(motion)) >= _LEAST_TURN:
            return left[among]
        left = np.delete(left, among)
    return None


def _consensus(start: Floats, end: Floats, tolerance_px: float) -> tuple[Floats, NDArray[np.intp]] | None:
    """Find the rigid motion on which most points agree, by random sampling of two, and refine it on them."""
    n = len(start)
    if n < _FEWEST:
        return None
    first, second = np.random.default_rng(0).integers(0, n, (2, _TRIALS))
    a, b = start[second] - start[first], end[second] - end[first]
    long = np.hypot(*a.T)
    stiff = (long > 4 * tolerance_px) & (np.abs(long - np.hypot(*b.T)) < 2 * tolerance_px)
    if not stiff.any():
        return None
    first, second, a, b = first[stiff], second[stiff], a[stiff], b[stiff]
    turn = np.arctan2(a[:, 0] * -b[:, 1] + a[:, 1] * b[:, 0], (a * b).sum(axis=1))
    rotation = _rotations(turn)
    half = 0.5 * (start[first] + start[second])
    place = 0.5 * (end[first] + end[second]) - np.einsum("tij,tj->ti", rotation, half)
    c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
    off_x = c * start[:, 0] + s * start[:, 1] + place[:, :1] - end[:, 0]
    off_y = c * start[:, 1] - s * start[:, 0] + place[:, 1:] - end[:, 1]
    agree = off_x**2 + off_y**2 < tolerance_px**2
    among = np.flatnonzero(agree[agree.sum(axis=1).argmax()])
    motion = np.eye(3)
    for _ in range(3):
        if len(among) < _FEWEST:
            return None
        motion = _rigid(start[among], end[among])
        off = np.hypot(*(end - _move(motion, start)).T)
        usual = float(np.median(off[among]))
        among = np.flatnonzero(off < min(tolerance_px, _OUTLYING * max(usual, 0.02)))
    return (motion, among) if len(among) >= _FEWEST else None


def _rigid(start: Floats, end: Floats) -> Floats:
    """Fit a turn and a shift by least squares (Umeyama 1991, without scale)."""
    a, b = start.mean(axis=0), end.mean(axis=0)
    p, q = start - a, end - b
    turn = np.arctan2((p[:, 1] * q[:, 0] - p[:, 0] * q[:, 1]).sum(), (p * q).sum())
    rotation = _rotations(np.array([turn]))[0]
    motion = np.eye(3)
    motion[:2, :2], motion[:2, 2] = rotation, b - rotation @ a
    return motion


def _rotations(turn: Floats) -> Floats:
    """Return (n, 2, 2) matrices that turn counter-clockwise as seen, y being down."""
    c, s = np.cos(turn), np.sin(turn)
    return np.moveaxis(np.array([[c, s], [-s, c]]), 2, 0)


def _turn(motion: Floats) -> float:
    return float(np.arctan2(motion[0, 1], motion[0, 0]))


def _back(motion: Floats) -> Floats:
    return np.asarray(np.linalg.inv(motion), dtype=float)


def _move(motion: Floats, points: Floats) -> Floats:
    return points @ motion[:2, :2].T + motion[:2, 2]


def _describe(grey: Image) -> _Features:
    reduction = max(1, -(-grey.shape[1] // _SIFT_WIDTH_PX))
    if reduction > 1:
        grey = cv2.resize(grey, None, fx=1 / reduction, fy=1 / reduction, interpolation=cv2.INTER_AREA)
    sift = cv2.SIFT_create(_FEATURES, contrastThreshold=_FEATURE_CONTRAST)  # type: ignore[attr-defined]
    marks, descriptors = sift.detectAndCompute(grey, None)
    points = np.array([mark.pt for mark in marks]).reshape(-1, 2)
    if descriptors is None:
        return _Features(points, np.zeros((0, 128), np.float32))
    return _Features((points + 0.5) * reduction - 0.5, descriptors / np.linalg.norm(descriptors, axis=1, keepdims=True))


def _match(one: _Features, other: _Features) -> NDArray[np.intp]:
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


def _groups(points: Floats) -> NDArray[np.intp]:
    if len(points) <= 2 * _GROUPS:
        return np.arange(len(points))
    return np.asarray(kmeans2(points, _GROUPS, minit="++", seed=0)[1])
