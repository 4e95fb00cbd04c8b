"""Lets every test say `from support.drawn import draw_session`, and gives every test process a single core."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from anglecam.prepare import prepare_kernels

if TYPE_CHECKING:
    from support.closed import ClosedSessions
    from support.films import Films

sys.path.insert(0, str(Path(__file__).parent))
# before NumPy is loaded: there are as many test processes as cores, and libraries whose threads wait in a loop for a
# core that another process has are a thousand times slower
os.environ |= {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
os.environ["OPENCV_FOR_THREADS_NUM"] = "1"


def pytest_configure(config: pytest.Config) -> None:
    """Have the kernels compiled before pytest-xdist starts the test processes."""
    if not hasattr(config, "workerinput"):
        for package in ("anglecam", "synth"):
            prepare_kernels(package)


@pytest.fixture(scope="session", autouse=True)
def _films_are_drawn_here() -> Iterator[None]:
    """Let `synth` see the one core that is ours, so that it starts no workers; those have tests of their own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("synth.render.workers", lambda: 1)
        yield


@pytest.fixture(scope="session")
def shared_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return pytest's temporary folder of this run, which all its test processes share."""
    base = tmp_path_factory.getbasetemp()
    return base.parent if "PYTEST_XDIST_WORKER" in os.environ else base


# what fits models or measures films takes a second to load, and most test files need neither


@pytest.fixture(scope="session")
def closed(shared_folder: Path) -> ClosedSessions:
    """Return what gives the verdicts on canonical sessions, each closed once by whichever test process needs it."""
    from support.closed import ClosedSessions

    return ClosedSessions(shared_folder / "closed")


@pytest.fixture(scope="session")
def films(shared_folder: Path) -> Films:
    """Return the films that tests share, each drawn and measured once by whichever test process needs it."""
    from support.films import Films

    return Films(shared_folder / "films")
