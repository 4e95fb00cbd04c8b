"""Follow a rigid body without a mark: whatever moves as one rigid body, and rotates, is the body.

A few frames, spread over the clip, show what rotates (`anglecam.vision.rigid_body.feature_matching`). Frames at
different angles become keyframes. Every frame of the clip is rotated back onto the nearest keyframe, and the remaining
displacement is tracked (`anglecam.vision.rigid_body.keyframes`). Each frame is compared with a keyframe and not with
the frame before it, so errors do not accumulate over the clip.
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
from anglecam.vision.rigid_body.keyframes import Keyframe, choose_keyframes, match_keyframe, repetition
from anglecam.vision.status import NO_MARK, OCCLUDED, UNDECODABLE

_MAX_SAMPLES = 16
"""Samples from which the body is learnt, at most: they are compared in pairs."""
_NEAR_POINT = 0.05
"""Of the picture's width: features as near as this to a point that is declared belong to the body."""
_MIN_SEEN_SHARE = 0.3
"""Share of a keyframe's points that must move as one body for a frame to be measured."""
_SMALL_STEP = 0.25
"""Largest step between measured frames of a body that repeats itself, as a share of the repetition. From a half on the
step may be the other way round; where the holes of a gear repeat themselves otherwise than its teeth, the two
together are taken for others at less."""


def follow_rigid_body(
    frames: Iterator[Frame], samples: Sequence[Image], noise: float, pointed_px: Floats | None = None
) -> RigidMotion | str:
    """Measure the body's rotation in every frame; nothing is assumed but that the body is rigid and rotates.

    Parameters
    ----------
    frames : iterator of Frame
        The whole clip; it is read once, one frame at a time.
    samples : sequence of ndarray
        Some of its frames, spread over the clip, (height, width, 3).
    noise : float
        Standard deviation of the pixels, grey levels.
    pointed_px : ndarray, optional
        (4,) box in the first sample in which the body is: left, top, right, bottom, px; a point is a box without
        extent.

    Returns
    -------
    RigidMotion or str
        The cause in a few words where nothing in the clip rotates.
    """
    learnt = _learn([cv2.cvtColor(s, cv2.COLOR_BGR2GRAY) for s in samples], noise, pointed_px)
    if isinstance(learnt, str):
        return learnt
    body, keyframes, spread = learnt
    poses: list[FramePose] = []
    recent: list[tuple[float, Floats]] = []
    middle = np.concatenate([apply_motion(inverse_motion(k.pose), k.points) for k in keyframes]).mean(axis=0)
    for frame in frames:
        match, keyframe, partly = None, keyframes[0], False
        if frame.image is not None:
            grey = cv2.cvtColor(frame.image, cv2.COLOR_BGR2GRAY)
            for guess in _guesses(recent, frame.time, body, grey):
                keyframe = min(keyframes, key=lambda k: abs(turn_of(guess @ inverse_motion(k.pose))))
                match = match_keyframe(keyframe, grey, guess @ inverse_motion(keyframe.pose))
                if match is not None and match.inlier.sum() >= _MIN_SEEN_SHARE * len(keyframe.points):
                    break
                partly = partly or match is not None
                match = None
        if match is None:
            recent = []
            poses.append(FramePose(UNDECODABLE if frame.image is None else OCCLUDED if partly else NO_MARK))
            continue
        pose = match.motion @ keyframe.pose
        recent = [*recent[-1:], (frame.time, pose)]
        rigid = apply_motion(inverse_motion(keyframe.pose), keyframe.points[match.inlier])
        information = pose_information(pose, rigid - middle) / match.variance
        poses.append(FramePose(OK, pose, information, match.group_ratio))
    motion = fit_common_centre(poses, middle, spread)
    if isinstance(motion, str):
        return motion
    fullest = max(keyframes, key=lambda k: len(k.points))
    repeats = repetition(fullest, motion.pivot_px, _MIN_SEEN_SHARE)
    steps = np.abs(np.diff(motion.turn[np.isfinite(motion.turn)]))
    if repeats is None or steps.max(initial=0.0) < _SMALL_STEP * repeats:
        return motion
    return f"the rotating body looks alike after {np.degrees(repeats):.0f}°, and turns too far between two frames"


