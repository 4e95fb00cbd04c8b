"""A team of Dask workers, on this machine or many: the same jobs, done by the same function.

A worker does each job in a measuring process of its own, as here: what crashes a decoder does not cost the worker. A
job whose worker is lost is done by another.
"""

from __future__ import annotations

import logging
import re
import threading
from collections.abc import Callable
from concurrent.futures import CancelledError
from typing import Any, Generic, TypeVar

from anglecam.batch.process import MeasuringProcess
from anglecam.errors import InputError, RigError

try:
    import distributed
    from distributed.client import FutureCancelledError
    from distributed.comm import CommClosedError
except ImportError as missing:
    raise RigError("--dask: Dask is not installed; pip install 'anglecam[dask]'") from missing

Job = TypeVar("Job")
Done = TypeVar("Done")

_WAIT_S = 60.0
"""For the scheduler, and for a first worker."""

_idle: list[MeasuringProcess] = []
_lock = threading.Lock()


class DaskTeam(Generic[Job, Done]):
    """Jobs handed to a Dask scheduler; use it in a ``with`` block.

    Parameters
    ----------
    work : callable
        From a job and a process to what became of it; raises nothing; a function that workers can import.
    address : str
        The scheduler's, or ``local`` to start one with workers on this machine.
    size : int
        How many workers ``local`` starts.
    """

    def __init__(self, work: Callable[[Job, MeasuringProcess], Done], address: str, size: int) -> None:
        self._work = work
        self._address = address
        self._size = size

    def __enter__(self) -> DaskTeam[Job, Done]:
        if self._address != "local" and not re.search(r":\d+/?$", self._address):
            raise RigError(f"--dask {self._address}: neither local nor an address with a port, as tcp://HOST:8786")
        for logger in [name for name in logging.root.manager.loggerDict if name.startswith("distributed")]:
            logging.getLogger(logger).setLevel(logging.CRITICAL + 1)  # what is wrong is said here, in one line
        self._cluster = None
        try:
            if self._address == "local":
                self._cluster = distributed.LocalCluster(
                    n_workers=self._size, threads_per_worker=1, dashboard_address=None, silence_logs=50
                )
            self._client = distributed.Client(self._cluster or self._address, timeout=_WAIT_S, set_as_default=False)
            self._client.wait_for_workers(1, timeout=_WAIT_S)
        except (OSError, ValueError, TimeoutError) as problem:
            raise RigError(f"--dask {self._address}: no scheduler with a worker there ({_line(problem)})") from problem
        self._started: dict[Any, Job] = {}
        self._done = distributed.as_completed(loop=self._client.loop)
        return self

    def __exit__(self, *_: object) -> None:
        self._client.close()
        if self._cluster is not None:
            self._cluster.close()

    @property
    def room(self) -> int:
        """How many jobs to have under way, so that nobody waits for the next."""
        return 2 * max(1, sum(self._client.nthreads().values()))

    def start(self, job: Job) -> None:
        """Give a job to the scheduler."""
        future = self._client.submit(_do, self._work, job, pure=False)
        self._started[future.key] = job
        self._done.add(future)

    def next_done(self) -> Done:
        """Wait for the next job that is done.

        Raises
        ------
        InputError
            Where the scheduler is gone.
        """
        while True:
            future = next(self._done)
            job = self._started.pop(future.key)
            try:
                done: Done = future.result()
            except distributed.scheduler.KilledWorker:
                self.start(job)  # several workers were lost over it; no job can end a worker, so it is not to blame
                continue
            except (CancelledError, FutureCancelledError, CommClosedError) as fault:
                raise InputError(
                    f"--dask {self._address}: the scheduler is gone ({_line(fault)}); the same call goes on from here"
                ) from fault
            return done


def _do(work: Callable[[Job, MeasuringProcess], Done], job: Job) -> Done:
    """Do a job on a worker, with a process that is kept for the next."""
    with _lock:
        process = _idle.pop() if _idle else MeasuringProcess()
    try:
        return work(job, process)
    finally:
        with _lock:
            _idle.append(process)


def _line(problem: BaseException) -> str:
    return (str(problem).strip() or type(problem).__name__).splitlines()[0]
