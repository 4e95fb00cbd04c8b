"""One batch at a time in an output folder; a batch that was killed leaves nothing that would have to be removed."""

from __future__ import annotations

import contextlib
import fcntl
import os
import secrets
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from anglecam.errors import RigError


@contextmanager
def locked(file: Path) -> Iterator[str]:
    """Keep every other batch out of the folder of a file, until the block or the process ends.

    Parameters
    ----------
    file : Path
        The lock's file; it says who holds the lock.

    Yields
    ------
    str
        The name of this run.

    Raises
    ------
    RigError
        Where another batch is at work, or the folder cannot be written to.
    """
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        stream = file.open("a+")
    except OSError as problem:
        raise RigError(f"--out {file.parent.parent}: cannot be written to ({problem.strerror})") from problem
    with stream:
        try:
            # the system lets go of it when the process ends, whatever ends it
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            stream.seek(0)
            who = stream.read().partition("\n")[0] or "unknown"
            raise RigError(f"--out {file.parent.parent}: another batch is at work there ({who})") from None
        except OSError as problem:
            raise RigError(f"--out {file.parent.parent}: cannot be locked ({problem.strerror})") from problem
        run = secrets.token_hex(8)
        try:
            stream.seek(0)
            stream.truncate()
            stream.write(f"process {os.getpid()} on {socket.gethostname()}\n{run}\n")
            stream.flush()
        except OSError as problem:
            raise RigError(f"--out {file.parent.parent}: cannot be written to ({problem.strerror})") from problem
        try:
            yield run
        finally:
            # a worker elsewhere that is still at it is not to put anything here any more
            with contextlib.suppress(OSError):
                stream.truncate(0)


def is_current(file: Path, run: str) -> bool:
    """Tell whether a run still has the folder: a worker elsewhere may outlive the batch that it works for."""
    try:
        return file.read_text().splitlines()[1:] == [run]
    except OSError:
        return False
