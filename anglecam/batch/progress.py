"""How far a batch is: a bar on a terminal, a plain line now and then elsewhere, and lines of JSON for programs."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from anglecam.batch.records import Note, SessionNote
from anglecam.batch.row import FAILED, OK
from anglecam.errors import RigError
from anglecam.terminal import errors

_FEW = 20
"""Clips of which each is worth a line."""
_EVERY_S = 10.0


class Watch:
    """Tells on standard error how many clips are done, at what rate, how many failed, and how long it will take."""

    def __init__(self, clips: int, sessions: int, bars: Progress, *, quiet: bool) -> None:
        self._clips = clips
        self._bars = bars
        self._plain = not quiet and not errors.is_terminal
        self._done = self._failed = self._fresh = 0
        self._began = self._told = time.monotonic()
        self._bar = bars.add_task("clips", total=clips, said="")
        self._sessions = bars.add_task("sessions", total=sessions, visible=sessions > 0, said="")

    def clip(self, note: Note) -> None:
        """Count a clip."""
        self._done += 1
        self._failed += note.row.status == FAILED
        self._fresh += not note.unchanged
        elapsed = time.monotonic() - self._began
        rate = self._done / elapsed if elapsed > 0.0 else 0.0
        said = f"{rate:.3g}/s, {self._failed} failed"
        self._bars.update(self._bar, advance=1, said=said)
        if not self._plain:
            return
        if self._clips <= _FEW:
            errors.print(f"{self._done} of {self._clips}: {note.row.path}: {_became(note)}")
        elif time.monotonic() - self._told > _EVERY_S or self._done == self._clips:
            self._told = time.monotonic()
            left = (self._clips - self._done) / rate
            errors.print(f"{self._done} of {self._clips} clips, {said}, {left:.0f} s left")

    def session(self, note: SessionNote) -> None:
        """Count a session."""
        self._bars.update(self._sessions, advance=1, said="")
        if self._plain and self._clips <= _FEW:
            errors.print(f"session {note.address}: {_concluded(note)}")


def _concluded(note: SessionNote) -> str:
    if note.cause:
        return "failed"
    told = f"{note.verdict or 'identified'}{f' to {note.effects}' if note.effects else ''}"
    return f"{told}, as before" if note.unchanged else told


@contextmanager
def watch(clips: int, sessions: int, *, quiet: bool) -> Iterator[Watch]:
    """Show progress while the block runs.

    Parameters
    ----------
    clips, sessions : int
        How many there are.
    quiet : bool
        Show none.

    Yields
    ------
    Watch
        To be told what is done.
    """
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[said]}"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=errors, disable=quiet or not errors.is_terminal) as bars:
        yield Watch(clips, sessions, bars, quiet=quiet)


class Log:
    """A file to which a line of JSON is added for every clip and session."""

    def __init__(self, stream: IO[str] | None) -> None:
        self._stream = stream

    def clip(self, note: Note) -> None:
        """Tell what became of a clip."""
        self._write({"clip": note.row.path, "status": note.row.status}, note, note.row.cause, note.row.wall_time_s)

    def session(self, note: SessionNote) -> None:
        """Tell what became of a session."""
        status = FAILED if note.cause else OK
        self._write({"session": note.address, "status": status}, note, note.cause, note.wall_time_s)

    def _write(self, what: dict[str, Any], note: Note | SessionNote, cause: str | None, wall: float | None) -> None:
        if self._stream is None:
            return
        now = datetime.now(UTC).isoformat(timespec="milliseconds")
        line = {"time": now} | what | {"cause": cause, "wall_time_s": wall, "unchanged": note.unchanged}
        try:
            self._stream.write(json.dumps(line) + "\n")
        except OSError as problem:
            errors.print(f"--log {self._stream.name}: cannot be written ({problem.strerror}); it ends here")
            self._stream = None


@contextmanager
def log_to(path: Path | None) -> Iterator[Log]:
    """Open a log, or one that goes nowhere.

    Raises
    ------
    RigError
        Where the file cannot be opened.
    """
    if path is None:
        yield Log(None)
        return
    try:
        stream = path.open("a", encoding="utf-8", buffering=1)
    except OSError as problem:
        raise RigError(f"--log {path}: cannot be written ({problem.strerror})") from problem
    with stream:
        yield Log(stream)


def _became(note: Note) -> str:
    status = note.row.status + (", as before" if note.unchanged else "")
    cause = (note.row.cause or "").removeprefix(f"{note.row.status}: ")
    return f"{status}: {cause}" if cause else status
