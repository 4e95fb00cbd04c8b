"""The parts of a film that can be decoded without the rest of it, each by a process of its own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anglecam.io.rig import RigFrames
from anglecam.video.container import LONGEST_S, open_container
from anglecam.video.film import Film
from anglecam.video.frame_index import FrameIndex, index_frames
from anglecam.video.from_key import IrregularFilmError, decode_from_key
from anglecam.video.picture import Picture

LENGTH = 96
"""Least number of frames of a part: a few tenths of a second of work, so that processes end together, and opening the
film costs a fiftieth of it."""


@dataclass(frozen=True)
class FilmParts:
    """A film, and where each of its parts begins."""

    path: Path
    wanted: RigFrames
    index: FrameIndex
    starts: tuple[int, ...]
    """Numbers of the first frames of the parts, and of the frame after the last, counted from the first frame that is
    measured."""

    def __len__(self) -> int:
        return len(self.starts) - 1

    @property
    def count(self) -> int:
        """Number of frames in all parts."""
        return self.starts[-1]

    def pictures(self, film: Film, part: int) -> Iterator[Picture]:
        """Yield the frame before a part, if there is one, and the frames of the part.

        Parameters
        ----------
        film : Film
            The film, opened.
        part : int
            From 0.

        Yields
        ------
        Picture
            As `Film.pictures`.

        Raises
        ------
        IrregularFilmError
            Where a frame is missing or damaged, so that the film has to be decoded from its start.
        InputError
            Where the film cannot be opened.
        """
        first, end = film.first_frame + max(self.starts[part] - 1, 0), film.first_frame + self.starts[part + 1]
        times, at = self.index.times, first
        with open_container(self.path) as container:
            decoder = container.streams.video[0].codec_context
            decoder.thread_type, decoder.thread_count = "SLICE", 1
            for number, picture in decode_from_key(container, self.index, first):
                if number < first:
                    continue
                if number != at or (picture.width, picture.height) != film.display.stored_size:
                    raise IrregularFilmError
                yield film.picture(number - film.first_frame, (float(times[number]), picture))
                at += 1
                if at == end:
                    return
        raise IrregularFilmError


def parts_of(film: Film, every: int) -> FilmParts | None:
    """Return the parts of a film.

    Parameters
    ----------
    film : Film
        The film.
    every : int
        Parts begin at multiples of this number of frames.

    Returns
    -------
    FilmParts or None
        ``None`` where the film is kept in memory or transformed, ends too early, begins within an edit list, or its
        packets do not say which frame is which.

    Raises
    ------
    InputError
        As `anglecam.video.frame_index.index_frames`.
    """
    if film.path.is_dir() or film.cut_short or film.thinned() is None:
        return None
    index = index_frames(film.path)
    if index is None or index.times[-1] - index.times[0] > LONGEST_S or index.keys[0] != index.stamps[0]:
        return None
    wanted = film.rows.wanted
    last = len(index.stamps) if wanted.last is None else min(wanted.last + 1, len(index.stamps))
    count = last - film.first_frame
    keys = np.searchsorted(index.stamps, index.keys) - film.first_frame
    # the frame before a part is decoded with it, to be compared with its first
    starts = [0]
    for start in (keys // every + 1) * every:
        if start - starts[-1] >= LENGTH and count - start >= LENGTH:
            starts.append(int(start))
    return FilmParts(film.path, wanted, index, (*starts, count))
