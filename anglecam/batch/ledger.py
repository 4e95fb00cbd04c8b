"""What became of every clip and session so far, which is what the index says."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from anglecam.batch.address import parent
from anglecam.batch.index import write_index
from anglecam.batch.records import Note, SessionNote, Store
from anglecam.batch.row import FAILED, Row, cannot_write
from anglecam.batch.sessions import SessionJob
from anglecam.batch.work import Settings
from anglecam.errors import AnglecamError, InputError, RigError, printable

_INDEX_EVERY_S = 10.0
_INDEX_SHARE = 0.02
"""At most this share of the time is spent writing the index."""


class Ledger:
    """Rows and no series: what a batch keeps in memory does not grow with the length of clips.

    Parameters
    ----------
    settings : Settings
        What holds for the batch.
    earlier : sequence of Note
        What earlier calls did; it stands until it is done again.
    sessions : sequence of SessionJob
        Those of this call.
    """

    def __init__(self, settings: Settings, earlier: Sequence[Note], sessions: Sequence[SessionJob]) -> None:
        self._store = Store(Path(settings.out))
        self._unfinished = self._store.unfinished(settings.run)
        self._notes = {note.address: _light(note) for note in earlier}
        self._here: set[str] = set()
        self._sessions_here: set[str] = set()
        self._session_of = {note.address: parent(note.address) for note in earlier}
        self._session_of |= {clip: job.address for job in sessions for clip in job.clips}
        self._sessions: dict[str, SessionNote] = {}
        for address in set(self._session_of.values()):
            found = self._store.read_session(address)
            if found is not None:
                self._sessions[address] = found
        self._next = time.monotonic() + _INDEX_EVERY_S
        self._unwritten: str | None = None

    def add_clip(self, note: Note, *, in_session: bool) -> None:
        """Take in what became of a clip, and now and then write the index."""
        self._notes[note.address] = _light(note)
        self._here.add(note.address)
        if not in_session:
            self._session_of.pop(note.address, None)
        if time.monotonic() > self._next:
            began = time.monotonic()
            self.write_index()
            took = time.monotonic() - began
            self._next = time.monotonic() + max(_INDEX_EVERY_S, took / _INDEX_SHARE)

    def add_session(self, note: SessionNote) -> None:
        """Take in what became of a session."""
        self._sessions[note.address] = note
        self._sessions_here.add(note.address)

    def rows(self) -> tuple[Row, ...]:
        """Return the index's rows, in the order of their paths."""
        return tuple(sorted((self._row(note) for note in self._notes.values()), key=lambda row: row.path))

    def write_index(self) -> None:
        """Write the index; a disk that is full now may not be when it is written next."""
        try:
            write_index(self.rows(), self._store.out, self._unfinished)
            self._unwritten = None
        except OSError as problem:
            self._unwritten = cannot_write(problem)

    def problems(self) -> list[AnglecamError]:
        """Return what went wrong in this call, clips first, in the order of addresses."""
        found: list[AnglecamError] = []
        for address in sorted(self._here):
            note = self._notes[address]
            if note.row.cause is not None:
                found.append(_problem(note.row.path, note.row.cause, wrong=note.call_is_wrong))
        for address in sorted(self._sessions_here):
            session = self._sessions[address]
            found += [_problem(printable(address), problem, wrong=False) for problem in session.problems]
            if session.cause is not None:
                found.append(_problem(printable(address), session.cause, wrong=session.call_is_wrong))
        if self._unwritten is not None:
            found.append(InputError(f"{self._store.out / 'index.csv'}: {self._unwritten}"))
        return found

    def _row(self, note: Note) -> Row:
        session = self._sessions.get(self._session_of.get(note.address, ""))
        if session is None or note.row.status == FAILED:
            return note.row
        cause = note.row.cause or (None if session.cause is None else f"no model: {session.cause}")
        return replace(note.row, model=session.model, verdict=session.verdict, effects=session.effects, cause=cause)


def _light(note: Note) -> Note:
    """Keep of a note what rows and problems need."""
    return replace(note, files={}, stamp=None)


def _problem(what: str, cause: str, *, wrong: bool) -> AnglecamError:
    return (RigError if wrong else InputError)(f"{what}: {cause}")
