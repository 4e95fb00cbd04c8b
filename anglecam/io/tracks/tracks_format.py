"""How a tracking program's file format is declared, and the opened file that its functions receive."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from anglecam.errors import InputError
from anglecam.io.files import open_text
from anglecam.io.tracks.hdf5 import open_hdf5
from anglecam.io.tracks.tracks import Tracks

if TYPE_CHECKING:
    import h5py

HDF5_ENDINGS = (".h5", ".hdf5")
"""Endings of HDF5 files; files with any other ending are read as text."""
_FIRST_LINE_CHARACTERS = 200
"""Length at which `TracksFile.first_line` is cut; enough to recognise a header."""


@dataclass(frozen=True)
class TracksFile:
    """A file that may hold tracks; each of its properties reads the file when it is first used, and only once."""

    path: Path
    _opened: ExitStack

    @property
    def is_hdf5(self) -> bool:
        """Whether the ending is that of an HDF5 file."""
        return self.path.suffix.lower() in HDF5_ENDINGS

    @cached_property
    def first_line(self) -> str:
        """The first line of a text file, cut at 200 characters; `InputError` if it is not UTF-8 text."""
        try:
            with open_text(self.path, sys.maxsize) as stream:
                return stream.readline(_FIRST_LINE_CHARACTERS).rstrip("\r\n")
        except (OSError, UnicodeDecodeError) as fault:
            reason = fault.strerror if isinstance(fault, OSError) else str(fault).splitlines()[0]
            raise InputError(f"{self.path}: cannot be read as text ({reason})") from fault

    @cached_property
    def hdf5(self) -> h5py.File:
        """The file opened as HDF5.

        `InputError` if it cannot be opened. While it is open, a `ValueError`, `KeyError`, `TypeError`, `IndexError` or
        `OSError` that a format's function raises becomes an `InputError` that names the file.
        """
        return self._opened.enter_context(open_hdf5(self.path))

    def content(self) -> str:
        """Describe in a few words what the file begins with, for a message that refuses it."""
        if self.is_hdf5:
            return f"it holds {', '.join(list(self.hdf5)[:5]) or 'nothing'}"
        return f"it begins with {self.first_line[:60]!r}"


@dataclass(frozen=True)
class TracksFormat:
    """One tracking program's file format: how to recognise, name and read its files."""

    program: str
    """Name of the program, as messages state it."""
    kind: str
    """What its files are called after the program's name in messages, for example ``analysis file``."""
    endings: tuple[str, ...]
    """Lower-case file endings, with the dot."""
    recognises: Callable[[TracksFile], bool]
    """Whether a file with one of ``endings`` is of this format; reads no more than the header."""
    read: Callable[[TracksFile], Tracks]
    """Read a file of this format into `Tracks`, with a row of NaN for a frame without points; one unnamed animal has
    the name ``""``. `anglecam.io.tracks.files.read_tracks` fills in the program's name and its usual limit, and turns a
    `ValueError`, `KeyError`, `TypeError`, `IndexError` or `OSError` into an `InputError` that names the file. A text
    file is opened by `anglecam.io.files.open_text`, which limits its size."""
    clip_name: Callable[[str], str | None] = lambda stem: None
    """The clip's name from the stem of a file name that the program made of it; ``None`` if the program did not."""
    usual_limit: float = 0.0
    """The program's default for the likelihood below which a point counts as missing; 0 if it has no such default."""
    companions: tuple[str, ...] = ()
    """How the stems of files end that the program writes next to its tracks and that hold something else."""


@contextmanager
def open_tracks_file(path: Path) -> Iterator[TracksFile]:
    """Yield a `TracksFile`; whatever it opened is closed at the end of the block."""
    with ExitStack() as opened:
        yield TracksFile(path, opened)
