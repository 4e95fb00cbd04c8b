"""The coarse pass over a clip without a mark: follow a body that turns rigidly.

A body with texture, such as a face in profile, is followed by its features. Where too few features rotate, the outline
of what moves before a still background is followed instead, such as that of a grey stick. Where the pivot is hinted,
what turns about it is followed as a layer before the background, such as a servo's horn.
"""

from __future__ import annotations

import numpy as np

from anglecam.camera.lens import lens_from_rig
from anglecam.data.series import OK
from anglecam.io.rig import Rig
from anglecam.measurement.detections import Detections, frame_of_mark, frames_to_keep
from anglecam.measurement.pivot import find_pivot
from anglecam.progress import Progress, Stage, unseen, watched
from anglecam.video.film import Film, Sample
from anglecam.vision.image.noise import pixel_noise
from anglecam.vision.pivot.circle import Circle
from anglecam.vision.rigid_body.centre_of_rotation import RigidMotion
from anglecam.vision.rigid_body.follow import follow_rigid_body
from anglecam.vision.rigid_body.follow_layer import follow_turning_layer, learn_turning_layer
from anglecam.vision.rigid_body.follow_outline import follow_outline, learn_outline

_NAMES = {
    "body's keyframes": "rigid body",
    "outline": "outline of what moves",
    "layer": "thing that turns about the hinted pivot",
}
"""Of what is followed, in a message."""


def detect_rigid_body(film: Film, rig: Rig, progress: Progress = unseen) -> Detections | str:
    """Follow the features of a rigid body in place of a mark.

    Parameters
    ----------
    film : Film
        The clip.
    rig : Rig
        Declares pivot and camera.
    progress : Progress
        Called with each stage, and after each frame.

    Returns
    -------
    Detections or str
        The cause, in a few words, where the body cannot be followed.

    Raises
    ------
    InputError
        As `detect_mark`, for a file that cannot be read.
    """
    sample = film.sample(frames_to_keep(film))
    images, pointed = [f.image for f in sample.frames if f.image is not None], rig.pointed_mark
    frames = watched(film.frames(), progress, "following a body without a mark", film.count)
    if pointed is None:
        body = follow_rigid_body(frames, images, pixel_noise(images))
    else:
        first = frame_of_mark(film, pointed).image
        assert first is not None
        body = follow_rigid_body(frames, [first, *images], pixel_noise(images), np.array(pointed.as_box))
    return body if isinstance(body, str) else _detections(film, rig, sample, body, "body's keyframes", progress)


def detect_outline(film: Film, rig: Rig, progress: Progress = unseen) -> Detections | str:
    """Follow the outline of what moves before a still background; arguments and result as of `detect_rigid_body`."""
    sample = film.sample(frames_to_keep(film))
    learnt = learn_outline(
        sample.frames, watched(film.frames(), progress, "learning the outline of what moves", film.count)
    )
    if isinstance(learnt, str):
        return learnt
    outline = follow_outline(watched(film.frames(), progress, "following the outline", film.count), learnt)
    return outline if isinstance(outline, str) else _detections(film, rig, sample, outline, "outline", progress)


def detect_layer(film: Film, rig: Rig, progress: Progress = unseen) -> Detections | str:
    """Follow what turns about a hinted pivot; arguments and result as of `detect_rigid_body`."""
    near = rig.pivot.expected
    if near is None or not (0.0 <= near[0] < film.size[0] and 0.0 <= near[1] < film.size[1]):
        return "no pivot in the picture is hinted"
    sample = film.sample(frames_to_keep(film))
    progress(Stage("learning what turns about the hint"))
    learnt = learn_turning_layer(sample.frames, np.array(near))
    if isinstance(learnt, str):
        return learnt
    frames = watched(film.frames(), progress, "following what turns about the hint", film.count)
    layer = follow_turning_layer(frames, learnt)
    return layer if isinstance(layer, str) else _detections(film, rig, sample, layer, "layer", progress)


def _detections(
    film: Film, rig: Rig, sample: Sample, body: RigidMotion, by: str, progress: Progress
) -> Detections | str:
    """Return the detections of a body that was followed, or the cause where it has no pivot."""
    images = [f.image for f in sample.frames if f.image is not None]
    lens = lens_from_rig(rig, film.size, film.path)
    stamps, repeated, before = [], [], None
    for frame in watched(film.frames(), progress, "looking for repeated frames", film.count):
        stamps.append(frame.time)
        same = frame.image is not None and before is not None and np.array_equal(frame.image, before)
        repeated.append(same)
        before = frame.image
    lever = float(np.hypot(*(body.centre_px - body.pivot_px)))
    turned = Circle(
        body.pivot_px,
        lever,
        body.pivot_scatter_px,
        np.pad(body.pivot_covariance_px2, (0, 1)) + np.diag([0.0, 0.0, float(np.trace(body.pivot_covariance_px2))]),
        np.ones(len(stamps), bool),
    )
    marker, pivot, disagreement = find_pivot(images, rig, turned, lens)
    if pivot is None or OK not in body.status:
        return "it hardly rotates"
    return Detections(
        time=np.array(stamps),
        status=body.status,
        regions=(None,) * len(stamps),
        smeared=np.zeros(len(stamps), bool),
        pivot=pivot,
        marker=marker,
        circle=None,
        moves=True,
        lens=lens,
        camera_moves=None,
        body=body,
        by=by,
        clear=True,
        noise=pixel_noise(images),
        repeated=np.array(repeated),
        colour_rgb=None,
        size=film.size,
        truncated=film.why_truncated(sample),
        notes=(f"the {_NAMES[by]} is measured, without a mark", *([disagreement] if disagreement else [])),
    )
