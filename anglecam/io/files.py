"""Files that appear whole or not at all, and text files that are read within limits."""

from __future__ import annotations

import contextlib
import errno
import io
import json
import math
import os
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any, BinaryIO

_NAMED = 40
"""Characters of a file's name in that of its unfinished form, so that no name becomes too long by it."""
_MOST_JSON = 64 * 2**20
"""Bytes; what anglecam writes has a hundredth of it."""


@contextlib.contextmanager
def open_regular(path: Path) -> Iterator[BinaryIO]:
    """Open a file for reading: an ordinary one, never a folder, a device or a pipe that may let one wait for ever.

    Parameters
    ----------
    path : Path
        The file.

    Yields
    ------
    BinaryIO
        Its bytes.

    Raises
    ------
    OSError
        Where it cannot be opened or is no ordinary file; ``strerror`` says why.
    """
    if "\0" in str(path):
        raise OSError(errno.EINVAL, "no file can be called that", str(path))
    with os.fdopen(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb") as stream:
        if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
            raise OSError(errno.EINVAL, "not an ordinary file", str(path))
        yield stream


@contextlib.contextmanager
def open_text(path: Path, most: int) -> Iterator[IO[str]]:
    """Open a UTF-8 text file, with or without a mark of that, as the csv module wants it; raises as `open_regular`.

    Parameters
    ----------
    path : Path
        The file.
    most : int
        Bytes; a larger file is an OSError, too.

    Yields
    ------
    IO[str]
        Its text.
    """
    with open_regular(path) as stream:
        if os.fstat(stream.fileno()).st_size > most:
            raise OSError(errno.EFBIG, f"larger than {most / 2**20:g} MiB", str(path))
        yield io.TextIOWrapper(stream, encoding="utf-8-sig", newline="")


def read_text(path: Path, most: int) -> str:
    """Read a UTF-8 text file of at most ``most`` bytes whole.

    Raises
    ------
    OSError
        As `open_text`.
    UnicodeDecodeError
        Where it is no UTF-8.
    """
    with open_text(path, most) as stream:
        return stream.read(most)


def read_json(path: Path) -> Any:
    """Read JSON, its numbers as floats.

    Raises
    ------
    OSError
        As `open_text`.
    ValueError
        Where it is no JSON, or nested too deeply.
    """
    try:
        return json.loads(read_text(path, _MOST_JSON), parse_int=float)
    except RecursionError as fault:
        raise ValueError("nested too deeply") from fault


@contextlib.contextmanager
def write_atomically(path: Path) -> Iterator[IO[str]]:
    """Open a text stream whose content replaces ``path`` only when the block ends without an error.

    Parameters
    ----------
    path : Path
        The file to be; its folder is made if missing.

    Yields
    ------
    IO[str]
        A UTF-8 stream.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name[:_NAMED]}.")
    try:
        # a name of bytes that are no text may stand in a page
        with os.fdopen(handle, "w", encoding="utf-8", newline="", errors="backslashreplace") as stream:
            yield stream
        # mkstemp makes files private; give the result the mode any new file would have
        mask = os.umask(0)
        os.umask(mask)
        Path(name).chmod(0o666 & ~mask)
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


@contextlib.contextmanager
def write_whole(path: Path) -> Iterator[Path]:
    """Give a place for a file that a library writes by itself; it takes the place of ``path`` when the block ends.

    Parameters
    ----------
    path : Path
        The file to be; its folder is made if missing.

    Yields
    ------
    Path
        In a folder of its own beside it, removed whatever happens.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name[:_NAMED]}.") as folder:
        unfinished = Path(folder) / path.name
        yield unfinished
        unfinished.replace(path)


def write_json(path: Path, content: Any) -> None:
    """Write JSON with every float at full precision; a number that is not finite becomes ``null``."""
    with write_atomically(path) as stream:
        stream.write(json_text(content) + "\n")


def json_text(content: Any) -> str:
    """Return JSON as `write_json` writes it."""
    return json.dumps(_finite(content), indent=1, allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    if hasattr(value, "tolist"):  # numpy scalars and arrays
        return _finite(value.tolist())
    return value if not isinstance(value, float) or math.isfinite(value) else None
