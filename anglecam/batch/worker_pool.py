"""A team on this machine: as many measuring processes as there are jobs at a time, each on one core."""

from __future__ import annotations

import contextlib
import queue
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from anglecam.batch.process import Abandoned, MeasuringProcess

Job = TypeVar("Job")
Done = TypeVar("Done")


class LocalTeam(Generic[Job, Done]):
    """Threads that hand jobs to a process each; use it in a ``with`` block.

    Parameters
    ----------
    work : callable
        From a job and a process to what became of it; raises nothing.
    size : int
        How many jobs at a time.
    """

    def __init__(self, work: Callable[[Job, MeasuringProcess], Done], size: int) -> None:
        self._work = work
        self._jobs: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        self._done: queue.SimpleQueue[Done | Exception] = queue.SimpleQueue()
        self._processes = [MeasuringProcess() for _ in range(size)]

    def __enter__(self) -> LocalTeam[Job, Done]:
        for process in self._processes:
            threading.Thread(target=self._serve, args=(process,), daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes:
            process.close()
            self._jobs.put(None)

    @property
    def room(self) -> int:
        """How many jobs to have under way, so that nobody waits for the next."""
        return 2 * len(self._processes)

    def start(self, job: Job) -> None:
        """Give a job to whoever is free next."""
        self._jobs.put(job)

    def next_done(self) -> Done:
        """Wait for the next job that is done."""
        done = self._done.get()
        if isinstance(done, Exception):
            raise done
        return done

    def _serve(self, process: MeasuringProcess) -> None:
        with contextlib.suppress(Abandoned):
            while (job := self._jobs.get()) is not None:
                try:
                    self._done.put(self._work(job, process))
                except Exception as fault:  # noqa: BLE001  (raised again where the batch waits)
                    self._done.put(fault)
