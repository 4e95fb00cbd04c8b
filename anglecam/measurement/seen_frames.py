"""The pictures of a clip in which a body is sought: a few that are spread over the motion, then all of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from anglecam.data.typing import Floats, Image
from anglecam.engine.body import Turn
from anglecam.engine.frame_choice import spread_over_motion, thumbnail
from anglecam.engine.kept_picture import in_bytes
from anglecam.engine.sample import FRAMES, Sample, Stills
from anglecam.engine.target import Picture as Grey
from anglecam.measurement.camera_pass import HeldCamera
from anglecam.progress import Progress, watched
from anglecam.video.film import Film
from anglecam.video.picture import Picture
from anglecam.vision.stabilise.background_motion import UNKNOWN_MOVE, CameraMove
from anglecam.vision.stabilise.dominant_shift import CameraMotion

Find = Callable[[int, Grey], list[Turn]]
_LOOKED_AT = 4
"""Times the pictures of a sample, from which it is chosen."""
_KEPT_BYTES = 200_000_000
"""Memory for the reduced pictures of a film, which may have to be looked through again."""


def moving_stills(film: Film) -> list[Picture]:
    """Return pictures of a film, spread over those in which something moves."""
    shown = [
        (picture, thumbnail(image))
        for picture in film.stills(_LOOKED_AT * FRAMES)
        if (image := picture.brightness) is not None
    ]
    if not shown:
        return []
    return [shown[k][0] for k in spread_over_motion([small for _, small in shown], FRAMES)]


def picture_of(film: Film, index: int) -> Picture:
    """Return the picture of a frame, which the film has."""
    return next(picture for picture, _ in film.pictures(lambda _: None) if picture.index == index)


def _image(picture: Picture, camera: HeldCamera, tint: Floats | None) -> Image | None:
    """Return a picture as the body is sought in it: its colours are needed where the scenery is followed, too."""
    return picture.brightness if camera.steady is None and tint is None else picture.colours


def stills_of(pictures: list[Picture], camera: HeldCamera, tint: Floats | None = None) -> Stills:
    """Return pictures as a mixture of colours or their brightness shows them, if the camera's motion is known."""
    images, maps, numbers = list[Image](), list[Floats | None](), list[int]()
    for picture in pictures:
        image = _image(picture, camera, tint)
        move = None if image is None else _move(image, picture, camera.steady)
        if image is not None and (move is None or move.known):
            images.append(image)
            maps.append(None if move is None else _affine(move))
            numbers.append(picture.index)
    return Stills(images, maps, np.array(numbers), tint)


def _move(image: Image, picture: Picture, steady: CameraMotion | None) -> CameraMove | None:
    return None if steady is None else steady.at(image, picture.predicted)


def _affine(move: CameraMove) -> Floats:
    """Return the (2, 3) map from the picture of a camera at rest to a frame."""
    origin, x, y = (move.to_frame(np.array(point, float)) for point in ((0, 0), (1, 0), (0, 1)))
    return np.column_stack([x - origin, y - origin, origin])


@dataclass(frozen=True)
class Seen:
    """What one reading of all frames found."""

    time: Floats
    found: list[list[Turn]]
    """Where the body may be in each."""
    decoded: list[bool]
    repeated: list[bool]
    moves: list[CameraMove]
    """Of the camera; empty where it stands still."""
    pictures: list[Image | None]
    """As the body was sought in them, by `in_bytes`; empty where they take too much memory."""


def follow(camera: HeldCamera, sample: Sample, find: Find, progress: Progress) -> Seen:
    """Read all frames of a clip, and find where a body may be in each.

    Parameters
    ----------
    camera : HeldCamera
        The clip.
    sample : Sample
        As whose pictures the frames are seen.
    find : callable
        Returns the turns at which the body may be in a frame, from its number and the picture.
    progress : Progress
        Called with the stage, and after each frame.

    Returns
    -------
    Seen
        Of the n frames.
    """
    film = camera.film
    time, decoded, repeated = list[float](), list[bool](), list[bool]()
    moves, found, kept = list[CameraMove](), list[list[Turn]](), list[Image | None]()
    keep = film.count * sample.median.size < _KEPT_BYTES
    before: Image | None = None
    shown = film.pictures(lambda picture: _image(picture, camera, sample.tint))
    for picture, image in watched(shown, progress, "following what turns", film.count):
        time.append(picture.time)
        decoded.append(image is not None)
        repeated.append(image is not None and before is not None and np.array_equal(image, before))
        before = image
        move = UNKNOWN_MOVE if image is None and camera.steady else None
        if image is not None:
            move = _move(image, picture, camera.steady)
        if move is not None:
            moves.append(move)
        unknown = image is None or (move is not None and not move.known)
        affine = None if move is None or unknown else _affine(move)
        small = None if unknown or image is None else sample.seen(image, affine)
        found.append([] if small is None else find(picture.index, small))
        if keep:
            kept.append(None if small is None else in_bytes(small))
    return Seen(np.array(time), found, decoded, repeated, moves, kept)
