"""A film that is read several times is decoded once, if it is short.

Decoding a lossless picture takes as long as measuring in it. A film whose pictures fit into a bounded memory is kept,
as its decoder gave it, from its first complete reading until the block ends; a longer one is decoded at every reading.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from av.video.frame import VideoFrame

Row = tuple[float, VideoFrame | None]
"""Time, s, and picture of a frame, ``None`` where it cannot be decoded."""

MOST_BYTES = 256 * 2**20
"""Of the pictures that are kept: 220 lossless ones of 640 × 480 px, 580 of an ordinary codec."""
_kept: ContextVar[dict[Path, list[Row] | None] | None] = ContextVar("_kept", default=None)
"""What the block has read, in this thread alone; a film that is too long is ``None``."""


@contextmanager
def decoded_once() -> Iterator[None]:
    """Keep short films while the block runs; they are its own, and gone when it ends."""
    films: dict[Path, list[Row] | None] = {}
    token = _kept.set(films)
    try:
        yield
    finally:
        _kept.reset(token)
        films.clear()


def reread(path: Path, decode: Callable[[Path], Iterator[Row]]) -> Iterator[Row]:
    """Yield a film's frames from memory, or as they are decoded.

    Parameters
    ----------
    path : Path
        The film.
    decode : callable
        What reads it.

    Yields
    ------
    tuple of (float, VideoFrame or None)
        The same ones at every reading within `decoded_once`.
    """
    films = _kept.get()
    known = None if films is None else films.get(path)
    if known is not None:
        yield from known
        return
    if films is None or path in films:
        yield from decode(path)
        return
    rows: list[Row] = []
    room = MOST_BYTES - sum(_size(row) for film in films.values() for row in film or ())
    for row in decode(path):
        room -= _size(row)
        if room >= 0:
            rows.append(row)
        else:
            rows.clear()
        yield row
    films[path] = rows if room >= 0 else None


def _size(row: Row) -> int:
    picture = row[1]
    return 0 if picture is None else sum(plane.buffer_size for plane in picture.planes)
