"""The turn of a rigid head with no mark on it: what moves as one body, and turns, is the head.

A few frames, spread over the clip, teach what turns (`anglecam.vision.rigid_body.feature_matching`). Those at different turns are kept as
keys. Every frame of the clip is turned back onto the nearest key and what is left is followed
(`anglecam.vision.rigid_body.keyframes`). Each frame is held against a key and not against the frame before it, so errors do not add up
however long the clip.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import cv2
import numpy as np

from anglecam.data.series import OK
from anglecam.data.typing import Floats, Image
from anglecam.video.film import Frame
from anglecam.vision.image.transforms import apply_motion, inverse_motion, turn_of
from anglecam.vision.rigid_body.centre_of_rotation import FramePose, RigidMotion, fit_common_centre, pose_information
from anglecam.vision.rigid_body.feature_matching import (
    MIN_POINTS,
    MIN_TURN,
    Features,
    find_body_pose,
    find_features,
    find_turning_body,
)
from anglecam.vision.rigid_body.keyframes import Keyframe, choose_keyframes, match_keyframe
from anglecam.vision.status import NO_MARK, OCCLUDED, UNDECODABLE

_LEARNT = 16
"""Samples from which the head is learnt, at most: they are compared in pairs."""
_AGREE_SHARE = 0.3
"""Of a key's points that must be seen, as one body, for a frame to be measured."""


def follow_rigid_body(frames: Iterator[Frame], samples: Sequence[Image], noise: float) -> RigidMotion | str:
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
    placed: list[FramePose] = []
    before: list[tuple[float, Floats]] = []
    middle = np.concatenate([apply_motion(inverse_motion(k.pose), k.points) for k in keys]).mean(axis=0)
    for frame in frames:
        seen, key, partly = None, keys[0], False
        if frame.image is not None:
            grey = cv2.cvtColor(frame.image, cv2.COLOR_BGR2GRAY)
            for guess in _guesses(before, frame.time, head, grey):
                key = min(keys, key=lambda k: abs(turn_of(guess @ inverse_motion(k.pose))))
                seen = match_keyframe(key, grey, guess @ inverse_motion(key.pose))
                if seen is not None and seen.inlier.sum() >= _AGREE_SHARE * len(key.points):
                    break
                partly = partly or seen is not None
                seen = None
        if seen is None:
            before = []
            placed.append(FramePose(UNDECODABLE if frame.image is None else OCCLUDED if partly else NO_MARK))
            continue
        pose = seen.motion @ key.pose
        before = [*before[-1:], (frame.time, pose)]
        rigid = apply_motion(inverse_motion(key.pose), key.points[seen.inlier])
        placed.append(FramePose(OK, pose, pose_information(pose, rigid - middle) / seen.variance, seen.grouped))
    return fit_common_centre(placed, middle, spread)


def _guesses(before: list[tuple[float, Floats]], time: float, head: Features, grey: Image) -> Iterator[Floats]:
    """Yield poses to start from: the motion goes on, it pauses, the head is found anew."""
    if len(before) == 2:
        (t0, first), (t1, last) = before
        step = last @ inverse_motion(first)
        yield np.linalg.matrix_power(step, max(1, round((time - t1) / (t1 - t0)))) @ last
    if before:
        yield before[-1][1]
    found = find_body_pose(head, find_features(grey))
    if found is not None:
        yield found


def _learn(samples: Sequence[Image], noise: float) -> tuple[Features, list[Keyframe], float] | str:
    """Find what turns, and frames to hold the others against."""
    images = _unlike(samples, noise)
    images = [images[i] for i in np.unique(np.linspace(0, len(images) - 1, _LEARNT).round().astype(int))]
    if len(images) < 2:
        return "nothing moves"
    features = [find_features(image) for image in images]
    turning = [np.zeros(len(f.points)) for f in features]
    matched = [np.zeros(len(f.points)) for f in features]
    for i, j in combinations(range(len(images)), 2):
        found = find_turning_body(features[i], features[j])
        if found is not None:
            pairs, inlier = found
            matched[i][pairs[:, 0]] += 1
            matched[j][pairs[:, 1]] += 1
            turning[i][pairs[inlier, 0]] += 1
            turning[j][pairs[inlier, 1]] += 1
    reference = int(np.argmax([t.sum() for t in turning]))
    of_head = turning[reference] > 0.5 * matched[reference]
    if of_head.sum() < MIN_POINTS:
        return "nothing rigid is seen to turn"
    head = Features(features[reference].points[of_head], features[reference].descriptors[of_head])
    poses: dict[int, Floats] = {}
    for i, there in enumerate(features):
        pose = find_body_pose(head, there)
        if pose is not None:
            poses[i] = pose
    if np.ptp([turn_of(pose) for pose in poses.values()]) < MIN_TURN:
        return "nothing rigid is seen to turn"
    keys, spread = choose_keyframes(images, poses, head.points)
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
