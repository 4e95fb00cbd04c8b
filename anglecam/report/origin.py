"""How a page was made: date and command of the run, versions, and the SHA-256 of every input.

Date and command belong to a run on the command line. A batch leaves them out, so that the page of a clip depends on the
clip and what is declared about it, and a batch that was stopped and resumed gives the same files as one that was not.
"""

from __future__ import annotations

import hashlib
import os
import platform
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from anglecam import __version__
from anglecam.errors import printable

LIBRARIES = ("numpy", "scipy", "opencv-python-headless", "av")
"""Libraries whose versions a page states, because results may depend on them."""


@dataclass(frozen=True)
class Run:
    """How a command was called."""

    command: str | None = None
    """The command line; ``None`` leaves it out of the page."""
    date: str | None = None
    """When, in ISO 8601; ``None`` leaves it out of the page."""
    rig: Path | None = None
    """The rig file that was used in place of those beside the clips."""


@dataclass(frozen=True)
class Input:
    """A file, or a folder of pictures, that a result depends on."""

    name: str
    size: int
    """Bytes."""
    sha256: str


@dataclass(frozen=True)
class Origin:
    """What a page states about how it was made."""

    inputs: tuple[Input, ...]
    versions: str
    citation: str
    command: str | None = None
    date: str | None = None


def now() -> str:
    """Return the present time in ISO 8601, or the one that ``SOURCE_DATE_EPOCH`` states, for reproducible pages."""
    stated = os.environ.get("SOURCE_DATE_EPOCH", "")
    moment = datetime.fromtimestamp(int(stated), UTC) if stated.isdigit() else datetime.now(UTC)
    return moment.isoformat(timespec="seconds")


def origin_of(inputs: Iterable[Path], run: Run | None = None) -> Origin:
    """Return what a page states about its origin.

    Parameters
    ----------
    inputs : iterable of Path
        Everything that the result depends on. A file that is missing or empty, as a clip that a batch has not fetched
        again, is left out.
    run : Run, optional
        How the command was called.

    Returns
    -------
    Origin
        Names without folders, so that the page does not depend on where the files lie.

    Raises
    ------
    OSError
        If a file cannot be read.
    """
    run = run or Run()
    found = [_input(path) for path in dict.fromkeys(inputs) if path.exists()]
    versions = ", ".join([f"anglecam {__version__}", f"Python {platform.python_version()}", *map(_named, LIBRARIES)])
    citation = (
        f"@software{{anglecam, title = {{anglecam: the angle of a moving mechanism from video, and what its model "
        f"lacks}}, author = {{{{The anglecam authors}}}}, version = {{{__version__}}}, license = {{MIT}}}}"
    )
    command = None if run.command is None else printable(run.command)
    return Origin(tuple(one for one in found if one.size), versions, citation, command, run.date)


def _named(library: str) -> str:
    return f"{library} {version(library)}"


def _input(path: Path) -> Input:
    """Hash a file; a folder of pictures by the list of its files' hashes, as ``sha256sum * | sha256sum`` prints it."""
    if not path.is_dir():
        return Input(printable(path.name), path.stat().st_size, _sha256(path))
    files = sorted(one for one in path.iterdir() if one.is_file() and not one.name.startswith("."))
    listed = "".join(f"{_sha256(one)}  {one.name}\n" for one in files).encode("utf-8", "surrogateescape")
    size = sum(one.stat().st_size for one in files)
    return Input(f"{printable(path.name)}/", size, hashlib.sha256(listed).hexdigest())


def _sha256(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
