"""One batch from beginning to end: find the clips, give out the jobs, publish their results, write the index.

Clips are given out in the order of their addresses. A session is given out as soon as all its clips are done. The same
loop drives a worker pool on this machine and one of Dask workers. It holds rows, never a series.
"""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Protocol

from anglecam.batch.address import is_of_one_process, parent
from anglecam.batch.clip_job import ClipJob, run_clip_job
from anglecam.batch.database import RecordDatabase
from anglecam.batch.local_pool import LocalPool
from anglecam.batch.lock import locked, start_run
from anglecam.batch.measuring_process import Measurer, MeasuringProcess
from anglecam.batch.output_folder import OutputFolder
from anglecam.batch.plan import Plan, out_of_reach, plan_jobs
from anglecam.batch.progress import Log, ProgressDisplay, open_log, show_progress
from anglecam.batch.prune import Pruned, is_stale, prune
from anglecam.batch.publish import Finished, publish, recover
from anglecam.batch.records import ClipRecord, SessionRecord
from anglecam.batch.row import Row
from anglecam.batch.session_job import SessionJob, run_session_job
from anglecam.batch.sources import Search, Source, find_sources
from anglecam.batch.summary import Summary
from anglecam.batch.trouble import Trouble
from anglecam.batch.worker import Settings
from anglecam.errors import AnglecamError, RigError
from anglecam.io.rig import read_rig
from anglecam.terminal import make_folder

Job = ClipJob | SessionJob


@dataclass(frozen=True)
class Options:
    """The options of a call."""

    jobs: int
    """Number of clips at a time."""
    dask: str | None = None
    """Address of a Dask scheduler, or ``local``."""
    close: bool = False
    """Whether to close the loop for each session."""
    retry_failed: bool = False
    prune: bool = False
    """Whether to remove stale results at the end."""
    quiet: bool = False
    log: Path | None = None
    time_limit: float | None = None
    """Time limit for one clip, in s; ``None``: by the clip's size."""
    rig: Path | None = None
    """Rig file for all clips; ``None``: the rig file beside each clip."""


@dataclass(frozen=True)
class Result:
    """The outcome of a batch."""

    rows: tuple[Row, ...]
    """The rows of the index, in the order of their paths."""
    problems: tuple[AnglecamError, ...]
    """One for every clip and session that failed, and for everything else that could not be done."""
    pruned: tuple[Pruned, ...] = ()
    """Stale results that were removed."""


class WorkerPool(Protocol):
    """Workers that do jobs: see `LocalPool` and `anglecam.batch.dask_pool.DaskPool`."""

    @property
    def capacity(self) -> int:
        """Number of jobs to have under way so that no worker waits for its next job."""

    def start(self, job: Job) -> None:
        """Give a job to the workers."""

    def next_done(self) -> Finished:
        """Wait for the next job to finish and return its outcome."""


def run_batch(
    asked: Sequence[str], out: Path, options: Options, measurer: Callable[[], Measurer] = MeasuringProcess
) -> Result:
    """Measure every clip that has not been measured yet, fit the sessions among them, and write the index.

    Parameters
    ----------
    asked : sequence of str
        Folders, clips, globs, ``@list.txt``, each local or remote.
    out : Path
        The output folder.
    options : Options
        The options of the call.
    measurer : callable
        Makes what measures for one job at a time on this machine. Dask's workers have measuring processes.

    Returns
    -------
    Result
        Rows and problems.

    Raises
    ------
    RigError
        If nothing can be done: the call or the rig file for all clips is wrong, or another batch uses the folder.
    InputError
        If the Dask scheduler is lost.
    """
    if options.rig is not None:
        read_rig(options.rig)
    make_folder(out)
    folder = OutputFolder(out.resolve())
    pruned: list[Pruned] = []
    with show_progress(quiet=options.quiet) as display:
        sources, search, problems = find_sources(asked, folder.path)
        if options.dask is not None:
            _require_shared(sources)
        display.begin("reading the records of earlier batches")
        with (
            open_log(options.log) as log,
            locked(folder) as interrupted,
            RecordDatabase(folder.database_file) as database,
        ):
            # before anything is written: what cannot be read must not be replaced
            earlier = database.read_all(ClipRecord)
            if interrupted is not None:
                recover(interrupted, folder, database)
                earlier = database.read_all(ClipRecord)
            folder.clear_unfinished()
            run = start_run(folder)
            settings = Settings(
                out=str(folder.path),
                run=run,
                rig=None if options.rig is None else str(options.rig.resolve()),
                retry_failed=options.retry_failed,
                time_limit=options.time_limit,
            )
            plan = plan_jobs(sources, search, earlier, database.read_all(SessionRecord), close=options.close)
            with contextlib.suppress(OSError):  # such as a full disk
                database.save(*plan.removed)
            summary = Summary(folder, run, plan.earlier, plan.earlier_sessions, plan.sessions)
            display.begin_jobs(len(sources), len(plan.sessions))
            with _worker_pool(settings, options, measurer) as pool:
                try:
                    _do_jobs(plan, pool, partial(publish, folder=folder, database=database), summary, display, log)
                    if options.prune:
                        display.begin("removing stale results")
                        pruned = _prune(plan, search, folder, database, summary)
                finally:
                    display.begin("writing the index")
                    summary.write_index()
            folder.clear_unfinished()
    return Result(summary.rows(), (*problems, *out_of_reach(search, earlier), *summary.problems()), tuple(pruned))


