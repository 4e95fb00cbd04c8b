"""Jobs: measuring and closing in a process of their own, one at a time, with progress and cancel."""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
from dataclasses import dataclass, field, replace
from threading import Lock, Thread
from typing import Any

from anglecam.errors import InputError

_PATIENCE_S = 5.0
"""Time in which a cancelled process has to end by itself."""


@dataclass(frozen=True)
class JobState:
    """How far a job is."""

    id: int
    request: dict[str, Any]
    """What `anglecam.view.job_program` was asked for."""
    status: str = "running"
    """``running``, ``done``, ``failed`` or ``cancelled``."""
    what: str = "starting"
    """The clip or the stage that is worked on."""
    done: int = 0
    """Frames done."""
    total: int = 0
    """Frames in all; 0 where the number is not known."""
    result: dict[str, Any] = field(default_factory=dict)
    problem: str | None = None
    """One line on why it failed."""


class Jobs:
    """Starts, watches and ends the jobs of one server."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._states: dict[int, JobState] = {}
        self._process: subprocess.Popen[str] | None = None

    def start(self, request: dict[str, Any]) -> JobState:
        """Start a job.

        Parameters
        ----------
        request : dict
            As `anglecam.view.job_program` takes it.

        Returns
        -------
        JobState
            Of the new job.

        Raises
        ------
        InputError
            Where another one is running.
        """
        with self._lock:
            if any(state.status == "running" for state in self._states.values()):
                raise InputError("another job is running; wait for it or cancel it")
            process = subprocess.Popen(
                [sys.executable, "-P", "-m", "anglecam.view.job_program"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,  # decoders write messages there
                text=True,
                encoding="ascii",
            )
            state = JobState(len(self._states), request)
            self._states[state.id], self._process = state, process
        assert process.stdin is not None
        with contextlib.suppress(OSError):  # a process that cannot start is noticed by its end
            process.stdin.write(json.dumps(request) + "\n")
            process.stdin.flush()
        Thread(target=self._watch, args=(state.id, process), daemon=True).start()
        return state

    def state(self, job: int) -> JobState:
        """Return the state of a job; raise `InputError` where there is none of this number."""
        if job not in self._states:
            raise InputError(f"there is no job {job}")
        return self._states[job]

    @property
    def running(self) -> JobState | None:
        """The job that runs."""
        with self._lock:  # a job that starts meanwhile adds to the states
            return next((state for state in self._states.values() if state.status == "running"), None)

    def cancel(self, job: int) -> JobState:
        """End a job; files that it has finished stay, and unfinished ones are removed."""
        with self._lock:
            if self.state(job).status == "running":
                self._states[job] = replace(self._states[job], status="cancelled")
                self._end()
        return self._states[job]

    def close(self) -> None:
        """End whatever runs."""
        running = self.running
        if running is not None:
            self.cancel(running.id)

    def _end(self) -> None:
        if self._process is None:
            return
        self._process.terminate()
        try:
            self._process.wait(_PATIENCE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()

    def _watch(self, job: int, process: subprocess.Popen[str]) -> None:
        """Take the messages of a process until it ends."""
        assert process.stdout is not None
        for line in process.stdout:
            message = json.loads(line)
            if "result" in message:
                message |= {"status": "done"}
            elif "problem" in message:
                message |= {"status": "failed"}
            self._update(job, message)
        code = process.wait()
        if process.stdin is not None:
            with contextlib.suppress(OSError):
                process.stdin.close()
        self._update(job, {"status": "failed", "problem": f"the measuring process ended with status {code}"})

    def _update(self, job: int, message: dict[str, Any]) -> None:
        with self._lock:
            if self._states[job].status == "running":
                self._states[job] = replace(self._states[job], **message)
