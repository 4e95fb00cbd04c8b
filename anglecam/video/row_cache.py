"""All rows of a film after its first reading, as far as the free memory allows, so that it is not decoded again.

Where the pictures of a film depend on each other, all of them are decoded to learn from some of them what the film
shows. In full HD that takes as long as the measurement itself.
"""

from __future__ import annotations

import av

from anglecam.free_memory import free_memory
from anglecam.threads import cores, native_threads
from anglecam.video.decode import Row

MOST_ROWS = 2048
"""Longer films are measured in parts, by several processes each of which decodes."""
_SHARE = 0.125
"""Of the free memory, for all processes that measure on this machine: what is left serves them and other programs."""


class RowCache:
    """Keeps all rows of a film, or none where they are too many or their pictures too large.

    Parameters
    ----------
    room : int
        Bytes of pictures at most.
    """

    def __init__(self, room: int) -> None:
        self._room = room
        self._rows: list[Row] | None = []

    @property
    def rows(self) -> list[Row] | None:
        """The rows that were added, in their order; ``None`` where not all could be kept."""
        return self._rows

    def add(self, row: Row) -> None:
        """Keep the next row, or from now on none."""
        if self._rows is None:
            return
        self._room -= picture_bytes(row[1])
        if self._room < 0 or len(self._rows) == MOST_ROWS:
            self._rows = None
        else:
            self._rows.append(row)


def cache_room() -> int:
    """Return how many bytes of pictures this process may keep, where the other cores work on other films."""
    return int(_SHARE * min(native_threads() / cores(), 1.0) * free_memory())


def picture_bytes(picture: av.VideoFrame | None) -> int:
    """Return the memory of a decoded picture."""
    return 0 if picture is None else sum(plane.buffer_size for plane in picture.planes)
