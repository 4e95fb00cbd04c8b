"""Write files atomically, read text files within limits of size, and see whether a film is there."""

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

from anglecam.errors import InputError

_NAME_CHARACTERS = 40
"""Characters of a file's name that its temporary file's name begins with; a longer name could exceed the limit."""
_READ = os.O_RDONLY
for _flag in ("O_NONBLOCK", "O_CLOEXEC", "O_BINARY"):  # each system has some: not to wait at a pipe, to keep line ends
    _READ |= getattr(os, _flag, 0)
_MOST_JSON = 64 * 2**20
"""Size above which JSON is not read, bytes; files that anglecam writes have a hundredth of it."""


@contextlib.contextmanager
def open_regular(path: Path) -> Iterator[BinaryIO]:
    """Open an ordinary file for reading; a folder, a device or a pipe, which could block for ever, is refused.

    Parameters
    ----------
    path : Path
        The file.

    Yields
    ------
    BinaryIO
        A stream of its bytes.

    Raises
    ------
    OSError
        If the file cannot be opened or is not an ordinary file; ``strerror`` states the cause.
    """
    if "\0" in str(path):
        raise OSError(errno.EINVAL, "no file can be called that", str(path))
    with os.fdopen(os.open(path, _READ), "rb") as stream:
        if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
            raise OSError(errno.EINVAL, "not an ordinary file", str(path))
        yield stream


def require_film_file(path: Path) -> None:
    """Raise `InputError` where a film is missing, empty or no file, before anything is loaded that could open it."""
    if not path.exists():
        raise InputError(f"{path}: no such file")
    if not path.is_file():
        raise InputError(f"{path}: not a file")
    if path.stat().st_size == 0:
        raise InputError(f"{path}: empty file")


@contextlib.contextmanager
def open_text(path: Path, most: int) -> Iterator[IO[str]]:
    """Open a UTF-8 text file, with or without a byte order mark, with line ends kept as the csv module needs them.

    Parameters
    ----------
    path : Path
        The file.
    most : int
        Largest size, bytes.

    Yields
    ------
    IO[str]
        A stream of its text.

    Raises
    ------
    OSError
        As `open_regular`, and if the file is larger than ``most``.
    """
    with open_regular(path) as stream:
        if os.fstat(stream.fileno()).st_size > most:
            raise OSError(errno.EFBIG, f"larger than {most / 2**20:g} MiB", str(path))
        yield io.TextIOWrapper(stream, encoding="utf-8-sig", newline="")


def read_text(path: Path, most: int) -> str:
    """Read a whole UTF-8 text file of at most ``most`` bytes.

    Raises
    ------
    OSError
        As `open_text`.
    UnicodeDecodeError
        If the file is not UTF-8.
    """
    with open_text(path, most) as stream:
        return stream.read(most)


def read_json(path: Path) -> Any:
    """Read JSON; all its numbers become floats.

    Raises
    ------
    OSError
        As `open_text`.
    ValueError
        If the file is not JSON or is nested too deeply.
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
        The file to write; its folder is made if missing.

    Yields
    ------
    IO[str]
        A UTF-8 stream.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name[:_NAME_CHARACTERS]}.")
    try:
        # a page may contain a file's name, and that name need not be valid text
        with os.fdopen(handle, "w", encoding="utf-8", newline="", errors="backslashreplace") as stream:
            yield stream
        # mkstemp makes files private; the result gets the mode that any new file would have
        mask = os.umask(0)
        os.umask(mask)
        Path(name).chmod(0o666 & ~mask)
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


@contextlib.contextmanager
def write_whole(path: Path) -> Iterator[Path]:
    """Yield a temporary path for a library that writes a file itself; the file replaces ``path`` when the block ends.

    Parameters
    ----------
    path : Path
        The file to write; its folder is made if missing.

    Yields
    ------
    Path
        A path of the same name in a temporary folder next to ``path``; the folder is always removed.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name[:_NAME_CHARACTERS]}.") as folder:
        unfinished = Path(folder) / path.name
        yield unfinished
        unfinished.replace(path)


def write_json(path: Path, content: Any) -> None:
    """Write JSON with every float at full precision; a float that is not finite becomes ``null``."""
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
