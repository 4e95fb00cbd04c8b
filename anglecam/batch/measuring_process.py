"""A separate process that measures for a worker: if it crashes or takes too long, only its current job fails.

It is a separate program that exchanges lines of JSON over its standard input and output. `multiprocessing` would not
do: its pools share locks among their workers, so that a worker killed while it holds a lock stops all others. Also,
Dask's workers may not start `multiprocessing` children. Nothing is unpickled.
"""

from __future__ import annotations

import json
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from typing import IO, Any, Protocol

from anglecam import end_with_parent
from anglecam.prepare import prepare_kernels
from anglecam.threads import ONE_THREAD

_STARTER = ThreadPoolExecutor(1, thread_name_prefix="starter")
"""The thread that starts all measuring processes. Linux ends a process with the thread that started it, and this
thread lasts as long as the program; see `anglecam.end_with_parent`.
"""


class ProcessLost(Exception):  # noqa: N818  (an event, not a fault of this program)
    """The process ended before it answered; the message says how."""


class Abandoned(BaseException):
    """The batch has ended, and the process with it."""


class Measurer(Protocol):
    """What does the measuring and fitting for one job at a time; see `MeasuringProcess`."""

    def ask(self, request: dict[str, Any], time_limit: float) -> dict[str, Any]:
        """Have a clip measured or a session fitted, within a time limit in s."""

    def close(self) -> None:
        """End it for good; a thread that waits for its answer gets `Abandoned`."""


class MeasuringProcess:
    """A process that is started when it is first needed, and again after it was lost."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._closed = False

    def ask(self, request: dict[str, Any], time_limit: float) -> dict[str, Any]:
        """Have a clip measured or a session fitted.

        Parameters
        ----------
        request : dict
            As `anglecam.batch.serve` expects it.
        time_limit : float
            Time after which the process is ended, in s.

        Returns
        -------
        dict
            The process's answer.

        Raises
        ------
        ProcessLost
            If the process died or took too long.
        Abandoned
            After `close`.
        """
        process = self._running()
        assert process.stdin is not None
        assert process.stdout is not None
        until = time.monotonic() + time_limit
        try:
            process.stdin.write(json.dumps(request | {"time_limit": time_limit}).encode() + b"\n")
            process.stdin.flush()
        except OSError:
            raise ProcessLost(self._ended()) from None
        try:
            line = _next_line(process.stdout, max(until - time.monotonic(), 0.0))
        except queue.Empty:
            self._end()
            raise ProcessLost(f"took longer than its time limit of {time_limit:g} s") from None
        if not line.endswith(b"\n"):
            raise ProcessLost(self._ended())
        answer: dict[str, Any] = json.loads(line)
        return answer

    def close(self) -> None:
        """End the process for good; a thread that waits for its answer gets `Abandoned`."""
        self._closed = True
        process = self._process
        if process is not None:
            process.kill()

    def _end(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None

    def _running(self) -> subprocess.Popen[bytes]:
        if self._closed:
            raise Abandoned
        if self._process is not None and self._process.poll() is not None:
            self._end()  # it died between two requests
        if self._process is None:
            self._process = _STARTER.submit(_start).result()
            if self._closed:  # meanwhile
                self._process.kill()
        return self._process

    def _ended(self) -> str:
        assert self._process is not None
        try:
            code = self._process.wait(10.0)
        except subprocess.TimeoutExpired:
            code = 0
        self._end()
        if self._closed:
            raise Abandoned
        if code >= 0:
            return f"the process that measured it ended with status {code}"
        return f"the process that measured it died of signal {-code} ({signal.Signals(-code).name})"


def _next_line(stream: IO[bytes], patience_s: float) -> bytes:
    """Return the next line; raise `queue.Empty` if it takes too long. A thread waits: Windows cannot poll a pipe."""
    lines: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=lambda: lines.put(stream.readline()), daemon=True).start()
    return lines.get(timeout=patience_s)


def _start() -> subprocess.Popen[bytes]:
    prepare_kernels("anglecam")  # on a Dask worker of another machine, nobody has done it yet
    return subprocess.Popen(
        [sys.executable, "-P", end_with_parent.__file__, str(os.getpid()), "anglecam.batch.serve"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,  # decoders write messages there that the index reports once
        env=os.environ | ONE_THREAD,
    )