def _guesses(recent: list[tuple[float, Floats]], time: float, body: Features, grey: Image) -> Iterator[Floats]:
    """Yield initial poses: the motion continues, it pauses, the body is found anew."""
    if len(recent) == 2:
        (t0, first), (t1, last) = recent
        step = last @ inverse_motion(first)
        yield np.linalg.matrix_power(step, max(1, round((time - t1) / (t1 - t0)))) @ last
    if recent:
        yield recent[-1][1]
    found = find_body_pose(body, find_features(grey))
    if found is not None:
        yield found


def _learn(
    samples: Sequence[Image], noise: float, pointed_px: Floats | None
) -> tuple[Features, list[Keyframe], float] | str:
    """Find the features of the body that rotates, and keyframes; or return the cause where there are none."""
    images = _unlike(samples, noise)
    images = [images[i] for i in np.unique(np.linspace(0, len(images) - 1, _MAX_SAMPLES).round().astype(int))]
    if len(images) < 2:
        return "nothing moves"
    features = [find_features(image) for image in images]
    body = _most_turning(features) if pointed_px is None else _in_box(features[0], pointed_px, images[0].shape[1])
    if len(body.points) < MIN_POINTS:
        return (
            "nothing rigid rotates" if pointed_px is None else "too little can be recognised where the mark is declared"
        )
    poses: dict[int, Floats] = {}
    for i, picture in enumerate(features):
        pose = find_body_pose(body, picture)
        if pose is not None:
            poses[i] = pose
    if not poses or np.ptp([turn_of(pose) for pose in poses.values()]) < MIN_TURN:
        return "nothing rigid rotates"
    keyframes, spread = choose_keyframes(images, poses, body.points)
    return (body, keyframes, spread) if keyframes else "too little of the rotating body can be tracked"


def _in_box(features: Features, box_px: Floats, width: int) -> Features:
    """Return the features inside a box, or near it where it is small."""
    room = max(0.0, _NEAR_POINT * width - float(np.hypot(*(box_px[2:] - box_px[:2]))))
    inside = ((features.points >= box_px[:2] - room) & (features.points <= box_px[2:] + room)).all(axis=1)
    return Features(features.points[inside], features.descriptors[inside])


def _most_turning(features: Sequence[Features]) -> Features:
    """Return the features of the body that rotates, in the picture that shows most of them."""
    turning = [np.zeros(len(f.points)) for f in features]
    matched = [np.zeros(len(f.points)) for f in features]
    for i, j in combinations(range(len(features)), 2):
        found = find_turning_body(features[i], features[j])
        if found is not None:
            pairs, inlier = found
            matched[i][pairs[:, 0]] += 1
            matched[j][pairs[:, 1]] += 1
            turning[i][pairs[inlier, 0]] += 1
            turning[j][pairs[inlier, 1]] += 1
    reference = int(np.argmax([t.sum() for t in turning]))
    of_body = turning[reference] > 0.5 * matched[reference]
    return Features(features[reference].points[of_body], features[reference].descriptors[of_body])


def _unlike(samples: Sequence[Image], noise: float) -> list[Image]:
    """Leave out samples that resemble an earlier one: they would cost time and add no information."""
    kept: list[Image] = []
    small: list[Floats] = []
    for sample in samples:
        reduced = cv2.resize(sample, None, fx=1 / 8, fy=1 / 8, interpolation=cv2.INTER_AREA).astype(float)
        if all(np.abs(reduced - other).max() > 3.0 + noise for other in small):
            kept.append(sample)
            small.append(reduced)
    return kept
