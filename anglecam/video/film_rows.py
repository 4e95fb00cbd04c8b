"""A film's rows, a time and a stored picture each: all of a short film are kept, evenly spaced ones of a long film.

Measuring reads a film several times, and decoding a lossless picture takes as long as measuring in it. So the pictures
of a short film are kept from its first reading on. Of a long film, what it shows is learnt from evenly spaced ones.
Where all have to be decoded for that, they are kept as far as the free memory allows (`anglecam.video.row_cache`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

from anglecam.errors import InputError
from anglecam.io.rig import RigFrames
from anglecam.video.decode import Row, Wants
from anglecam.video.row_cache import MOST_ROWS, RowCache, cache_room, picture_bytes

MOST_BYTES = 256 * 2**20
"""Of decoded pictures: 220 lossless ones of 640 × 480 px, 580 of an ordinary codec."""
MOST_SPREAD = 240
"""Evenly spaced rows of a film of which not all are kept: twice the number from which a body is learnt."""
_FEWEST = 16
"""Rows of which none is dropped, however large their pictures are."""
_LARGEST_GAP = 2.0
"""Between rows that are decoded, relative to the spacing of half of `MOST_SPREAD` rows."""


@dataclass
class KeptRows:
    """Keeps evenly spaced rows; when their pictures need too much memory, every second one is dropped."""

    stride: int = 1
    """The first row of each so many rows is kept; 1 where all rows of the film are."""
    rows: list[tuple[int, Row]] = field(default_factory=list)
    """With their numbers."""
    _bytes: int = 0

    def wants(self, number: int) -> bool:
        """Return whether a row that comes after those that are kept will be kept."""
        return not self.rows or number // self.stride > self.rows[-1][0] // self.stride

    def add(self, number: int, row: Row) -> None:
        """Keep a row if it is wanted; rows come in their order."""
        if not self.wants(number):
            return
        self.rows.append((number, row))
        self._bytes += picture_bytes(row[1])
        while self._too_many():
            self.stride *= 2
            self.rows = first_of_each(self.stride, self.rows)
            self._bytes = sum(picture_bytes(one[1]) for _, one in self.rows)

    def _too_many(self) -> bool:
        count = len(self.rows)
        return (self._bytes > MOST_BYTES and count > _FEWEST) or (self.stride > 1 and count > MOST_SPREAD)


class FilmRows:
    """The rows of a film, as often as they are needed.

    Parameters
    ----------
    path : Path
        The film, for messages.
    decode : callable
        Decodes the rows from the start, because seeking may end on a wrong frame. It is called with which pictures are
        wanted, or with ``None`` for all.
    wanted : RigFrames
        Which frames are measured: only these are yielded.
    independent : bool
        Whether each picture is decoded without the others, so that some can be left out.
    declared : int
        Number of rows that the container states; 0 where that is not to be relied on.
    bytes_each : int
        Memory of a decoded picture.
    decode_keys : callable, optional
        Decodes the rows, those alone with a picture that need no other.
    """

    def __init__(
        self,
        path: Path,
        decode: Callable[[Wants | None], Iterator[Row]],
        wanted: RigFrames | None = None,
        independent: bool = False,
        declared: int = 0,
        bytes_each: int = 0,
        decode_keys: Callable[[], Iterator[Row]] | None = None,
    ) -> None:
        self.wanted = RigFrames() if wanted is None else wanted
        self.first = self.wanted.first or 0
        self._path, self._decode, self._independent = path, decode, independent
        self._declared, self._bytes_each = declared, bytes_each
        self._decode_keys = decode_keys
        self._times: list[float] | None = None
        self._undecodable = self._interlaced = self._count = 0
        self._kept: KeptRows | None = None
        self._all: list[Row] | None = None

    @property
    def times(self) -> list[float]:
        """Presentation times, s; reads the film unless it was read before. So do the other properties."""
        self._read_once()
        assert self._times is not None
        return self._times

    @property
    def undecodable(self) -> int:
        """Number of rows without a picture."""
        self._read_once()
        return self._undecodable

    @property
    def interlaced(self) -> int:
        """Number of pictures that show two instants."""
        self._read_once()
        return self._interlaced

    @property
    def is_read(self) -> bool:
        """Whether all pictures were decoded before."""
        return self._times is not None

    @property
    def count(self) -> int:
        """Number of rows, of which not all were decoded."""
        return len(self.kept.rows) if self.kept.stride == 1 else self._count

    @property
    def kept(self) -> KeptRows:
        """The rows that are kept."""
        if self._kept is None:
            self.learn()
        assert self._kept is not None
        return self._kept

    @property
    def declared(self) -> int | None:
        """Number of wanted rows by what the container states; ``None`` where that is not to be relied on."""
        last = self._declared if self.wanted.last is None else min(self._declared, self.wanted.last + 1)
        return last - self.first if last > self.first else None

    def learn(self, done: Callable[[int], None] = lambda rows: None) -> None:
        """Read the rows that are kept, unless they were read before.

        Parameters
        ----------
        done : callable
            Called with the number of rows that were read.
        """
        if self._kept is not None:
            return
        # where they are more than are kept for sure, the others are not decoded
        if self._declared * self._bytes_each > MOST_BYTES:
            self._keep_some(done)
        if self._kept is None:
            self._read_once(done)

    def read(self, wants: Wants | None = None) -> Iterator[Row]:
        """Yield the rows from memory, or decode them; the first complete reading fills the memory.

        Parameters
        ----------
        wants : callable, optional
            Which pictures are wanted, by the numbers of the rows; others may be missing.

        Yields
        ------
        tuple of (float, VideoFrame or None)
            Time, s, and picture.
        """
        if self._kept is not None and self._kept.stride == 1:
            yield from (row for _, row in self._kept.rows)
        elif self._all is not None:
            yield from self._all
        elif self.is_read or wants is not None:
            yield from self._decoded(wants)
        else:
            yield from self._read_all()

    def note_intact(self, times: list[float], interlaced: int) -> None:
        """Note what a reading by others found, in which every picture could be decoded; some rows were kept before."""
        self._times, self._undecodable, self._interlaced, self._count = times, 0, interlaced, len(times)

    def _read_once(self, done: Callable[[int], None] = lambda rows: None) -> None:
        """Read the film to learn from some of its pictures; keep all of them for what comes next."""
        if self.is_read:
            return
        room = cache_room()
        fits = self._declared <= MOST_ROWS and self._declared * self._bytes_each <= room
        cache = RowCache(room if fits else 0)
        for number, row in enumerate(self._read_all(), start=1):
            cache.add(row)
            done(number)
        if self._kept is not None and self._kept.stride > 1:
            self._all = cache.rows

    def _read_all(self) -> Iterator[Row]:
        times: list[float] = []
        undecodable = interlaced = 0
        kept = KeptRows()
        for row in self._decoded(None):
            if self._kept is None:
                kept.add(len(times), row)
            times.append(row[0])
            undecodable += row[1] is None
            interlaced += row[1] is not None and row[1].interlaced_frame
            yield row
        self._times, self._undecodable, self._interlaced, self._count = times, undecodable, interlaced, len(times)
        self._kept = self._kept or kept

    def _keep_some(self, done: Callable[[int], None]) -> None:
        """Keep evenly spaced rows without decoding all of them, where the codec allows it."""
        if self._independent:
            kept = KeptRows(stride=self._expected_stride())
            count, _ = _keep(kept, self._decoded(kept.wants), done)
            if kept.stride > 1 and len(kept.rows) < self._room() / 4:  # there are fewer than the container states
                kept = KeptRows()
                count, _ = _keep(kept, self._decoded(kept.wants), done)
            self._kept, self._count = kept, count
        elif self._decode_keys is not None:
            kept = KeptRows(stride=2)
            try:
                count, gap = _keep(kept, self._wanted(self._decode_keys()), done, pictures_only=True)
            except InputError:  # it is repeated where all pictures are decoded
                return
            if gap <= _LARGEST_GAP * count / (MOST_SPREAD / 2):
                self._kept, self._count = kept, count

    def _expected_stride(self) -> int:
        """Return the spacing of the rows that will be kept if there are as many as declared."""
        stride = 1
        while (self.declared or 0) / stride > self._room():
            stride *= 2
        return stride

    def _room(self) -> int:
        """Return how many rows of a long film are kept at most."""
        return min(MOST_SPREAD, max(MOST_BYTES // max(self._bytes_each, 1), _FEWEST))

    def _decoded(self, wants: Wants | None) -> Iterator[Row]:
        some = None if wants is None or not self._independent else lambda number: wants(number - self.first)
        return self._wanted(self._decode(some))

    def _wanted(self, rows: Iterator[Row]) -> Iterator[Row]:
        """Yield the rows that are wanted; raise an `InputError` where there are none."""
        stop = None if self.wanted.last is None else self.wanted.last + 1
        before = sum(1 for _ in islice(rows, self.first))
        wanted = islice(rows, None if stop is None else stop - self.first)
        row = next(wanted, None)
        if row is None:
            raise ends_before(self._path, self.first, before)
        yield row
        yield from wanted


def ends_before(path: Path, first: int, count: int) -> InputError:
    """Return the error of a film that ends before the first frame that is wanted.

    Parameters
    ----------
    path : Path
        The film.
    first : int
        Number of that frame.
    count : int
        Number of frames that the film has.
    """
    return InputError(f"{path}: {frames_there_are(count)}; frame {first} was asked for as the first (--from, frames:)")


def frames_there_are(count: int) -> str:
    """Return how many frames a film has, and how they are numbered.

    Examples
    --------
    >>> frames_there_are(305)
    'the film has 305 frames, numbered from 0 to 304'
    """
    return f"the film has {count} frames, numbered from 0 to {count - 1}"


def why_short(last: int | None, count: int) -> str | None:
    """Return a message where a film ends before the last frame that is wanted.

    Parameters
    ----------
    last : int, optional
        Number of that frame.
    count : int
        Number of frames that the film has.
    """
    if last is None or last < count:
        return None
    return f"{frames_there_are(count)}; frame {last} was asked for as the last (--to, frames:)"


def first_of_each(stride: int, rows: Sequence[tuple[int, Row]]) -> list[tuple[int, Row]]:
    """Return the first of the numbered rows in each range of ``stride`` numbers that begins at a multiple of it."""
    starts = [k for k, (number, _) in enumerate(rows) if k == 0 or number // stride > rows[k - 1][0] // stride]
    return [rows[k] for k in starts]


def _keep(
    kept: KeptRows, rows: Iterator[Row], done: Callable[[int], None], pictures_only: bool = False
) -> tuple[int, int]:
    """Offer all rows, or those with a picture, to be kept.

    Returns
    -------
    count : int
        Number of all rows.
    gap : int
        Largest distance between neighbouring rows that were offered, the film's ends included.
    """
    count, gap, last = 0, 0, -1
    for row in rows:
        if not pictures_only or row[1] is not None:
            kept.add(count, row)
            gap, last = max(gap, count - last), count
        count += 1
        done(count)
    return count, max(gap, count - last)
