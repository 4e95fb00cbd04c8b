"""Follow what turns about a hinted pivot, as a layer before a still background.

Where the pivot is known roughly, the thing is found in a frame whatever it did since the frame before
(`anglecam.vision.rigid_body.polar_match`). The layer of one frame is compared with the others, and what is not found
where the rotation carries it is left out: wires, shadows, and things on the desk that shift before a camera in the
hand.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from anglecam.data.series import OK
from anglecam.data.typing import Flags, Floats, Image
from anglecam.video.film import Frame
from anglecam.vision.image.median import still_background
from anglecam.vision.image.reduction import reduced, reduction
from anglecam.vision.image.transforms import apply_motion, inverse_motion, turn_of, turned_about
from anglecam.vision.rigid_body.centre_of_rotation import FramePose, RigidMotion, fit_common_centre
from anglecam.vision.rigid_body.layer import Layer, cut_layer, match_layer
from anglecam.vision.rigid_body.polar_match import PolarReference, learn_polar
from anglecam.vision.rigid_body.rough_centre import Centre, with_pose
from anglecam.vision.status import NO_MARK, UNDECODABLE

_DIFFERS, _LARGEST = 0.2, 0.999
"""Least difference of the thing's pixels from the background, as a share of the largest, which is this quantile."""
_TYPICAL = 0.9
"""Quantile of the differences from the background in the samples, at which the reference is."""
_HINT_PX = 10.0
"""Standard uncertainty of a hinted pivot, px."""
_AWAY_PX = 10.0
"""Distance by which a pixel is displaced where one like it in its place is no chance, px."""
_FEWEST_PIXELS = 60
"""Of a thing."""
_SEEN_SHARE = 0.5
"""Share of the layer that must be seen for a frame to be measured, and of the samples in which it is."""
_PLACE_PX = 0.2
"""Standard uncertainty of a layer's place that varies with its angle, px: light, shade, and its height."""
_DAMPING = 0.8
"""Share of the turn since the frame before that is expected to the next one."""
_LONGEST_PX = 960.0
"""Longer side to which pictures are reduced: the films of telephones show no finer detail."""
_ROUNDS = 2
"""Times that the layer is learnt from the samples and compared with them."""


@dataclass(frozen=True)
class TurningLayer:
    """What is known of the thing before the clip is measured."""

    background: Image
    """(h, w, planes) the still background."""
    layer: Layer
    centre: Centre
    """Of its rotation."""
    polar: PolarReference
    to_small: Floats
    """(3, 3) from the picture to the reduced one, in which all of these are."""


def learn_turning_layer(samples: Sequence[Frame], near_px: Floats) -> TurningLayer | str:
    """Learn what turns about a hinted pivot.

    Parameters
    ----------
    samples : sequence of Frame
        Spread over the clip.
    near_px : ndarray
        (2,) rough place of the pivot, px.

    Returns
    -------
    TurningLayer or str
        The cause in a few words where nothing turns about it.
    """
    whole = [frame.image for frame in samples if frame.image is not None]
    images, to_small = [reduced(image, _LONGEST_PX) for image in whole], reduction(whole[0].shape[:2], _LONGEST_PX)
    near = apply_motion(to_small, near_px)
    background = still_background(images)
    differs = np.stack([_difference(image, background) for image in images])
    clear = differs > _DIFFERS * float(np.quantile(differs, _LARGEST))
    start = int(np.argsort(clear.sum(axis=(1, 2)))[int(_TYPICAL * (len(images) - 1))])
    polar = learn_polar(images[start], background, near)
    turns = [polar.turn_in(image) for image in images]
    known = [(image, turned_about(near, turn)) for image, turn in zip(images, turns, strict=True)]
    centre = Centre(near, np.eye(2) / _HINT_PX**2)
    for _ in range(_ROUNDS):
        covered = clear[start] & _turning(images[start], background, known, centre.place_px)
        if not covered.any() or (layer := cut_layer(images[start], background, covered)).pixels < _FEWEST_PIXELS:
            return "nothing is seen to turn about the hinted pivot"
        centre, known = Centre(near, np.eye(2) / _HINT_PX**2), []
        for image, turn in zip(images, turns, strict=True):
            match = match_layer(layer, image, background, turned_about(centre.place_px, turn), centre)
            if match is not None and match.seen >= _SEEN_SHARE:
                centre = with_pose(centre, match.free_pose, match.information, match.group_ratio, layer.middle)
                known.append((image, match.pose))
        if len(known) < _SEEN_SHARE * len(images):
            return "what moves about the hinted pivot is not rigid"
    return TurningLayer(background, layer, centre, polar, to_small)


