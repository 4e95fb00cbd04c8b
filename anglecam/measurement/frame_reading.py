"""One reading of a film: the regions of the mark's colour in every frame, and what needs the same pictures.

A camera that shakes is followed on the background. Where the body was learnt beforehand from evenly spaced frames
(`anglecam.measurement.body_ahead`), its rotation is found in the same reading.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from anglecam.data.typing import Flags, Floats
from anglecam.measurement.body_ahead import BodyAhead, TurnsAhead, turn_ahead
from anglecam.threads import Backlog
from anglecam.video.film import Film
from anglecam.video.picture import Picture
from anglecam.vision.mark.found_mark import FoundMark
from anglecam.vision.mark.mark_search import MarkSearch
from anglecam.vision.mark.segment import Region
from anglecam.vision.registration.turn import NO_TURN, TurnEstimate
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


class FrameReader:
    """Reads one frame after another.

    Parameters
    ----------
    film : Film
        How the frames are stored and shown.
    found : FoundMark
        The mark's colour and size, from a sample of frames.
    steady : BackgroundMotion, optional
        The scenery, where the camera shakes.
    body : BodyAhead, optional
        The body, where it was learnt beforehand.
    """

    def __init__(
        self, film: Film, found: FoundMark, steady: BackgroundMotion | None = None, body: BodyAhead | None = None
    ) -> None:
        self._film, self._steady, self._body = film, steady, body
        # a body that was learnt shows where a like thing was taken for the mark; else all such things are found
        self._search = MarkSearch(found, None if body is None else body.path.is_mark)
        self._before: Picture | None = None
        self._time: list[float] = []
        self._regions: list[list[Region]] = []
        self._decoded: list[bool] = []
        self._repeated: list[bool] = []
        self._moves: list[CameraMove] = []
        self._begun: list[float] = []
        self._turns: Backlog[TurnEstimate] = Backlog()

    def add(self, picture: Picture) -> None:
        """Read the next frame."""
        if picture.stored is None:
            self._search.lose()
            regions: list[Region] = []
        else:
            regions = self._search.regions(picture.index, self._film.size, picture.colours_in)
        repeated = self._before is not None and picture.is_same_as(self._before)
        if self._steady is not None:
            image = picture.colours
            self._moves.append(UNKNOWN_MOVE if image is None else self._steady.at(image, picture.predicted))
        self._keep(picture, regions, repeated, np.nan if self._body is None else self._body.begin(regions))

    def skip(self, picture: Picture) -> None:
        """Count the next frame without reading it."""
        self._search.lose()
        self._keep(picture, [], False, np.nan)

    def newest(self) -> tuple[list[Region], TurnEstimate]:
        """Return the regions in the last frame, and the body's rotation there."""
        return self._regions[-1], NO_TURN if self._body is None else self._turns.newest()

    def reading(self) -> Reading:
        """Return what was found in all frames."""
        shakes = None if self._steady is None else tuple(self._moves)
        ahead = None if self._body is None else TurnsAhead(self._body, self._begun, self._turns.results())
        return Reading(
            np.array(self._time),
            tuple(self._regions),
            np.array(self._decoded, bool),
            np.array(self._repeated, bool),
            shakes,
            ahead,
        )

    def _keep(self, picture: Picture, regions: list[Region], repeated: bool, begin: float) -> None:
        self._time.append(picture.time)
        self._decoded.append(picture.stored is not None)
        self._regions.append(regions)
        self._repeated.append(repeated)
        if self._body is not None:
            self._begun.append(begin)
            self._turns.add(turn_ahead(self._body, self._film, picture, self._before, begin))
        self._before = picture


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
    reader = FrameReader(film, found, steady, body)
    for picture in film.pictures(_ready(film, body, steady)):
        reader.add(picture)
        if progress is not None:
            progress(picture.index + 1, count)
    return reader.reading()


def _ready(film: Film, body: BodyAhead | None, steady: BackgroundMotion | None) -> Callable[[Picture], object] | None:
    """Return the conversion that every picture needs, which is made while the picture before it is measured."""
    if body is None and steady is None:
        return None
    return (lambda picture: picture.brightness) if film.coarse_colour and steady is None else lambda p: p.colours
