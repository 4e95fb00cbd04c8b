"""One film or session: where it is kept, what its measurement costs, and the row that states what became of it."""

from __future__ import annotations

import contextlib
import hashlib
import math
import resource
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numba.core import event
from scipy.ndimage import gaussian_filter

from benchmarks.fuzz.trial import forget_peak, peak

Row = dict[str, Any]
"""Ready for JSON; a figure that does not exist is ``None``. ``status`` is ok, refused (``message`` says why), internal
error, timeout or died, where the process ended without an answer."""


@dataclass(frozen=True)
class Places:
    """Folders outside the package."""

    cache: Path
    """Films that take long to draw are kept here."""
    real: Path | None
    """Films and logs that nobody here made."""


class Meter:
    """CPU time, peak memory and compiled kernels of what happens while it is entered."""

    def __init__(self) -> None:
        self.cpu_s, self.yardstick_s, self.peak_mib, self.kernels = math.nan, math.nan, math.nan, 0

    @contextlib.contextmanager
    def __call__(self) -> Iterator[None]:
        before = _yardstick_s()
        forget_peak()
        began = _cpu_s()
        with event.install_recorder("numba:compile") as seen:
            try:
                yield
            finally:
                self.cpu_s, self.peak_mib = _cpu_s() - began, peak() / 2**20
                self.kernels = sum(one.is_start for _, one in seen.buffer)
                self.yardstick_s = (before + _yardstick_s()) / 2.0

    @property
    def figures(self) -> Row:
        """Return what every row states of the cost."""
        return {
            "cpu_s": round(self.cpu_s, 2),
            "yardstick_s": round(self.yardstick_s, 3),
            "peak_mib": round(self.peak_mib),
            "kernels_compiled": self.kernels,
        }


def _cpu_s() -> float:
    of_children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + of_children.ru_utime + of_children.ru_stime


def _yardstick_s() -> float:
    """Return the CPU time of the same work every time: where other work shares the core's caches, it takes longer."""
    picture = np.random.default_rng(0).random((480, 640))
    began = time.process_time()
    for _ in range(40):
        gaussian_filter(picture, 2.0)
        np.sort(picture, axis=None)
    return time.process_time() - began


def status_of(message: str) -> str:
    """Return the status of a film or session that ended in one line."""
    return "internal error" if "internal error" in message else "refused"


def sha256(*paths: Path) -> str:
    """Return the first half of the hash of some files, in their order."""
    found = hashlib.sha256()
    for path in paths:
        found.update(path.read_bytes())
    return found.hexdigest()[:32]


def known(value: float) -> float | None:
    """Return a number as JSON can state it: ``None`` where it is not finite."""
    return float(value) if math.isfinite(value) else None


def known_rms(values: Any) -> float | None:
    """Return the root of the mean square; ``None`` where there is none."""
    return known(float((values**2).mean()) ** 0.5) if len(values) else None
