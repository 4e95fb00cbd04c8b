"""Files that appear whole or not at all."""

from __future__ import annotations

import contextlib
import json
import math
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any


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
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="") as stream:
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
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as folder:
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
