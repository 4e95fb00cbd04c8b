"""What can go wrong outside our own code, as exceptions whose text is the one line that the user reads."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from unicodedata import category


class AnglecamError(Exception):
    """Base of every failure that is told to the user in one line: ``what: how much, what next``.

    One line it is whatever a file is called and whatever stands in it: see `printable`.
    """

    def __init__(self, line: str) -> None:
        super().__init__(printable(line))


class RigError(AnglecamError):
    """The call, the rig file or the make-up of a session is wrong; nothing can be done with it (exit status 2)."""


class InputError(AnglecamError):
    """One clip, series or command file cannot be used; the others of the call still can (exit status 1)."""


@contextmanager
def blame(path: Path) -> Iterator[None]:
    """Turn a fault of our own into an `InputError` that names the file, so that it costs that file alone."""
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
    """Return text that every file and terminal takes on one line, whatever bytes a file's name is made of."""
    return "".join(c.encode("unicode_escape").decode() if category(c) in ("Cc", "Cs", "Zl", "Zp") else c for c in text)
