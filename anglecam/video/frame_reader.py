"""Any frame of a film, exactly, for somebody who looks at one after another.

A film in which one picture is not where its index says is decoded from its start, as for measuring.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator
from threading import Lock

import av

from anglecam.data.typing import Floats
from anglecam.errors import InputError
from anglecam.threads import native_threads
from anglecam.video.container import open_container
from anglecam.video.film import Film
from anglecam.video.frame_index import FrameIndex, index_frames
from anglecam.video.from_key import IrregularFilmError, decode_from_key
from anglecam.video.picture import Picture
from anglecam.video.row_cache import picture_bytes

_MOST_BYTES = 192 * 2**20
"""Of decoded pictures that are kept: 60 of 1920 × 1080 px, two seconds back."""
_NEAR = 8
"""Frames that are decoded on the way to a later one rather than sought."""

_Numbered = tuple[int, av.VideoFrame | None]


class FrameReader:
    """Reads single frames of a film; several threads may share it.

    Parameters
    ----------
    film : Film
        All of its frames are read, whatever range of them is measured: number 0 is the film's first.

    Raises
    ------
    InputError
        As `anglecam.video.frame_index.index_frames`, and where a film without an index cannot be decoded.
    """

    def __init__(self, film: Film) -> None:
        self._film, self._lock = film, Lock()
        self._index: FrameIndex | None = None if film.path.is_dir() else index_frames(film.path)
        self.times: Floats = film.times if self._index is None else self._index.times
        self._container: av.container.InputContainer | None = None
        self._kept: OrderedDict[int, av.VideoFrame | None] = OrderedDict()
        self._bytes = 0
        self._ahead: Iterator[_Numbered] = iter(())
        self._next = -1

    def picture(self, number: int) -> Picture:
        """Return a frame.

        Parameters
        ----------
        number : int
            From 0.

        Returns
        -------
        Picture
            As it is measured; without a picture where it cannot be decoded.

        Raises
        ------
        IndexError
            Where the film has no such frame.
        InputError
            Where the film cannot be read.
        """
        if not 0 <= number < len(self.times):
            raise IndexError(number)
        with self._lock:
            if number not in self._kept:
                self._find(number)
            self._kept.move_to_end(number)
            return self._film.picture(number, (float(self.times[number]), self._kept[number]))

    def close(self) -> None:
        """Forget all pictures and close the file."""
        with self._lock:
            self._ahead, self._next, self._bytes = iter(()), -1, 0
            self._kept.clear()
            if self._container is not None:
                self._container.close()
            self._container = None

    def _find(self, number: int) -> None:
        """Decode a frame; from the first irregularity on, the film is decoded from its start."""
        try:
            if self._decode_to(number):
                return
        except IrregularFilmError:
            pass
        self._index, self._next = None, -1
        if not self._decode_to(number):
            raise InputError(f"{self._film.path}: it ends before frame {number}")

    def _decode_to(self, number: int) -> bool:
        """Decode forward from where the last frame was read or from a key frame; return whether the frame came."""
        if not self._is_ahead(number):
            self._ahead = self._from_start() if self._index is None else self._from_key(self._index, number)
        for at, picture in self._ahead:
            self._next = at + 1
            self._keep(at, picture)
            if at == number:
                return True
        return False

    def _is_ahead(self, number: int) -> bool:
        if not 0 <= self._next <= number:
            return False
        if self._index is None or number < self._next + _NEAR:
            return True
        key = self._index.key_before(number)
        return key is None or key < self._index.stamps[self._next]

    def _keep(self, number: int, picture: av.VideoFrame | None) -> None:
        if number in self._kept:
            return
        self._kept[number] = picture
        self._bytes += picture_bytes(picture)
        while self._bytes > _MOST_BYTES and len(self._kept) > 1:
            self._bytes -= picture_bytes(self._kept.popitem(last=False)[1])

    def _from_start(self) -> Iterator[_Numbered]:
        for number, (_, picture) in enumerate(self._film.rows.read()):
            if number == len(self.times):
                break
            yield number, picture

    def _from_key(self, index: FrameIndex, number: int) -> Iterator[_Numbered]:
        """Yield the frames from the key frame before one on; raise where one is missing or not what it should be."""
        if self._container is None:
            self._container = open_container(self._film.path)
            decoder = self._container.streams.video[0].codec_context
            decoder.thread_type, decoder.thread_count = "FRAME", native_threads()
        yield from decode_from_key(self._container, index, number)
