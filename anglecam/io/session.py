"""Read and validate a session: one rig, several recordings, their commands.

A recording is a clip, tracks of points or an angle series from another source. A fault in one recording affects that
recording alone: `read_session` lists it in ``problems`` and continues with the others.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from anglecam.data.command import Command
from anglecam.errors import InputError, RigError
from anglecam.io.command_csv import COMMAND_ENDING, read_command
from anglecam.io.live_csv import LIVE_ENDING
from anglecam.io.numbered_images import has_numbered_images
from anglecam.io.rig import Rig, read_rig
from anglecam.io.tracks.files import TRACKS_ENDINGS, find_tracks, name_by_tool

CLIP_ENDINGS = (".avi", ".mp4", ".mkv", ".mov", ".m4v", ".webm")
SERIES_ENDING = ".angles.csv"
MOST_BODIES = 6
"""Of a recording."""
CORRECTED = "corrected"
"""Folder, within a session's results, of the series with the effects of the camera removed."""


@dataclass(frozen=True)
class Recording:
    """One recording of a session before it is measured."""

    name: str
    source: Path
    """The clip, or the file of tracks or the ``.angles.csv`` that replaces it."""
    command: Command | None = None

    @property
    def is_clip(self) -> bool:
        """Whether ``source`` is a film; only films take long to measure."""
        return self.source.suffix.lower() in CLIP_ENDINGS

    @property
    def is_series(self) -> bool:
        """Whether ``source`` already holds angles."""
        return self.source.name.endswith(SERIES_ENDING)


@dataclass(frozen=True)
class Session:
    """A folder of recordings of one rig."""

    directory: Path
    rig: Rig
    recordings: tuple[Recording, ...]
    """In the order of their names."""
    problems: tuple[InputError, ...] = ()
    """Why recordings cannot be used, one error for each."""
    notes: tuple[str, ...] = ()
    """Remarks for the user, one line each."""


def command_beside(source: Path, rig: Rig | None = None) -> Command | None:
    """Read the command file in a recording's folder that has its name; ``None`` if there is none."""
    path = command_file_beside(source)
    return command_of(path, Rig() if rig is None else rig) if path.exists() else None


def command_file_beside(source: Path) -> Path:
    """Return the path of the command file that belongs to a recording; it need not exist."""
    return (source.resolve() if source.is_dir() else source).with_name(recording_name(source) + COMMAND_ENDING)


def command_of(path: Path, rig: Rig) -> Command:
    """Read a command file whose rows mean what the rig declares."""
    command = read_command(path)
    return command.sampled() if rig.command.hold == "linear" else command


def recording_name(source: Path) -> str:
    """Return a recording's name: its file's name without the ending, and for tracks without the program's additions.

    A folder of numbered pictures gives them its name.
    """
    if source.is_dir():
        return source.resolve().name
    if source.name.endswith(SERIES_ENDING):
        return source.name.removesuffix(SERIES_ENDING)
    if source.suffix.lower() not in TRACKS_ENDINGS:
        return source.stem
    return name_by_tool(source.stem) or _name_beside(source)


def _name_beside(tracks: Path) -> str:
    """Return the longest name of a clip or command in the tracks' folder with which their name begins.

    Without such a clip or command, return the tracks' name. The match must end at the end of a word: ``nod`` matches
    ``nod_filtered`` and not ``nodding``.
    """
    folder = tracks.parent
    if not folder.is_dir():
        return tracks.stem
    names = {clip.stem for clip in find_clips(folder)}
    names |= {path.name.removesuffix(COMMAND_ENDING) for path in folder.glob(f"*{COMMAND_ENDING}")}
    matching = [name for name in names if re.match(re.escape(name) + r"(?![^\W_])", tracks.stem)]
    return max(matching, key=len, default=tracks.stem)


def rig_beside(source: Path) -> Rig:
    """Read ``rig.yaml`` in the folder of ``source``, or in ``source`` if it is a folder; without it, the defaults."""
    path = rig_file_beside(source)
    return Rig() if path is None else read_rig(path)


def rig_file_beside(source: Path) -> Path | None:
    """Return the ``rig.yaml`` in the folder of ``source``, or in ``source`` if it is a folder; ``None`` without one.

    Of a folder of numbered pictures both are tried, because it is a clip and a folder.
    """
    folders = [source, source.resolve().parent] if source.is_dir() else [source.parent]
    if source.is_dir() and not is_film_of_images(source):
        folders.pop()
    return next((folder / "rig.yaml" for folder in folders if (folder / "rig.yaml").exists()), None)


def is_film_of_images(folder: Path) -> bool:
    """Return whether a folder is one clip: it holds numbered pictures, and no films."""
    return not find_clips(folder) and has_numbered_images(folder)


def clip_beside(tracks: Path) -> Path | None:
    """Return the clip that tracks were made from: the clip of their name in the same folder, else ``None``."""
    name = recording_name(tracks)
    return next((clip for clip in find_clips(tracks.parent) if clip.stem == name), None)


def find_clips(directory: Path) -> list[Path]:
    """List the clips of a folder in the order of their names."""
    return sorted(p for p in directory.iterdir() if p.is_file() and p.suffix.lower() in CLIP_ENDINGS)


