"""How many threads one clip or session may take."""

from __future__ import annotations

import os


def native_threads() -> int:
    """Return how many threads to use: ``OMP_NUM_THREADS`` where it is set, as in other programs, else all cores."""
    stated = os.environ.get("OMP_NUM_THREADS", "")
    return int(stated) if stated.isdecimal() and int(stated) > 0 else cores()


def cores() -> int:
    """Count the cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
