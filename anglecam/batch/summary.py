"""The outcome of a batch so far: the rows of the index, and the problems to report."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import replace

from anglecam.batch.address import name, parent
from anglecam.batch.output_folder import OutputFolder
from anglecam.batch.prune import Pruned
from anglecam.batch.records import ClipRecord, SessionRecord
from anglecam.batch.row import FAILED, STALE, Row
from anglecam.batch.session_job import SessionJob
from anglecam.batch.trouble import Trouble, as_problems
from anglecam.errors import AnglecamError, InputError, RigError, printable

_INDEX_EVERY_S = 10.0
_INDEX_SHARE = 0.02
"""Maximum share of the time that is spent on writing the index."""


class Summary:
    """Records without files and series, so that memory does not grow with the length of clips.

    It also holds what the database does not: failures to write, which the index and the user must see.

    Parameters
    ----------
    folder : OutputFolder
        The output folder.
    run : str
        The run that writes the index.
    clips : sequence of ClipRecord
        Records by earlier batches. Each holds until `add_clip` replaces it.
    sessions : iterable of SessionRecord
        Records by earlier batches. Each holds until `add_session` replaces it.
    jobs : sequence of SessionJob
        The sessions of this batch.
    """

    def __init__(
        self,
        folder: OutputFolder,
        run: str,
        clips: Sequence[ClipRecord],
        sessions: Iterable[SessionRecord],
        jobs: Sequence[SessionJob],
    ) -> None:
        self._folder, self._run = folder, run
        self._clips = {record.address: _light(record) for record in clips}
        self._sessions = {record.address: record for record in sessions}
        self._session_of = {record.address: parent(record.address) for record in clips}
        self._session_of |= {clip: job.address for job in jobs for clip in job.clips}
        self._clips_here: set[str] = set()
        self._sessions_here: set[str] = set()
        self._next = time.monotonic() + _INDEX_EVERY_S
        self._index_problem: str | None = None
        self._troubles: list[Trouble] = []
        self._untried: set[str] = set()

    def add_trouble(self, trouble: Trouble, address: str) -> None:
        """Add why the job of a clip or session was not done."""
        self._troubles.append(trouble)
        self._untried.add(address)

    def add_clip(self, record: ClipRecord, *, in_session: bool) -> None:
        """Add the outcome of a clip of this batch, and write the index if it is due."""
        self._clips[record.address] = _light(record)
        self._clips_here.add(record.address)
        if not in_session:
            self._session_of.pop(record.address, None)
        if time.monotonic() > self._next:
            began = time.monotonic()
            self.write_index()
            took = time.monotonic() - began
            self._next = time.monotonic() + max(_INDEX_EVERY_S, took / _INDEX_SHARE)

    def add_session(self, record: SessionRecord) -> None:
        """Add the outcome of a session of this batch."""
        self._sessions[record.address] = record
        self._sessions_here.add(record.address)

    def prune(self, pruned: Pruned) -> None:
        """Leave out the results that were removed."""
        address, left = pruned.record.address, pruned.left
        if isinstance(left, ClipRecord):
            self._clips[address] = _light(left)
        elif isinstance(left, SessionRecord):
            self._sessions[address] = left
        elif isinstance(pruned.record, ClipRecord):
            del self._clips[address]
        else:
            del self._sessions[address]

    def stale(self, clips: Iterable[str]) -> tuple[str, ...]:
        """Return the names of those of these clips whose results are stale."""
        return tuple(name(clip) for clip in clips if self._clips[clip].shown.status == STALE)

    def measured(self, clips: Iterable[str]) -> tuple[ClipRecord, ...]:
        """Return the records, without files, of those of these clips that have been measured."""
        return tuple(record for record in map(self._clips.__getitem__, clips) if not record.has_failed)

    def rows(self) -> tuple[Row, ...]:
        """Return the rows of the index, in the order of their paths."""
        return tuple(sorted((self._row(record) for record in self._clips.values()), key=lambda row: row.path))

    def write_index(self) -> None:
        """Write the index. A failure is kept and reported at the end, unless a later attempt succeeds."""
        from anglecam.batch.index import write_index  # pyarrow takes longer to load than a wrong call may

        try:
            write_index(self.rows(), self._folder, self._run)
            self._index_problem = None
        except OSError as problem:
            self._index_problem = f"the index cannot be written ({problem.strerror or problem})"

    def problems(self) -> list[AnglecamError]:
        """Return the problems: of the batch, of clips, sessions and the index, each in the order of addresses."""
        found = as_problems(self._troubles)
        for address in sorted(self._clips_here - self._untried):
            record = self._clips[address]
            if record.shown.cause is not None:
                found.append(_problem(record.row.path, record.shown.cause, call_is_wrong=record.call_is_wrong))
        for address in sorted(self._sessions_here - self._untried):
            session = self._sessions[address]
            found += [_problem(printable(address), problem, call_is_wrong=False) for problem in session.problems]
            if session.shown_cause is not None:
                found.append(_problem(printable(address), session.shown_cause, call_is_wrong=session.call_is_wrong))
        if self._index_problem is not None and not any(trouble.stops for trouble in self._troubles):
            found.append(InputError(f"{self._folder.path / 'index.csv'}: {self._index_problem}"))
        return found

    def _row(self, record: ClipRecord) -> Row:
        """Return a clip's row, with the outcome of its session."""
        row = record.shown
        session = self._sessions.get(self._session_of.get(record.address, ""))
        if session is None or row.status == FAILED:
            return row
        cause = row.cause
        if cause is None and session.shown_cause is not None:
            cause = f"{'no model' if session.in_place is None else 'the model is stale'}: {session.shown_cause}"
        found = session.in_place or session
        return replace(row, model=found.model, verdict=found.verdict, effects=found.effects, cause=cause)


def _light(record: ClipRecord) -> ClipRecord:
    """Return a record without what neither rows nor problems need."""
    kept = None if record.kept is None else replace(record.kept, files={}, stamp=None)
    return replace(record, files={}, stamp=None, kept=kept)


def _problem(what: str, cause: str, *, call_is_wrong: bool) -> AnglecamError:
    return (RigError if call_is_wrong else InputError)(f"{what}: {cause}")
