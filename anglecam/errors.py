"""Exceptions for faults in a call or in a file; their text is what the user reads, usually one line."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from unicodedata import category


class AnglecamError(Exception):
    """Base of every failure that the user reads as one line: ``what: how much, what next``.

    A file with several faults has a line for each. No name and no content of a file adds a line: see `printable`.
    """

    def __init__(self, *lines: str) -> None:
        super().__init__(*map(printable, lines))

    def __str__(self) -> str:
        return "\n".join(self.args)

    @property
    def one_line(self) -> str:
        """All lines as one, for a cell of a table."""
        return "; ".join(self.args)


class RigError(AnglecamError):
    """The call, the rig file or the composition of a session is wrong, so nothing can be done (exit status 2)."""


class InputError(AnglecamError):
    """One clip, series or command file cannot be used; the others of the call still can be (exit status 1)."""


@contextmanager
def blame(path: Path) -> Iterator[None]:
    """Turn an unexpected exception into an `InputError` that names the file, so that only that file fails."""
    try:
        yield
    except AnglecamError:
        raise
    except OSError as fault:
        raise InputError(f"{fault.filename or path}: {fault.strerror or fault}") from fault
    except Exception as fault:
        text = str(fault).strip().splitlines()
        cause = f"{type(fault).__name__}: {text[0] if text else ''}"
        raise InputError(f"{path}: internal error, please report it ({cause})") from fault


def printable(text: str) -> str:
    r"""Return a text in which every control character, line break and unpaired surrogate is escaped.

    The result is one line that any file and terminal accepts, whatever bytes a file's name consists of.

    Examples
    --------
    >>> printable("nod\n.avi")
    'nod\\n.avi'
    """
    return "".join(c.encode("unicode_escape").decode() if category(c) in ("Cc", "Cs", "Zl", "Zp") else c for c in text)
