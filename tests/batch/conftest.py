"""Measuring processes that several batches share, for tests in which processes do not matter.

Starting a measuring process takes as long as measuring several tiny clips, and `anglecam.batch.serve` keeps nothing
between requests. Only batches in the test's process share; batches that are processes, and Dask's workers, start
measuring processes as a user's do. Tests of how the processes of a batch in the test's process start, die and are
replaced do not ask for `shared_processes`.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from typing import Any, ClassVar

import pytest

from anglecam.batch.measuring_process import MeasuringProcess
from anglecam.cli.app import main


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


@pytest.fixture(scope="session")
def _idle_processes() -> Iterator[None]:
    """End the measuring processes after the last test."""
    yield
    while SharedProcess.idle:
        process = SharedProcess.idle.pop()
        process.kill()
        process.communicate()


@pytest.fixture(scope="module")
def shared_processes(_idle_processes: None) -> Iterator[None]:
    """Let the batches of a test file that run in the test's process share their measuring processes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("anglecam.batch.local_pool.MeasuringProcess", SharedProcess)
        yield


@pytest.fixture
def batch_here(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Return what runs the command in the test's process: its exit status and what it prints."""

    def call(*arguments: object) -> subprocess.CompletedProcess[str]:
        monkeypatch.setattr(sys, "argv", ["anglecam", "batch", *map(str, arguments)])
        capfd.readouterr()
        with pytest.raises(SystemExit) as ended:
            main()
        said, errors = capfd.readouterr()
        code = ended.value.code
        assert code is None or isinstance(code, int)
        return subprocess.CompletedProcess(sys.argv, code or 0, said, errors)

    return call
