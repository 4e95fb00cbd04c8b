"""The consoles that every command prints to, and its output folder."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from rich.console import Console

from anglecam.errors import RigError

# a file may be called [red].avi or :boom:.avi
screen = Console(width=None if sys.stdout.isatty() else 120, markup=False, emoji=False)
errors = Console(stderr=True, soft_wrap=True, highlight=False, markup=False, emoji=False)


def make_folder(out: Path) -> None:
    """Create a folder for results if it does not exist.

    Raises
    ------
    RigError
        If the folder cannot be created or written to.
    """
    if out.is_file():
        raise RigError(f"--out {out}: is a file; give a folder")
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise RigError(f"--out {out}: this folder cannot be made ({problem.strerror})") from problem
    try:  # fail before the work, not after it
        with tempfile.TemporaryFile(dir=out):
            pass
    except OSError as problem:
        raise RigError(f"--out {out}: cannot be written to ({problem.strerror})") from problem