def follow_turning_layer(frames: Iterator[Frame], turning: TurningLayer) -> RigidMotion | str:
    """Measure the rotation of a layer in every frame.

    Parameters
    ----------
    frames : iterator of Frame
        The whole clip; it is read once, one frame at a time.
    turning : TurningLayer
        From `learn_turning_layer`.

    Returns
    -------
    RigidMotion or str
        The cause in a few words where nothing rotates.
    """
    poses: list[FramePose] = []
    recent: list[float] = []
    for frame in frames:
        if frame.image is None:
            poses.append(FramePose(UNDECODABLE))
            continue
        image = reduced(frame.image, _LONGEST_PX)
        near = recent[-1] + _DAMPING * (recent[-1] - recent[-2]) if len(recent) > 1 else None
        guess = turned_about(turning.centre.place_px, turning.polar.turn_in(image, near))
        match = match_layer(turning.layer, image, turning.background, guess, turning.centre)
        if match is None or match.seen < _SEEN_SHARE:
            poses.append(FramePose(NO_MARK))
            recent = [recent[-1], near] if near is not None else []
        else:
            poses.append(FramePose(OK, match.free_pose, match.information, match.group_ratio))
            turn = turn_of(match.pose)
            turn = turn if not recent else recent[-1] + (turn - recent[-1] + np.pi) % (2.0 * np.pi) - np.pi
            recent = [*recent[-1:], turn]
    motion = fit_common_centre(poses, turning.layer.middle, _PLACE_PX / turning.layer.size_px, _PLACE_PX)
    return motion if isinstance(motion, str) else _enlarged(motion, turning.to_small)


def _enlarged(motion: RigidMotion, to_small: Floats) -> RigidMotion:
    """Return a motion in the picture, measured in the reduced one."""
    scale, back = float(to_small[0, 0]), inverse_motion(to_small)
    return replace(
        motion,
        pivot_sensitivity=motion.pivot_sensitivity * scale,
        pivot_px=apply_motion(back, motion.pivot_px),
        pivot_covariance_px2=motion.pivot_covariance_px2 / scale**2,
        pivot_scatter_px=motion.pivot_scatter_px / scale,
        centre_px=apply_motion(back, motion.centre_px),
        extent_px=motion.extent_px / scale,
    )


def _difference(image: Image, background: Image) -> Image:
    """Return (h, w) distance of a picture's colours from the background's, grey levels."""
    return np.asarray(np.sqrt(((image.astype(np.float32) - background) ** 2).sum(axis=2)))


def _turning(reference: Image, background: Image, known: Sequence[tuple[Image, Floats]], pivot_px: Floats) -> Flags:
    """Return (h, w) which of the reference's pixels are seen where they have turned to, and not the background there.

    ``known`` are pictures and the poses in them.
    """
    own, size = reference.astype(np.float32), reference.shape[1::-1]
    y, x = np.mgrid[: size[1], : size[0]]
    arm = np.hypot(x - pivot_px[0], y - pivot_px[1])
    left, like = np.zeros(arm.shape, np.float32), np.zeros(arm.shape, np.float32)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    for image, pose in known:
        seen, behind = (
            cv2.warpAffine(picture.astype(np.float32), pose[:2], size, flags=flags).reshape(own.shape)
            for picture in (image, background)
        )
        away = 2.0 * abs(np.sin(turn_of(pose) / 2.0)) * arm > _AWAY_PX
        left += away
        like += away & (((seen - own) ** 2).sum(axis=2) < ((seen - behind) ** 2).sum(axis=2))
    return np.asarray((like > _SEEN_SHARE * left) & (left > 0.0))
