"""A batch from beginning to end: what is there, who does it, what became of it.

Clips are given out in order; a session is given out as soon as all its clips are done. The same loop drives a team on
this machine and one of Dask workers, and holds rows only, never a series.
"""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Protocol

from anglecam.batch.address import is_of_one_process, join, normalised, stem
from anglecam.batch.ledger import Ledger
from anglecam.batch.lock import locked
from anglecam.batch.output_paths import clip_places, session_places
from anglecam.batch.process import MeasuringProcess
from anglecam.batch.progress import Log, Watch, log_to, watch
from anglecam.batch.records import Note, SessionNote, Store
from anglecam.batch.row import Row
from anglecam.batch.sessions import SessionJob, do_session, find_sessions
from anglecam.batch.sources import Source, find_sources
from anglecam.batch.work import ClipJob, Settings, do_clip
from anglecam.batch.worker_pool import LocalTeam
from anglecam.errors import AnglecamError, RigError
from anglecam.io.rig import read_rig
from anglecam.io.session import CORRECTED
from anglecam.terminal import make_folder

Job = ClipJob | SessionJob
Done = Note | SessionNote


@dataclass(frozen=True)
class Options:
    """What a call asks for."""

    jobs: int
    """How many clips at a time."""
    dask: str | None = None
    """A scheduler's address, or ``local``."""
    close: bool = False
    retry_failed: bool = False
    quiet: bool = False
    log: Path | None = None
    time_limit: float | None = None
    """Seconds a clip; ``None``: by its size."""
    rig: Path | None = None


@dataclass(frozen=True)
class Result:
    """What became of a batch."""

    rows: tuple[Row, ...]
    """As in the index, in the order of their paths."""
    problems: tuple[AnglecamError, ...]
    """One for every clip and session that failed, and for whatever else could not be done."""


class Team(Protocol):
    """Whoever does the jobs."""

    @property
    def room(self) -> int:
        """How many jobs to have under way."""

    def start(self, job: Job) -> None:
        """Give out a job."""

    def next_done(self) -> Done:
        """Wait for the next job that is done."""


def run_batch(asked: Sequence[str], out: Path, options: Options) -> Result:
    """Measure every clip that is asked for and not done yet, identify its sessions, and write the index.

    Parameters
    ----------
    asked : sequence of str
        Folders, clips, globs, ``@list.txt``, each local or remote.
    out : Path
        The output folder.
    options : Options
        How.

    Returns
    -------
    Result
        Rows and problems.

    Raises
    ------
    RigError
        Where nothing can be done: the call or the rig file for all is wrong, or another batch is at work there.
    """
    if options.rig is not None:
        read_rig(options.rig)
    make_folder(out)
    out = out.resolve()
    sources, problems = find_sources(asked, out)
    if options.dask is not None:
        _require_shared(sources)
    with log_to(options.log) as log, locked(Store(out).lock) as run:
        Store(out).clear()
        settings = Settings(
            out=str(out),
            run=run,
            rig=None if options.rig is None else str(options.rig.resolve()),
            retry_failed=options.retry_failed,
            time_limit=options.time_limit,
        )
        plan = _plan(sources, asked, Store(out), options)
        for note in plan.gone:
            with contextlib.suppress(OSError):  # a disk that is full
                Store(out).renew(replace(note, gone=True), run)
        ledger = Ledger(settings, plan.earlier, plan.sessions)
        with _team(settings, options) as team, watch(len(sources), len(plan.sessions), quiet=options.quiet) as shown:
            try:
                _work(plan, team, ledger, shown, log)
            finally:
                ledger.write_index()
        Store(out).clear()
    return Result(ledger.rows(), (*problems, *ledger.problems()))


@dataclass(frozen=True)
class Plan:
    """What there is to do."""

    clips: tuple[ClipJob, ...]
    sessions: tuple[SessionJob, ...]
    earlier: tuple[Note, ...]
    """What earlier calls did, here and in other folders."""
    gone: tuple[Note, ...]
    """Of clips that a folder of this call holds no longer."""


def _plan(sources: Sequence[Source], asked: Sequence[str], store: Store, options: Options) -> Plan:
    here = {source.address for source in sources}
    searched = tuple(join(normalised(one), "") for one in asked)
    notes = list(store.clips())
    lost = [n for n in notes if n.address not in here and n.address.startswith(searched)]
    elsewhere = [n for n in notes if n.address not in here and not n.address.startswith(searched)]
    earlier = (*(n for n in notes if n.address in here), *(n for n in elsewhere if not n.gone))
    found = find_sessions(sources)
    places = session_places([(folder, root) for folder, root, _ in found])
    sessions = tuple(SessionJob(folder, places[folder], clips, options.close) for folder, _, clips in found)
    in_session = {clip for job in sessions for clip in job.clips}
    taken = {note.place for note in elsewhere if note.row.series}
    for job in sessions:  # where the loop writes series that are free of what the camera did
        taken |= {"/".join(filter(None, (job.place, CORRECTED, stem(clip)))) for clip in job.clips}
    clip_place = clip_places(sources, taken)
    clips = tuple(ClipJob(s.address, clip_place[s.address], s.address in in_session) for s in sources)
    return Plan(clips, sessions, earlier, tuple(n for n in lost if not n.gone))


def _work(plan: Plan, team: Team, ledger: Ledger, shown: Watch, log: Log) -> None:
    """Give out jobs and take in what became of them until all are done."""
    waiting: deque[Job] = deque(plan.clips)
    session_of = {clip: job for job in plan.sessions for clip in job.clips}
    missing = {job.address: set(job.clips) for job in plan.sessions}
    under_way = 0
    while waiting or under_way:
        while waiting and under_way < team.room:
            team.start(waiting.popleft())
            under_way += 1
        done = team.next_done()
        under_way -= 1
        if isinstance(done, SessionNote):
            ledger.add_session(done)
            shown.session(done)
            log.session(done)
            continue
        session = session_of.get(done.address)
        ledger.add_clip(done, in_session=session is not None)
        shown.clip(done)
        log.clip(done)
        if session is not None:
            missing[session.address].discard(done.address)
            if not missing[session.address]:
                waiting.appendleft(session)


def _team(settings: Settings, options: Options) -> AbstractContextManager[Team]:
    work = partial(_do, settings=settings)
    if options.dask is None:
        return LocalTeam(work, options.jobs)
    from anglecam.batch.cluster import DaskTeam  # an extra

    return DaskTeam(work, options.dask, options.jobs)


def _do(job: Job, process: MeasuringProcess, *, settings: Settings) -> Done:
    if isinstance(job, SessionJob):
        return do_session(job, settings, process)
    return do_clip(job, settings, process)


def _require_shared(sources: Sequence[Source]) -> None:
    for source in sources:
        if is_of_one_process(source.address):
            raise RigError(f"{source.address}: Dask's workers cannot see what is in this process's memory")
