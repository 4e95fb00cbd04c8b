"""Number of threads that one clip or session may use."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

T = TypeVar("T")
R = TypeVar("R")


def native_threads() -> int:
    """Return the number of threads to use: ``OMP_NUM_THREADS`` if it is set, as in other programs, else all cores."""
    stated = os.environ.get("OMP_NUM_THREADS", "")
    return int(stated) if stated.isdecimal() and int(stated) > 0 else cores()


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
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(work, items))
