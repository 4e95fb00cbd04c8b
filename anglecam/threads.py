"""Number of threads that one clip or session may use."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Generic, TypeVar

T = TypeVar("T")
R = TypeVar("R")
ONE_THREAD = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "BLIS", "NUMBA")}
"""Environment of a process whose libraries are to use one thread each."""
_BEGUN = 4
"""Pictures that a decoder begins beyond one for each core: it goes on while the thread that feeds it is busy."""
_OPEN = 8
"""Pieces of work that wait at most: what they work on stays in memory."""


def native_threads() -> int:
    """Return the number of threads to use: ``OMP_NUM_THREADS`` if it is set, as in other programs, else all cores."""
    stated = os.environ.get("OMP_NUM_THREADS", "")
    return int(stated) if stated.isdecimal() and int(stated) > 0 else cores()


def picture_threads() -> int:
    """Return the number of threads of a decoder each of which decodes another picture."""
    return 1 if native_threads() == 1 else native_threads() + _BEGUN


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def map_in_threads(work: Callable[[T], R], items: Sequence[T]) -> list[R]:
    """Return what a function makes of each item, in their order; as many threads as are allowed share the work.

    They gain time where most of it is spent in compiled code that releases Python's lock.
    """
    threads = native_threads()
    if threads == 1:
        return [work(item) for item in items]
    with one_opencv_thread(), ThreadPoolExecutor(threads) as pool:
        return list(pool.map(work, items))


@contextmanager
def one_opencv_thread() -> Iterator[None]:
    """Let OpenCV use one thread while the block runs: for small pictures, starting others costs more than it saves."""
    import cv2  # what counts the cores need not load it

    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)


class Backlog(Generic[R]):
    """Work whose results are not needed yet: a second thread does it, in order, where one is allowed."""

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(1) if native_threads() > 1 else None
        self._open: deque[Future[R]] = deque()
        self._done: list[R] = []

    def add(self, work: Callable[[], R]) -> None:
        """Do this after all that was added before; wait for the oldest where many are open."""
        if self._pool is None:
            self._done.append(work())
            return
        self._open.append(self._pool.submit(work))
        if len(self._open) > _OPEN:
            self._done.append(self._open.popleft().result())

    def results(self) -> list[R]:
        """Return the results of all work in its order; raise what it raised."""
        while self._open:
            self._done.append(self._open.popleft().result())
        return self._done