def find_measurable(directory: Path, rig: Rig) -> tuple[list[Path], list[str]]:
    """List a folder's clips and the tracks that replace clips; also return a line on each unused file of tracks."""
    tracks, unused = _choose_tracks(directory, rig)
    return sorted([*(clip for clip in find_clips(directory) if clip.stem not in tracks), *tracks.values()]), unused


def read_session(directory: Path, rig: Rig | None = None) -> Session:
    """Read a session's rig and commands and list its recordings.

    Parameters
    ----------
    directory : Path
        The session's folder.
    rig : Rig, optional
        Used instead of the folder's ``rig.yaml``.

    Returns
    -------
    Session
        Of several files of one name, a series replaces tracks, and tracks replace a clip. Tracks are recordings only
        if the rig declares ``marks``.

    Raises
    ------
    RigError
        If the folder does not exist or has no recording, or its rig file is wrong or holds out an unknown name.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     series = Path(folder, "swing.angles.csv")
    ...     _ = series.write_text("time_s,angle_deg")
    ...     session = read_session(Path(folder))
    >>> [recording.name for recording in session.recordings]
    ['swing']
    >>> session.rig.facing, session.problems
    ('right', ())
    """
    if not directory.is_dir():
        fault = "is a file; a session is a folder" if directory.is_file() else "no such folder"
        raise RigError(f"{directory}: {fault}")
    rig_is_the_folders = rig is None
    rig = rig_beside(directory) if rig is None else rig
    sources: dict[str, Path] = {}
    problems: list[InputError] = []
    for clip in find_clips(directory):
        if clip.stem in sources:
            problems.append(InputError(f"{clip}: {sources[clip.stem].name} has the same name; rename one"))
            continue
        sources[clip.stem] = clip
    tracks, unused = _choose_tracks(directory, rig)
    sources |= tracks
    series_files = {recording_name(p): p for p in directory.glob(f"*{SERIES_ENDING}") if p.is_file()}
    of_bodies = {file for name in (*sources, *series_files) for file in other_body_files(name)}
    sources |= {name: p for name, p in series_files.items() if p.name not in of_bodies}
    if not sources:
        series = f"*{SERIES_ENDING} (columns time_s,angle_deg: see docs/files.md)"
        fault = f"no clip ({', '.join(CLIP_ENDINGS)}) and no {series} in it"
        raise RigError(unused[0] if unused else f"{directory}: {fault}")
    filmed = [source for source in sources.values() if not source.name.endswith(SERIES_ENDING)]
    if rig.source == "encoder" and filmed:
        raise RigError(f"{filmed[0]}: its angle is seen by a camera, but rig.yaml states source: encoder")
    unknown = sorted(set(rig.held_out) - set(sources))
    if unknown and rig_is_the_folders:
        raise RigError(f"{directory / 'rig.yaml'}: held_out names {unknown[0]}, which is not a recording here")
    recordings = []
    for name, source in sorted(sources.items()):
        try:
            recordings.append(Recording(name, source, command_beside(source, rig)))
        except InputError as problem:
            problems.append(problem)
    commands = sorted(directory.glob(f"*{COMMAND_ENDING}"))
    orphans = [p for p in commands if p.name.removesuffix(COMMAND_ENDING) not in sources]
    notes = [f"{p}: not used; there is no recording of that name" for p in orphans]
    same = [p for p in series_files.values() if p.name in of_bodies]
    notes += [f"{p}: not used; it is another body of the same recording" for p in sorted(same)]
    known = {
        *sources.values(),
        *series_files.values(),
        *commands,
        *find_tracks(directory),
        *directory.glob(f"*{LIVE_ENDING}"),
    }
    others = [p for p in sorted(directory.glob("*.csv")) if p not in known and any(map(p.name.startswith, sources))]
    notes += [f"{p}: not used; a command is NAME{COMMAND_ENDING}, a series NAME{SERIES_ENDING}" for p in others]
    return Session(directory, rig, tuple(recordings), tuple(problems), (*unused, *notes))


def other_body_files(name: str) -> list[str]:
    """Return the names of the series of a recording's bodies besides the first: ``NAME.b2.angles.csv``, …."""
    return [f"{name}.b{k}{SERIES_ENDING}" for k in range(2, MOST_BODIES + 1)]


def require_recordings(session: Session, names: Sequence[str]) -> None:
    """Raise `RigError` where one of ``names``, which are to be held out, is no recording of the session."""
    unknown = sorted(set(names) - {recording.name for recording in session.recordings})
    if unknown:
        raise RigError(f"hold out {unknown[0]}: no such recording in {session.directory}")


def _choose_tracks(directory: Path, rig: Rig) -> tuple[dict[str, Path], list[str]]:
    """Return a folder's tracks by recording, and a line on each file of tracks that is not used.

    Of several files of one recording, the one with the shortest name is used; the others are filtered versions or come
    from further training. HDF5 is preferred to CSV, which holds the same.
    """
    chosen: dict[str, Path] = {}
    unused = []
    files = sorted(find_tracks(directory), key=lambda p: (len(p.stem), p.stem, p.suffix.lower() == ".csv"))
    for path in files:
        if rig.marks is None:
            unused.append(f"{path}: not used; name its points with marks: {{mouth: …, pivot: …}} in rig.yaml")
            continue
        used = chosen.setdefault(recording_name(path), path)
        if used.stem != path.stem:
            unused.append(f"{path}: not used; {used.name} is the same recording")
    return chosen, unused
