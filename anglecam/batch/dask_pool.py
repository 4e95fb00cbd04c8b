"""A worker pool of Dask workers, on this machine or several: they do the same jobs with the same function.

Like a worker on this machine, a Dask worker measures in a separate process, so that a decoder that crashes does not end
the worker. A job whose worker is lost is done by another worker. Only workers that `anglecam.batch.dask_door` admits
get jobs.
"""

from __future__ import annotations

import contextlib
import logging
import re
import threading
import time
from collections.abc import Callable
from concurrent.futures import CancelledError
from typing import Any, Generic, TypeVar

from anglecam.batch.measuring_process import MeasuringProcess
from anglecam.batch.worker import Settings
from anglecam.errors import InputError, RigError
from anglecam.terminal import errors

try:
    import distributed
    from distributed.client import FutureCancelledError
    from distributed.comm import CommClosedError

    from anglecam.batch.dask_door import door, name_of, refused
except ImportError as missing:
    raise RigError("--dask: Dask is not installed; pip install 'anglecam[dask]'") from missing

Job = TypeVar("Job")
Done = TypeVar("Done")

_WAIT_S = 60.0
"""Time limit for reaching the scheduler, for its first worker, and then for the first that is admitted, in s."""
_ASK_AGAIN_S = 0.5

_idle: list[MeasuringProcess] = []
_lock = threading.Lock()


class DaskPool(Generic[Job, Done]):
    """Jobs submitted to a Dask scheduler; use it in a ``with`` block.

    Parameters
    ----------
    work : callable
        Does a job with a measuring process and returns the outcome; it raises nothing, and workers can import it.
    address : str
        The scheduler's address, or ``local`` to start a scheduler and workers on this machine.
    size : int
        Number of workers that ``local`` starts.
    settings : Settings
        The settings of the batch, by which workers are admitted.
    """

    def __init__(
        self, work: Callable[[Job, MeasuringProcess], Done], address: str, size: int, settings: Settings
    ) -> None:
        self._work = work
        self._settings = settings
        self._resource = name_of(settings)
        self._address = address
        self._size = size

    def __enter__(self) -> DaskPool[Job, Done]:
        if self._address != "local" and not re.search(r":\d+/?$", self._address):
            raise RigError(f"--dask {self._address}: neither local nor an address with a port, as tcp://HOST:8786")
        for logger in [name for name in logging.root.manager.loggerDict if name.startswith("distributed")]:
            logging.getLogger(logger).setLevel(logging.CRITICAL + 1)  # failures are reported here, in one line
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
        try:
            self._open_door()
        except BaseException:
            self.__exit__()
            raise
        self._started: dict[Any, Job] = {}
        self._done = distributed.as_completed(loop=self._client.loop)
        return self

    def _open_door(self) -> None:
        """Admit workers, now and whenever one joins; wait for the first, and report each that is refused.

        Raises
        ------
        RigError
            If none is admitted in time.
        """
        self._client.register_plugin(door(self._settings), name=self._resource)
        reported = self._report_refused(frozenset())
        if not self._admitted():
            errors.print(f"--dask {self._address}: waiting up to {_WAIT_S:g} s for another worker")
        until = time.monotonic() + _WAIT_S
        while not self._admitted():
            if time.monotonic() > until:
                raise RigError(f"--dask {self._address}: no worker there can do the jobs of this batch")
            time.sleep(_ASK_AGAIN_S)
            reported = self._report_refused(reported)

    def _report_refused(self, reported: frozenset[str]) -> frozenset[str]:
        """Report the workers that are refused, each once; return all lines reported so far."""
        lines = refused(self._client, self._settings)
        for line in lines:
            if line not in reported:
                errors.print(f"--dask {self._address}: {line}")
        return reported | frozenset(lines)

    def _admitted(self) -> int:
        """Return the number of threads of the workers that get jobs."""
        assert self._client.scheduler is not None
        workers = self._client.sync(self._client.scheduler.identity)["workers"].values()
        return sum(worker["nthreads"] for worker in workers if self._resource in worker["resources"])

    def __exit__(self, *_: object) -> None:
        if self._client.status == "running":  # a call to a lost scheduler would wait for it for a minute
            with contextlib.suppress(Exception):
                self._client.unregister_worker_plugin(self._resource)
        self._client.close()
        if self._cluster is not None:
            self._cluster.close()

    @property
    def capacity(self) -> int:
        """Number of jobs to have under way so that no worker waits for its next job.

        Raises
        ------
        InputError
            If the scheduler is lost.
        """
        try:
            return 2 * max(1, self._admitted())
        except (OSError, CommClosedError) as fault:
            raise self._lost(fault) from fault

    def start(self, job: Job) -> None:
        """Submit a job to the scheduler."""
        future = self._client.submit(_do, self._work, job, pure=False, resources={self._resource: 1})
        self._started[future.key] = job
        self._done.add(future)

    def next_done(self) -> Done:
        """Wait for the next job to finish and return its outcome.

        Raises
        ------
        InputError
            If the scheduler is lost.
        """
        while True:
            future = next(self._done)
            job = self._started.pop(future.key)
            try:
                done: Done = future.result()
            except distributed.scheduler.KilledWorker:
                # several workers were lost with it; a job cannot end its worker, so the cause lies elsewhere
                self.start(job)
                continue
            except (CancelledError, FutureCancelledError, CommClosedError) as fault:
                raise self._lost(fault) from fault
            return done

    def _lost(self, fault: BaseException) -> InputError:
        return InputError(
            f"--dask {self._address}: the scheduler is lost ({_line(fault)}); the same call goes on from here"
        )


def _do(work: Callable[[Job, MeasuringProcess], Done], job: Job) -> Done:
    """Do a job on a Dask worker, with a measuring process that is kept for the next job."""
    with _lock:
        process = _idle.pop() if _idle else MeasuringProcess()
    try:
        return work(job, process)
    finally:
        with _lock:
            _idle.append(process)


def _line(problem: BaseException) -> str:
    return (str(problem).strip() or type(problem).__name__).splitlines()[0]