def _prune(
    plan: Plan, search: Search, folder: OutputFolder, database: RecordDatabase, summary: Summary
) -> list[Pruned]:
    """Remove the stale results of the folders of this batch."""
    here = {job.address for job in plan.clips}
    clips = [r for r in database.read_all(ClipRecord) if r.address in here or search.has_reached(r.address)]
    folders = {parent(address) for address in here}
    sessions = database.read_all(SessionRecord)
    left = [r for r in sessions if r.address in folders and is_stale(r)]
    left += [r for r in sessions if r.address not in folders and search.has_reached(r.address) and r.in_place]
    try:
        pruned = prune([*filter(is_stale, clips), *left], folder, database)
    except OSError as problem:
        summary.add_trouble(Trouble("--prune", f"{problem.filename or folder.path} ({problem.strerror})"), "--prune")
        return []
    for one in pruned:
        summary.prune(one)
    return pruned


def _do_jobs(
    plan: Plan,
    pool: WorkerPool,
    put_in_place: Callable[[Finished], Finished],
    summary: Summary,
    display: ProgressDisplay,
    log: Log,
) -> None:
    """Give out all jobs, and publish and report the outcome of each, until trouble stops the batch."""
    waiting: deque[Job] = deque(plan.clips)
    session_of = {clip: job for job in plan.sessions for clip in job.clips}
    missing = {job.address: set(job.clips) for job in plan.sessions}
    under_way = 0
    while waiting or under_way:
        while waiting and under_way < pool.capacity:
            pool.start(waiting.popleft())
            under_way += 1
        finished = put_in_place(pool.next_done())
        under_way -= 1
        record, trouble = finished.record, finished.trouble
        if trouble is not None:
            summary.add_trouble(trouble, record.address)
        if isinstance(record, SessionRecord):
            summary.add_session(record)
            display.add_session(record, unchanged=finished.unchanged)
            log.add_session(record, unchanged=finished.unchanged)
            continue
        session = session_of.get(record.address)
        summary.add_clip(record, in_session=session is not None)
        display.add_clip(record, unchanged=finished.unchanged)
        log.add_clip(record, unchanged=finished.unchanged)
        if trouble is not None and trouble.stops:
            break
        if session is not None and trouble is None:  # a session is fitted when all its clips have been tried
            missing[session.address].discard(record.address)
            if not missing[session.address]:
                measured, stale = summary.measured(session.clips), summary.stale(session.clips)
                waiting.appendleft(replace(session, measured=measured, stale=stale))


def _worker_pool(
    settings: Settings, options: Options, measurer: Callable[[], Measurer]
) -> AbstractContextManager[WorkerPool]:
    work = partial(_run_job, settings=settings)
    if options.dask is None:
        return LocalPool(work, options.jobs, measurer)
    from anglecam.batch.dask_pool import DaskPool  # an optional dependency

    return DaskPool(work, options.dask, options.jobs, settings)


def _run_job(job: Job, measurer: Measurer, *, settings: Settings) -> Finished:
    if isinstance(job, SessionJob):
        return run_session_job(job, settings, measurer)
    return run_clip_job(job, settings, measurer)


def _require_shared(sources: Sequence[Source]) -> None:
    for source in sources:
        if is_of_one_process(source.address):
            raise RigError(f"{source.address}: Dask's workers cannot see what is in this process's memory")
