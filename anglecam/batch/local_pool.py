"""A worker pool on this machine: one measuring process for each job under way, each on one core."""

from __future__ import annotations

import contextlib
import queue
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from anglecam.batch.measuring_process import Abandoned, MeasuringProcess

Job = TypeVar("Job")
Done = TypeVar("Done")


class LocalPool(Generic[Job, Done]):
    """Threads, each with a measuring process; use it in a ``with`` block.

    Parameters
    ----------
    work : callable
        Does a job with a measuring process and returns the outcome; it raises nothing.
    size : int
        Number of jobs at a time.
    """

    def __init__(self, work: Callable[[Job, MeasuringProcess], Done], size: int) -> None:
        self._work = work
        self._jobs: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        self._done: queue.SimpleQueue[Done | Exception] = queue.SimpleQueue()
        self._processes = [MeasuringProcess() for _ in range(size)]

    def __enter__(self) -> LocalPool[Job, Done]:
        for process in self._processes:
            threading.Thread(target=self._serve, args=(process,), daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes:
            process.close()
            self._jobs.put(None)

    @property
    def capacity(self) -> int:
        """Number of jobs to have under way so that no worker waits for its next job."""
        return 2 * len(self._processes)

    def start(self, job: Job) -> None:
        """Queue a job for the next free worker."""
        self._jobs.put(job)

    def next_done(self) -> Done:
        """Wait for the next job to finish and return its outcome."""
        done = self._done.get()
        if isinstance(done, Exception):
            raise done
        return done

    def _serve(self, process: MeasuringProcess) -> None:
        with contextlib.suppress(Abandoned):
            while (job := self._jobs.get()) is not None:
                try:
                    self._done.put(self._work(job, process))
                except Exception as fault:  # noqa: BLE001  (raised again by next_done)
                    self._done.put(fault)
