"""A process that measures for another: if it dies or takes too long, that costs what it was given and nothing else.

It is a program of its own, spoken to in lines of JSON through its own two pipes. Pools of `multiprocessing` share locks
among their workers, and a worker killed while it holds one stops them all; and Dask's workers may have no child of
`multiprocessing`. This serves both, and nothing is ever unpickled.
"""

from __future__ import annotations

import json
import os
import selectors
import signal
import subprocess
import sys
import time
from typing import Any

_SINGLE = ("OMP", "OPENBLAS", "MKL", "BLIS", "NUMBA")


class Lost(Exception):  # noqa: N818  (what happened, not an error of ours)
    """The process ended before it answered; the text says how."""


class Abandoned(BaseException):
    """The batch has been given up, and with it what the process was asked for."""


class MeasuringProcess:
    """A process that is started when it is first needed, and anew after it was lost."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._closed = False

    def ask(self, request: dict[str, Any], time_limit: float) -> dict[str, Any]:
        """Have something measured or fitted.

        Parameters
        ----------
        request : dict
            What `anglecam.batch.child` takes.
        time_limit : float
            Seconds until the process is ended.

        Returns
        -------
        dict
            Its answer.

        Raises
        ------
        Lost
            Where it died or took too long.
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
            raise Lost(self._ended()) from None
        with selectors.DefaultSelector() as ready:
            ready.register(process.stdout, selectors.EVENT_READ)
            if not ready.select(max(until - time.monotonic(), 0.0)):
                self._end()
                raise Lost(f"took longer than its time limit of {time_limit:g} s")
        line = process.stdout.readline()
        if not line.endswith(b"\n"):
            raise Lost(self._ended())
        answer: dict[str, Any] = json.loads(line)
        return answer

    def close(self) -> None:
        """End the process for good; whoever waits for an answer gets `Abandoned`."""
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
            self._end()  # it died while it had nothing to do
        if self._process is None:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "anglecam.batch.child"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,  # decoders complain there of what the index says once
                env=os.environ | {f"{library}_NUM_THREADS": "1" for library in _SINGLE},
            )
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
