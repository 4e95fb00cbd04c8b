"""Measuring processes that outlive a batch, for tests that are about something else.

A measuring process takes as long to start as it takes to measure several tiny clips, and it remembers nothing of them:
`anglecam.batch.child` answers one request after another. How processes start, die and are replaced is the matter of
test_kill.py, test_trouble.py and test_dask.py, which have none of this, and of all tests that call the command line.
"""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from typing import Any, ClassVar

import pytest

from anglecam.batch.process import MeasuringProcess


class KeptProcess(MeasuringProcess):
    """A measuring process that is handed on when its batch is at its end, unless it is in the middle of something."""

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
def kept_processes() -> Iterator[None]:
    """Let the batches of this file that run in the tests' own process hand on their measuring processes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("anglecam.batch.worker_pool.MeasuringProcess", KeptProcess)
        yield
    while KeptProcess.idle:
        process = KeptProcess.idle.pop()
        process.kill()
        process.communicate()
