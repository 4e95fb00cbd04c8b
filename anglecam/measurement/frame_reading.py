"""One reading of a film: the regions of the mark's colour in every frame, and what needs the same pictures.

A camera that shakes is followed on the background. Where the body was learnt beforehand from evenly spaced frames
(`anglecam.measurement.body_ahead`), its rotation is found in the same reading.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from anglecam.data.typing import Flags, Floats
from anglecam.measurement.body_ahead import BodyAhead, registered_planes, turn_ahead
from anglecam.threads import one_opencv_thread
from anglecam.video.film import Film
from anglecam.video.picture import Picture
from anglecam.vision.mark.found_mark import FoundMark
from anglecam.vision.mark.mark_search import MarkSearch
from anglecam.vision.mark.segment import Region
from anglecam.vision.registration.turn import TurnEstimate
from anglecam.vision.stabilise.background_motion import UNKNOWN_MOVE, CameraMove
from anglecam.vision.stabilise.dominant_shift import CameraMotion


@dataclass(frozen=True)
class Sought:
    """What is known before a reading of all frames, by a sample of them."""

    mark: FoundMark
    """Colour and size."""
    body: BodyAhead | None = None
    """The body, where it was learnt beforehand."""
    steady: CameraMotion | None = None
    """The scenery, where the camera shakes."""


@dataclass(frozen=True)
class Reading:
    """What one reading finds; sequences have an entry a frame."""

    time: Floats
    """Time stamps, s."""
    regions: Sequence[list[Region]]
    """Regions of the mark's colour, in the picture."""
    decoded: Flags
    """Frames with a picture."""
    repeated: Flags
    """Frames that equal the previous frame bit for bit."""
    interlaced: Flags
    """Frames that show two instants."""
    moves: Sequence[CameraMove]
    """Motion of the camera; empty where it stands still."""
    begun: Sequence[float]
    """Angle at which the search for the body begins, rad; empty where it was not learnt beforehand."""
    turns: Sequence[TurnEstimate]
    """Rotation of that body."""


def read_frames(film: Film, sought: Sought, progress: Callable[[int], None] | None = None) -> Reading:
    """Read a film once.

    Parameters
    ----------
    film : Film
        The clip.
    sought : Sought
        Mark, body and scenery.
    progress : callable, optional
        Called with the number of frames done after each frame.

    Returns
    -------
    Reading
        Of all frames.
    """
    return _read(film, sought, film.pictures(_search(film, sought)), None, progress)


def read_some(film: Film, sought: Sought, before: Picture | None, pictures: Iterable[Picture]) -> Reading:
    """Read consecutive frames of a film, of which the first has a multiple of `WHOLE_EVERY` as its number.

    Parameters
    ----------
    film : Film
        The clip.
    sought : Sought
        As in `read_frames`.
    before : Picture, optional
        The frame before them.
    pictures : iterable of Picture
        These frames.

    Returns
    -------
    Reading
        Of these frames, the same as in a reading of the whole film.
    """
    search = _search(film, sought)
    return _read(film, sought, ((picture, search(picture)) for picture in pictures), before, None)


def joined(readings: Sequence[Reading]) -> Reading:
    """Return the reading of frames that were read one after another."""
    return Reading(
        time=np.concatenate([one.time for one in readings]),
        regions=list(chain.from_iterable(one.regions for one in readings)),
        decoded=np.concatenate([one.decoded for one in readings]),
        repeated=np.concatenate([one.repeated for one in readings]),
        interlaced=np.concatenate([one.interlaced for one in readings]),
        moves=list(chain.from_iterable(one.moves for one in readings)),
        begun=list(chain.from_iterable(one.begun for one in readings)),
        turns=list(chain.from_iterable(one.turns for one in readings)),
    )


def _read(
    film: Film,
    sought: Sought,
    found: Iterable[tuple[Picture, list[Region]]],
    before: Picture | None,
    progress: Callable[[int], None] | None,
) -> Reading:
    time: list[float] = []
    regions: list[list[Region]] = []
    decoded: list[bool] = []
    repeated: list[bool] = []
    interlaced: list[bool] = []
    moves: list[CameraMove] = []
    begun: list[float] = []
    turns: list[TurnEstimate] = []
    steady, body = sought.steady, sought.body
    with one_opencv_thread():
        for picture, of_mark in found:
            time.append(picture.time)
            decoded.append(picture.stored is not None)
            regions.append(of_mark)
            repeated.append(before is not None and picture.is_same_as(before))
            interlaced.append(picture.stored is not None and picture.stored.interlaced_frame)
            if steady is not None:
                image = picture.colours
                moves.append(UNKNOWN_MOVE if image is None else steady.at(image, picture.predicted))
            if body is not None:
                begun.append(body.begin(of_mark))
                turns.append(turn_ahead(body, film, picture, before, begun[-1]))
            before = picture
            if progress is not None:
                progress(len(time))
    return Reading(
        np.array(time), regions, np.array(decoded), np.array(repeated), np.array(interlaced), moves, begun, turns
    )


def _search(film: Film, sought: Sought) -> Callable[[Picture], list[Region]]:
    """Return the search for the mark in one picture after another, which also makes the conversions that follow."""
    body = sought.body
    # a body that was learnt shows where a thing that is alike was taken for the mark; else all such things are found
    search = MarkSearch(sought.mark, None if body is None else body.path.is_mark)

    def regions(picture: Picture) -> list[Region]:
        # converted once, here, where a thread has time for it
        if sought.steady is not None:
            _ = picture.colours
        elif body is not None and (film.coarse_colour or not picture.has_parts):
            registered_planes(film, picture)
        if picture.stored is None:
            search.lose()
            return []
        return search.regions(picture.index, film.size, picture.colours_in)

    return regions
