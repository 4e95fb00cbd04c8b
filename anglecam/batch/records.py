"""What a batch remembers between calls: a small file for each clip and session, below ``DIR/.anglecam``.

A note is written after its results are in place and removed before they are replaced, so a note that is there speaks
of results that are there. Everything is made in a folder of its own and then moved: under its final name a file is
whole, and what a kill leaves behind lies in one place, which the next batch clears.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from anglecam.batch.identity import Stamp
from anglecam.batch.row import Row
from anglecam.io.files import json_text


@dataclass(frozen=True)
class Note:
    """What became of one clip."""

    row: Row
    address: str
    place: str
    """Where its results are, relative to the output folder, without an ending."""
    stamp: Stamp | None = None
    """Which version of the clip was read."""
    settled: bool = False
    """Whether the clip could not have changed since without its stamp changing."""
    files: dict[str, int] = field(default_factory=dict)
    """Results, relative to the output folder, with their sizes in bytes."""
    call_is_wrong: bool = False
    """Whether a rig file, not the clip, is to blame."""
    passing: bool = False
    """Whether another time may be different though nothing has changed: a full disk, a clip still being written."""
    unchanged: bool = False
    """Whether this is what an earlier call found."""
    gone: bool = False
    """Whether its folder, when it was last searched, held it no longer: the index then tells of it no more."""


@dataclass(frozen=True)
class SessionNote:
    """What became of one session."""

    address: str
    configuration: str
    """Hash of all that it depends on."""
    place: str
    """The folder of its results, relative to the output folder."""
    model: str | None = None
    verdict: str | None = None
    effects: str | None = None
    """Ids of what the loop added, `` + `` between."""
    cause: str | None = None
    """Why there is no model."""
    problems: tuple[str, ...] = ()
    """What could not be used, one line each."""
    files: dict[str, int] = field(default_factory=dict)
    call_is_wrong: bool = False
    wall_time_s: float | None = None
    version: str | None = None
    unchanged: bool = False


@dataclass(frozen=True)
class Store:
    """An output folder and what lies in it."""

    out: Path

    @property
    def lock(self) -> Path:
        """The file that keeps a second batch out."""
        return self.out / ".anglecam" / "lock"

    def unfinished(self, run: str = "") -> Path:
        """Return the folder in which results of a run are made; without a run, of all."""
        return self.out / ".anglecam" / "unfinished" / run

    def kept(self, address: str) -> str:
        """Return where a clip's series is kept for its session, relative to the output folder."""
        return f".anglecam/series/{key(address)}.nc"

    def clear(self) -> None:
        """Remove what killed runs have left behind."""
        shutil.rmtree(self.unfinished(), ignore_errors=True)

    def read_clip(self, address: str) -> Note | None:
        """Return what is remembered of a clip."""
        return _note(self._note("clips", address))

    def read_session(self, address: str) -> SessionNote | None:
        """Return what is remembered of a session."""
        found = _read(self._note("sessions", address))
        try:
            return None if found is None else SessionNote(**found | {"problems": tuple(found["problems"])})
        except (TypeError, KeyError):
            return None

    def clips(self) -> Iterator[Note]:
        """Yield what is remembered of every clip."""
        for path in sorted((self.out / ".anglecam" / "clips").glob("*.json")):
            note = _note(path)
            if note is not None:
                yield note

    def forget_clip(self, address: str) -> None:
        """Remove a clip's note."""
        self._note("clips", address).unlink(missing_ok=True)

    def has(self, files: dict[str, int]) -> bool:
        """Tell whether results are all there, and whole."""
        try:
            return all((self.out / file).stat().st_size == size for file, size in files.items())
        except OSError:
            return False

    def publish(self, note: Note | SessionNote, made: dict[str, Path], before: dict[str, int], run: str) -> Any:
        """Move results to their places, remove those of before that are no longer, and write the note.

        Parameters
        ----------
        note : Note or SessionNote
            Without ``files``.
        made : dict
            From place, relative to the output folder, to the finished file.
        before : dict
            Results of before, which this clip or session alone had.
        run : str
            The run, in whose folder the note is made.

        Returns
        -------
        Note or SessionNote
            With ``files``.

        Raises
        ------
        OSError
            Where the output folder cannot be written to; there is no note then.
        """
        path = self._note("clips" if isinstance(note, Note) else "sessions", note.address)
        path.unlink(missing_ok=True)
        sizes = {}
        for place, file in made.items():
            target = self.out / place
            target.parent.mkdir(parents=True, exist_ok=True)
            sizes[place] = file.stat().st_size
            file.replace(target)
        for place in set(before) - set(made):
            (self.out / place).unlink(missing_ok=True)
        noted = replace(note, files=sizes)
        move_in(json_text(asdict(noted)).encode(), path, self.unfinished(run))
        return noted

    def renew(self, note: Note, run: str) -> None:
        """Write a clip's note anew, its results being as they were."""
        move_in(json_text(asdict(note)).encode(), self._note("clips", note.address), self.unfinished(run))

    def _note(self, kind: str, address: str) -> Path:
        return self.out / ".anglecam" / kind / f"{key(address)}.json"


def key(address: str) -> str:
    """Return a name for a clip or session that any file system takes."""
    return hashlib.sha256(address.encode("utf-8", "surrogateescape")).hexdigest()[:32]


def move_in(content: bytes, path: Path, unfinished: Path) -> None:
    """Write a file elsewhere and move it to its place."""
    unfinished.mkdir(parents=True, exist_ok=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    made = unfinished / f"{path.name}.{os.urandom(4).hex()}"
    try:
        made.write_bytes(content)
        made.replace(path)
    finally:
        made.unlink(missing_ok=True)


def note_from_dict(found: dict[str, Any]) -> Note:
    """Return a clip's note as `dataclasses.asdict` has written it."""
    return Note(**found | {"row": Row(**found["row"])})


def _note(path: Path) -> Note | None:
    found = _read(path)
    try:
        return None if found is None else note_from_dict(found)
    except (TypeError, KeyError):  # of another version
        return None


def _read(path: Path) -> dict[str, Any] | None:
    try:
        found = json.loads(path.read_bytes())
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) else None
