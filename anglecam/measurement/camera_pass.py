"""How the camera moves in a clip, and the clip as a camera at rest would have filmed it.

Shift and roll of a shaking camera are corrected for points, which leaves the frames as they are
(`anglecam.vision.stabilise.background_motion`). A camera in the hand also comes nearer and tilts. Its frames are
transformed to the place of the first one, from which the clip is then measured.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace

import av
import cv2
import numpy as np

from anglecam.data.typing import Floats, Image
from anglecam.errors import InputError
from anglecam.io.rig import Rig
from anglecam.measurement.detections import frames_to_keep
from anglecam.progress import Progress, Stage, unseen, watched
from anglecam.video.decode import Row
from anglecam.video.film import Film, Sample
from anglecam.video.picture import Picture
from anglecam.vision.stabilise.dominant_shift import (
    CameraMotion,
    ShiftingScenery,
    learn_shift,
    shift_of,
)
from anglecam.vision.stabilise.learn import learn_background
from anglecam.vision.stabilise.plane import follow_plane, moves_in_the_hand, seen_from_first, stands_still
from anglecam.vision.stabilise.scenery_edges import is_better, scenery_edges
from anglecam.vision.stabilise.zoom import Zoom, camera_zoom

_LEAST_KNOWN = 0.5
"""Least share of the sampled frames in which the motion of a camera that moves is known. In fewer, what was taken for
scenery is not what the camera stands before."""
_BLANK = 3.0
"""Standard deviation, grey levels, of a picture that shows nothing, such as the black beginning of a film."""
_LEAST_FOLLOWED = 0.8
"""Least share of all frames in which the plane is followed."""


@dataclass(frozen=True)
class HeldCamera:
    """A clip, and how its camera moves."""

    film: Film
    """The clip; where the camera does more than shift and roll, as a camera at rest would have filmed it."""
    steady: CameraMotion | None = None
    """The scenery by which shift and roll are measured; ``None`` where the film is that of a camera at rest."""
    unknown: str | None = None
    """Message where the camera moves in a way that cannot be measured, so that a mark's path shows no pivot."""


@dataclass(frozen=True, eq=False)
class FilmAtRest(Film):
    """A film whose frames are transformed to the camera's first place."""

    moves: tuple[Floats | None, ...] = ()
    """(3, 3) homography from the first frame into each; ``None`` where it is unknown."""
    first: Image | None = None
    """The first frame, shown where a transformed frame ends."""
    first_grey: Image | None = None
    """The same, (height, width, 1)."""

    def thinned(self) -> None:
        """Return ``None``: such a film is not measured from evenly spaced frames."""

    def sample(self, most: int) -> Sample:
        """Return evenly spaced transformed frames."""
        sample = super().sample(most)
        return replace(sample, frames=tuple(frame for frame in sample.frames if frame.image is not None))

    def in_picture(self, places_px: Floats) -> Floats:
        """Return the places in the filmed frames of (frames, 2) places in the first one, px."""
        return np.array(
            [
                np.full(2, np.nan) if move is None else cv2.perspectiveTransform(place[None, None], move)[0, 0]
                for place, move in zip(places_px, self.moves, strict=True)
            ]
        )

    def picture(self, index: int, row: Row) -> Picture:
        """Return a row as it would be seen from the camera's first place."""
        move = self.moves[index]
        time, stored = row
        assert self.first is not None
        assert self.first_grey is not None
        seen = None if move is None else stored
        return _PictureAtRest(index, time, seen, self.display, self.bottom_first, move, self.first, self.first_grey)


@dataclass(frozen=True, eq=False)
class _PictureAtRest(Picture):
    """A picture that is transformed to the camera's first place."""

    move: Floats | None
    first: Image
    first_grey: Image

    def _is_as_stored(self, stored: av.VideoFrame) -> bool:
        return False

    def _shown(self, convert: Callable[[av.VideoFrame], Image]) -> Image | None:
        image = super()._shown(convert)
        if image is None or self.move is None:
            return None
        return seen_from_first(image, self.move, self.first if image.shape == self.first.shape else self.first_grey)


