"""One reading of a film: the regions of the mark's colour in every frame, and what needs the same pictures.

A camera that shakes is followed on the background. Where the body was learnt beforehand from evenly spaced frames
(`anglecam.measurement.body_ahead`), its rotation is found in the same reading.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from anglecam.data.typing import Flags, Floats
from anglecam.measurement.body_ahead import BodyAhead, TurnsAhead, registered_planes, turn_ahead
from anglecam.threads import one_opencv_thread
from anglecam.video.film import Film
from anglecam.video.picture import Picture
from anglecam.vision.mark.found_mark import FoundMark
from anglecam.vision.mark.mark_search import MarkSearch
from anglecam.vision.mark.segment import Region
from anglecam.vision.registration.turn import TurnEstimate
from anglecam.vision.stabilise.background_motion import UNKNOWN_MOVE, BackgroundMotion, CameraMove


@dataclass(frozen=True)
class Reading:
    """What one reading of a film finds; sequences have an entry a frame."""

    time: Floats
    """Time stamps, s."""
    regions: tuple[list[Region], ...]
    """Regions of the mark's colour, in the picture."""
    decoded: Flags
    """Frames with a picture."""
    repeated: Flags
    """Frames that equal the previous frame bit for bit."""
    moves: tuple[CameraMove, ...] | None
    """Motion of the camera; ``None`` where it stands still."""
    turns: TurnsAhead | None
    """Rotation of the body that was learnt beforehand."""


def read_frames(
    film: Film,
    found: FoundMark,
    count: int,
    steady: BackgroundMotion | None = None,
    body: BodyAhead | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Reading:
    """Read a film once.

    Parameters
    ----------
    film : Film
        The clip.
    found : FoundMark
        The mark's colour and size, from a sample of frames.
    count : int
        Number of frames, for ``progress``.
    steady : BackgroundMotion, optional
        The scenery, where the camera shakes.
    body : BodyAhead, optional
        The body, where it was learnt beforehand.
    progress : callable, optional
        Called with (frames done, frames in all) after each frame.

    Returns
    -------
    Reading
        Of all frames.
    """
    time: list[float] = []
    regions: list[list[Region]] = []
    decoded: list[bool] = []
    repeated: list[bool] = []
    moves: list[CameraMove] = []
    begun: list[float] = []
    turns: list[TurnEstimate] = []
    before: Picture | None = None
    with one_opencv_thread():
        for picture, of_mark in film.pictures(_search(film, found, steady, body)):
            time.append(picture.time)
            decoded.append(picture.stored is not None)
            regions.append(of_mark)
            repeated.append(before is not None and picture.is_same_as(before))
            if steady is not None:
                image = picture.colours
                moves.append(UNKNOWN_MOVE if image is None else steady.at(image, picture.predicted))
            if body is not None:
                begun.append(body.begin(of_mark))
                turns.append(turn_ahead(body, film, picture, before, begun[-1]))
            before = picture
            if progress is not None:
                progress(picture.index + 1, count)
    shakes = None if steady is None else tuple(moves)
    ahead = None if body is None else TurnsAhead(body, begun, turns)
    return Reading(np.array(time), tuple(regions), np.array(decoded), np.array(repeated), shakes, ahead)


def _search(
    film: Film, found: FoundMark, steady: BackgroundMotion | None, body: BodyAhead | None
) -> Callable[[Picture], list[Region]]:
    """Return the search for the mark in one picture after another, which also makes the conversions that follow."""
    # a body that was learnt shows where a thing that is alike was taken for the mark; else all such things are found
    search = MarkSearch(found, None if body is None else body.path.is_mark)

    def regions(picture: Picture) -> list[Region]:
        # converted once, here, where a thread has time for it
        if steady is not None:
            _ = picture.colours
        elif body is not None and (film.coarse_colour or not picture.has_parts):
            registered_planes(film, picture)
        if picture.stored is None:
            search.lose()
            return []
        return search.regions(picture.index, film.size, picture.colours_in)

    return regions
