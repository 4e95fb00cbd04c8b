"""One reading of a long film by several processes, each of which decodes parts of it and measures in them.

Python runs one thread at a time, so that two threads that decode and measure do the work of one and a half. The result
does not depend on the number of processes: the search for the mark begins anew where a part may begin. A film in which
a frame is missing or damaged is read from its start by one process.

The processes are those of loky, which need no guard in the program that starts them, and notice if one of them dies.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from threading import Event

import cv2
from loky import ProcessPoolExecutor
from loky.process_executor import BrokenProcessPool

from anglecam.end_with_parent import end_with_parent
from anglecam.measurement.frame_reading import Reading, Sought, joined, read_frames, read_some
from anglecam.threads import ONE_THREAD, native_threads
from anglecam.video.film import Film
from anglecam.video.film_parts import FilmParts, parts_of
from anglecam.video.from_key import IrregularFilmError
from anglecam.video.open_film import open_film
from anglecam.video.row_cache import MOST_ROWS
from anglecam.vision.mark.mark_search import WHOLE_EVERY

FEWEST = MOST_ROWS
"""Frames of a film from which on processes are started, which takes each of them one to two seconds."""
PARTS_EACH = 4
"""Least number of parts for each process."""


@dataclass(frozen=True)
class Readers:
    """The processes that read a film together with this one, and the parts that they share."""

    pool: ProcessPoolExecutor
    count: int
    """Of the processes besides this one."""
    parts: FilmParts


@contextmanager
def readers_for(film: Film) -> Iterator[Readers | None]:
    """Start processes that will read a film, so that they load their libraries while what it shows is learnt.

    Parameters
    ----------
    film : Film
        A film of which a sample was taken.

    Yields
    ------
    Readers or None
        ``None`` where this process reads the film alone: the film is short, or it cannot be decoded in parts, or one
        thread is allowed. The processes end with the block.
    """
    parts = parts_of(film, WHOLE_EVERY) if native_threads() > 1 else None
    count = 0 if parts is None or parts.count < FEWEST else min(native_threads() - 1, len(parts) // PARTS_EACH)
    if parts is None or count == 0:
        yield None
        return
    with_parent = (os.getpid(),)
    pool = ProcessPoolExecutor(count, initializer=_begin, initargs=with_parent, env=ONE_THREAD)
    try:
        for _ in range(count):
            pool.submit(_load)
        yield Readers(pool, count, parts)
    finally:
        pool.shutdown(kill_workers=True)


def read_in_parts(
    readers: Readers, film: Film, sought: Sought, progress: Callable[[int], None] | None = None
) -> Reading:
    """Read a film once, as `read_frames` does.

    Parameters
    ----------
    readers : Readers
        The processes that take part.
    film : Film
        The clip.
    sought : Sought
        Mark and body; the camera is at rest.
    progress : callable, optional
        Called with the number of frames done.

    Returns
    -------
    Reading
        Of all frames, equal to that of one process.
    """
    parts = readers.parts
    waiting, found, ended = SimpleQueue[int](), {}, Event()
    for part in range(len(parts)):
        waiting.put(part)
    done = progress or (lambda frames: None)
    # this process computes properties of its own one and keeps them in it, perhaps while the other one is being sent
    sent = deepcopy(sought)

    def take_parts(read: Callable[[int], Reading]) -> None:
        try:
            while not ended.is_set():
                part = waiting.get_nowait()
                found[part] = read(part)
        except Empty:
            return
        except BaseException:
            ended.set()
            raise

    def by_other(part: int) -> Reading:
        return readers.pool.submit(read_part, parts, sent, part).result()

    def by_this(part: int) -> Reading:
        reading = read_part(parts, sought, part)
        done(sum(len(one.time) for one in found.values()) + len(reading.time))
        return reading

    try:
        with ThreadPoolExecutor(readers.count) as threads:
            others = [threads.submit(take_parts, by_other) for _ in range(readers.count)]
            take_parts(by_this)
            for other in others:
                other.result()
    except (IrregularFilmError, BrokenProcessPool):
        return read_frames(film, sought, progress)
    done(parts.count)
    reading = joined([found[part] for part in range(len(parts))])
    film.rows.note_intact(reading.time.tolist(), int(reading.interlaced.sum()))
    return reading


def read_part(parts: FilmParts, sought: Sought, part: int) -> Reading:
    """Read one of the parts of a film.

    Raises
    ------
    IrregularFilmError
        As `FilmParts.pictures`.
    """
    film = open_film(parts.path, parts.wanted)
    pictures = parts.pictures(film, part)
    before = next(pictures) if part > 0 else None
    return read_some(film, sought, before, pictures)


def _begin(parent: int) -> None:
    """Prepare a process that reads: it ends with its parent, which also handles Ctrl-C."""
    end_with_parent(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    cv2.setNumThreads(1)


def _load() -> None:
    """Do nothing; a process loads this module, and all that it needs, before it is called."""
