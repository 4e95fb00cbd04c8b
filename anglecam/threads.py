"""Number of threads that one clip or session may use."""

from __future__ import annotations

import os


def native_threads() -> int:
    """Return the number of threads to use: ``OMP_NUM_THREADS`` if it is set, as in other programs, else all cores."""
    stated = os.environ.get("OMP_NUM_THREADS", "")
    return int(stated) if stated.isdecimal() and int(stated) > 0 else cores()


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
