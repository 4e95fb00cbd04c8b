"""Lets every test say `from support.drawn import draw_session`, and gives every test process a single core."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from support.films import Films

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
def films(tmp_path_factory: pytest.TempPathFactory) -> "Films":
    """Return the films that tests share, in a folder that the test processes of this run share."""
    from support.films import Films

    base = tmp_path_factory.getbasetemp()
    return Films((base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "films")
