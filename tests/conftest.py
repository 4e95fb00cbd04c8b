"""Lets every test say `from support.drawn import draw_session`, and gives every test process a single core."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from support.closed import ClosedSessions

sys.path.insert(0, str(Path(__file__).parent))
# before NumPy is loaded: there are as many test processes as cores, and libraries whose threads wait in a loop for a
# core that another process has are a thousand times slower
os.environ |= {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
os.environ["OPENCV_FOR_THREADS_NUM"] = "1"


@pytest.fixture(scope="session", autouse=True)
def _films_are_drawn_here() -> Iterator[None]:
    """Let `synth` see the one core that is ours, so that it starts no workers; those have tests of their own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("synth.render.workers", lambda: 1)
        yield


@pytest.fixture(scope="session")
def closed(tmp_path_factory: pytest.TempPathFactory) -> ClosedSessions:
    """Return what gives the verdicts on canonical sessions, each closed once by whichever test process needs it."""
    from support.closed import ClosedSessions  # loads what fits models, which most test files do not need

    folder = tmp_path_factory.getbasetemp()
    inside_worker = "PYTEST_XDIST_WORKER" in os.environ
    return ClosedSessions((folder.parent if inside_worker else folder) / "closed")