def hold_camera(film: Film, progress: Progress = unseen) -> HeldCamera:
    """Find out how the camera moves.

    Parameters
    ----------
    film : Film
        The clip.
    progress : Progress
        Called with each stage.

    Returns
    -------
    HeldCamera
        With the clip as it is to be measured.

    Raises
    ------
    InputError
        Where the file cannot be read.
    """
    progress(Stage("looking whether the camera moves"))
    shown = [f.image for f in film.sample(frames_to_keep(film)).frames if f.image is not None]
    images = [image for image in shown if image.std() > _BLANK] or shown
    steady: CameraMotion | None = learn_background(images)
    known = images if steady is None else [image for image in images if steady.at(image).known]
    zoom, why = camera_zoom(known), None
    if zoom is None and steady is not None and len(known) >= _LEAST_KNOWN * len(images):
        return HeldCamera(film, steady)
    seen = images if zoom is None else known
    edges = scenery_edges(seen)
    shifting = None if edges is None else learn_shift(edges, seen)
    if shifting is not None and not _shows_more(shifting, seen, zoom, film.size):
        return HeldCamera(film, shifting)
    if zoom is not None and (edges is None or is_better(edges.gain(seen, zoom.moves, [np.eye(3)] * len(seen)))):
        why = f"the camera zooms or comes nearer, by {100.0 * (zoom.factor - 1.0):.1f} %"
    elif len(known) < _LEAST_KNOWN * len(images):
        why = f"the camera moves, and how can be seen in {len(known)} of {len(images)} sampled frames only"
    elif len(images) < 2 or (shifting is None and stands_still(images)):
        return HeldCamera(film)
    frames = watched(film.frames(brightness=True), progress, "following the camera", film.count)
    moves = tuple(follow_plane(frame.image for frame in frames))
    followed = sum(move is not None for move in moves) >= _LEAST_FOLLOWED * len(moves)
    if why is None and not (followed and moves_in_the_hand(moves, film.size)):
        return HeldCamera(film)  # nothing says that the camera moves: what is seen to move may be the mechanism
    if not followed:
        how = "choose frames in which it does not: frames: {from: k0, to: k1} in rig.yaml"
        return HeldCamera(film, steady, f"{why}; {how}")
    own = {field.name: getattr(film, field.name) for field in fields(film) if field.init}
    grey = images[0].mean(axis=2, keepdims=True).astype(np.uint8)
    return HeldCamera(FilmAtRest(**own, moves=moves, first=images[0], first_grey=grey))


def _shows_more(shifting: ShiftingScenery, images: Sequence[Image], zoom: Zoom | None, size: tuple[int, int]) -> bool:
    """Return whether a camera that also rolls, zooms or comes nearer predicts the pictures better."""
    shifts = [shift_of(one) for one in shifting.shifts_px]
    if zoom is not None and is_better(shifting.edges.gain(images, zoom.moves, shifts)):
        return True
    moves = follow_plane(images)
    if sum(move is not None for move in moves) < _LEAST_FOLLOWED * len(moves) or not moves_in_the_hand(moves, size):
        return False
    return is_better(shifting.edges.gain(images, moves, shifts))


def as_seen_at_rest(rig: Rig, film: Film) -> Rig:
    """Return a rig whose mark is declared in a frame of the film, with its place in the first frame of a film at rest.

    Raises
    ------
    InputError
        Where the camera's place in that frame is unknown.
    """
    mark = rig.pointed_mark
    if mark is None or not isinstance(film, FilmAtRest) or not 0 <= mark.frame - film.first_frame < len(film.moves):
        return rig
    move = film.moves[mark.frame - film.first_frame]
    if move is None:
        where = f"{film.path}: the camera's motion is unknown in frame {mark.frame}"
        raise InputError(f"{where}; declare the mark in another frame")
    left, top, right, bottom = mark.as_box or (0.0, 0.0, 0.0, 0.0)
    corners = np.array([[[left, top]], [[right, top]], [[right, bottom]], [[left, bottom]]])
    corners = cv2.perspectiveTransform(corners, np.linalg.inv(move))[:, 0]
    low, high = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    placed = {"at": tuple(low)} if mark.at is not None else {"box": (*low, *high)}
    return rig.model_copy(update={"mouth": mark.model_copy(update=placed)})
