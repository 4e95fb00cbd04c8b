"""A worker pool on this machine: one measurer, usually a process on one core, for each job under way."""

from __future__ import annotations

import contextlib
import queue
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from anglecam.batch.measuring_process import Abandoned, Measurer

Job = TypeVar("Job")
Done = TypeVar("Done")


class LocalPool(Generic[Job, Done]):
    """Threads, each with a measurer; use it in a ``with`` block.

    Parameters
    ----------
    work : callable
        Does a job with a measurer and returns the outcome; it raises nothing.
    size : int
        Number of jobs at a time.
    measurer : callable
        Makes the measurer of a thread.
    """

    def __init__(self, work: Callable[[Job, Measurer], Done], size: int, measurer: Callable[[], Measurer]) -> None:
        self._work = work
        self._jobs: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        self._done: queue.SimpleQueue[Done | Exception] = queue.SimpleQueue()
        self._measurers = [measurer() for _ in range(size)]

    def __enter__(self) -> LocalPool[Job, Done]:
        for measurer in self._measurers:
            threading.Thread(target=self._serve, args=(measurer,), daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        for measurer in self._measurers:
            measurer.close()
            self._jobs.put(None)

    @property
    def capacity(self) -> int:
        """Number of jobs to have under way so that no worker waits for its next job."""
        return 2 * len(self._measurers)

    def start(self, job: Job) -> None:
        """Queue a job for the next free worker."""
        self._jobs.put(job)

    def next_done(self) -> Done:
        """Wait for the next job to finish and return its outcome."""
        done = self._done.get()
        if isinstance(done, Exception):
            raise done
        return done

    def _serve(self, measurer: Measurer) -> None:
        with contextlib.suppress(Abandoned):
            while (job := self._jobs.get()) is not None:
                try:
                    self._done.put(self._work(job, measurer))
                except Exception as fault:  # noqa: BLE001  (raised again by next_done)
                    self._done.put(fault)
