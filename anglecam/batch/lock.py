"""The lock that admits one batch at a time to an output folder. A killed batch leaves nothing that must be removed.

The operating system releases the lock when the process that holds it ends, however it ends. A file system that
implements no such lock is refused: `filelock` could fall back to a marker file there, but a killed batch would leave
the marker, and someone would have to remove it.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

from anglecam.batch.output_folder import OutputFolder
from anglecam.errors import RigError

_PATIENCE_S = 1.0
"""A process that a killed batch was just starting holds the lock too, until it runs its own program."""


@contextmanager
def locked(folder: OutputFolder) -> Iterator[str | None]:
    """Keep every other batch out of an output folder until the block or the process ends.

    Parameters
    ----------
    folder : OutputFolder
        The output folder.

    Yields
    ------
    str or None
        The name of the last run, if it was killed or interrupted.

    Raises
    ------
    RigError
        If another batch is at work, if the folder cannot be written to, or if its file system has no locks.
    """
    shown = f"--out {folder.path}"
    try:
        folder.lock_file.parent.mkdir(parents=True, exist_ok=True)
        folder.lock_file.touch()
    except OSError as problem:
        raise RigError(f"{shown}: cannot be written to ({problem.strerror})") from problem
    try:
        lock = FileLock(folder.lock_file, fallback_to_soft=False).acquire(timeout=_PATIENCE_S)
    except Timeout:
        holder = (_lines(folder.run_file) or ["unknown"])[0]
        raise RigError(f"{shown}: another batch is at work there ({holder})") from None
    except OSError as problem:
        raise RigError(f"{shown}: cannot be locked ({problem.strerror})") from problem
    with lock:
        interrupted = "".join(_lines(folder.run_file)[1:2])
        # a batch that is killed before `start_run` leaves the interrupted run to the next
        _write_run(folder, interrupted)
        yield interrupted or None
        # an exception skips this, so that the next batch finds the name of the run that was interrupted
        with contextlib.suppress(OSError):
            folder.run_file.unlink()


def start_run(folder: OutputFolder) -> str:
    """Start a run in a locked output folder, and end the last one.

    Returns
    -------
    str
        The name of the new run.

    Raises
    ------
    RigError
        If the folder cannot be written to.
    """
    run = secrets.token_hex(8)
    _write_run(folder, run)
    return run


def is_current(folder: OutputFolder, run: str) -> bool:
    """Return whether a run still has the folder: a worker on another machine may outlive the batch it works for."""
    return _lines(folder.run_file)[1:] == [run]


def _write_run(folder: OutputFolder, run: str) -> None:
    """Write the run file: a line that names this process, and one that names a run."""
    made = folder.run_file.with_name("run.unfinished")
    try:
        made.write_text(f"process {os.getpid()} on {socket.gethostname()}\n{run}\n", encoding="utf-8")
        made.replace(folder.run_file)
    except OSError as problem:
        raise RigError(f"--out {folder.path}: cannot be written to ({problem.strerror})") from problem


def _lines(file: Path) -> list[str]:
    try:
        return file.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return []
