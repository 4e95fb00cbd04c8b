"""What every command prints to, and the folder that it writes to."""

from __future__ import annotations

import sys
from pathlib import Path
from unicodedata import category

from rich.console import Console

from anglecam.errors import RigError

screen = Console(width=None if sys.stdout.isatty() else 120)
errors = Console(stderr=True, soft_wrap=True, highlight=False, markup=False)


def make_folder(out: Path) -> None:
    """Make a folder for results, unless it is there.

    Raises
    ------
    RigError
        Where it cannot be made.
    """
    if out.is_file():
        raise RigError(f"--out {out}: is a file; give a folder")
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise RigError(f"--out {out}: this folder cannot be made ({problem.strerror})") from problem


def printable(text: str) -> str:
    """Return text that every file and terminal takes on one line, whatever bytes a file's name is made of."""
    return "".join(c.encode("unicode_escape").decode() if category(c) in ("Cc", "Cs", "Zl", "Zp") else c for c in text)
