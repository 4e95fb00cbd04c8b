"""Measuring processes that several batches share, for tests in which processes do not matter.

Starting a measuring process takes as long as measuring several tiny clips, and `anglecam.batch.child` keeps nothing
between requests. test_kill.py, test_trouble.py and test_dask.py test how processes start, die and are replaced, so they
do not share processes; neither do tests that call the command line.
"""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from typing import Any, ClassVar

import pytest

from anglecam.batch.measuring_process import MeasuringProcess


class SharedProcess(MeasuringProcess):
    """A measuring process that the next batch takes over, unless it is busy when its batch ends."""

    idle: ClassVar[list[subprocess.Popen[bytes]]] = []

    def __init__(self) -> None:
        super().__init__()
        self._busy = False

    def ask(self, request: dict[str, Any], time_limit: float) -> dict[str, Any]:
        if self._process is None and self.idle:
            self._process = self.idle.pop()
        self._busy = True
        answer = super().ask(request, time_limit)
        self._busy = False
        return answer

    def close(self) -> None:
        if self._process is not None and not self._busy:
            self.idle.append(self._process)
            self._process = None
        super().close()


@pytest.fixture(scope="module")
def shared_processes() -> Iterator[None]:
    """Let the batches of a test file that run in the test's process share their measuring processes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("anglecam.batch.local_pool.MeasuringProcess", SharedProcess)
        yield
    while SharedProcess.idle:
        process = SharedProcess.idle.pop()
        process.kill()
        process.communicate()
