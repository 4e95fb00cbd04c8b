"""The progress of a batch: a bar on a terminal, plain lines elsewhere, and a log of JSON lines for programs."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import IO

from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from anglecam.batch.records import ClipRecord, SessionRecord
from anglecam.batch.row import FAILED, OK, STALE
from anglecam.errors import RigError
from anglecam.terminal import errors

_LINE_PER_CLIP_UP_TO = 20
"""Number of clips up to which every clip has a plain line."""
_LINE_EVERY_S = 10.0


class ProgressDisplay:
    """Shows on standard error how many clips are done and have failed, the rate, and the time left."""

    def __init__(self, bars: Progress, *, quiet: bool) -> None:
        self._clips = self._sessions = self._sessions_done = 0
        self._bars = bars
        self._plain = not quiet and not errors.is_terminal
        self._done = self._failed = 0
        self._began = self._last_line = time.monotonic()
        self._stage = bars.add_task("looking for clips", total=None, count="", rate="")
        self._clip_bar = bars.add_task("clips", total=None, visible=False, count="", rate="")
        self._session_bar = bars.add_task("sessions", total=None, visible=False, count="", rate="")

    def begin(self, stage: str) -> None:
        """Show what is being done."""
        self._bars.update(self._stage, description=stage)

    def begin_jobs(self, clips: int, sessions: int) -> None:
        """Show the numbers of clips to measure and of sessions to fit."""
        self._clips, self._sessions = clips, sessions
        self._began = self._last_line = time.monotonic()
        self.begin("measuring")
        self._bars.reset(self._clip_bar, total=clips, visible=True, count=f"0 of {clips}", rate="")
        self._bars.reset(self._session_bar, total=sessions, visible=sessions > 0, count=f"0 of {sessions}", rate="")

    def add_clip(self, record: ClipRecord, *, unchanged: bool) -> None:
        """Count a clip and show its outcome."""
        self._done += 1
        self._failed += record.has_failed
        elapsed = time.monotonic() - self._began
        rate = self._done / elapsed if elapsed > 0.0 else 0.0
        figures = f"{rate:.3g}/s, {self._failed} failed"
        self._bars.update(self._clip_bar, advance=1, count=f"{self._done} of {self._clips}", rate=figures)
        if not self._plain:
            return
        if self._clips <= _LINE_PER_CLIP_UP_TO:
            outcome = _clip_outcome(record, unchanged=unchanged)
            errors.print(f"{self._done} of {self._clips}: {record.row.path}: {outcome}")
        elif time.monotonic() - self._last_line > _LINE_EVERY_S or self._done == self._clips:
            self._last_line = time.monotonic()
            left = (self._clips - self._done) / rate
            errors.print(f"{self._done} of {self._clips} clips, {figures}, {left:.0f} s left")

    def add_session(self, record: SessionRecord, *, unchanged: bool) -> None:
        """Count a session and show its outcome."""
        self._sessions_done += 1
        self._bars.update(self._session_bar, advance=1, count=f"{self._sessions_done} of {self._sessions}")
        if self._plain and self._clips <= _LINE_PER_CLIP_UP_TO:
            errors.print(f"session {record.address}: {_session_outcome(record, unchanged=unchanged)}")


def _clip_outcome(record: ClipRecord, *, unchanged: bool) -> str:
    row = record.shown
    status = row.status + (", as before" if unchanged else "")
    cause = (row.cause or "").removeprefix(f"{row.status}: ")
    return f"{status}: {cause}" if cause else status


def _session_status(record: SessionRecord) -> str:
    return OK if not record.has_failed else FAILED if record.in_place is None else STALE


def _session_outcome(record: SessionRecord, *, unchanged: bool) -> str:
    if record.has_failed:
        return _session_status(record)
    outcome = f"{record.verdict or 'identified'}{f' to {record.effects}' if record.effects else ''}"
    return f"{outcome}, as before" if unchanged else outcome


@contextmanager
def show_progress(*, quiet: bool) -> Iterator[ProgressDisplay]:
    """Show progress while the block runs.

    Parameters
    ----------
    quiet : bool
        Show nothing.

    Yields
    ------
    ProgressDisplay
        To which the outcomes are added.
    """
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[count]}"),
        TextColumn("{task.fields[rate]}"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=errors, disable=quiet or not errors.is_terminal) as bars:
        yield ProgressDisplay(bars, quiet=quiet)


class Log:
    """A file with a line of JSON for every clip and session; without a stream, nothing is written."""

    def __init__(self, stream: IO[str] | None) -> None:
        self._stream = stream

    def add_clip(self, record: ClipRecord, *, unchanged: bool) -> None:
        """Write the outcome of a clip."""
        row = record.shown
        self._write({"clip": row.path, "status": row.status}, row.cause, row.wall_time_s, unchanged=unchanged)

    def add_session(self, record: SessionRecord, *, unchanged: bool) -> None:
        """Write the outcome of a session."""
        what = {"session": record.address, "status": _session_status(record)}
        self._write(what, record.shown_cause, record.wall_time_s, unchanged=unchanged)

    def _write(self, what: dict[str, str], cause: str | None, wall_time_s: float | None, *, unchanged: bool) -> None:
        if self._stream is None:
            return
        now = datetime.now(UTC).isoformat(timespec="milliseconds")
        line = {"time": now} | what | {"cause": cause, "wall_time_s": wall_time_s, "unchanged": unchanged}
        try:
            self._stream.write(json.dumps(line) + "\n")
        except OSError as problem:
            errors.print(f"--log {self._stream.name}: cannot be written ({problem.strerror}); the log ends here")
            self._stream = None


@contextmanager
def open_log(path: Path | None) -> Iterator[Log]:
    """Open a log to append to; without a path, a log that writes nothing.

    Raises
    ------
    RigError
        If the file cannot be opened.
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
