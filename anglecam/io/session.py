"""A session read and validated at the door: one rig, several recordings, their commands.

A recording is a clip or, in its place, tracks of points or an angle series from elsewhere. What is wrong with one
recording costs that recording alone: `read_session` returns it among ``problems`` and goes on.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from anglecam.data.command import Command
from anglecam.errors import InputError, RigError
from anglecam.io.command_csv import COMMAND_ENDING, read_command
from anglecam.io.rig import Rig, read_rig
from anglecam.io.tracks.files import TRACKS_ENDINGS, find_tracks, name_by_tool

CLIP_ENDINGS = (".avi", ".mp4", ".mkv", ".mov")
SERIES_ENDING = ".angles.csv"
CORRECTED = "corrected"
"""Folder of a session's series without what the camera did."""


@dataclass(frozen=True)
class Recording:
    """One recording of a session before it is measured."""

    name: str
    source: Path
    """The clip, or the tracks or the ``.angles.csv`` in its place."""
    command: Command | None = None

    @property
    def is_clip(self) -> bool:
        """Whether ``source`` is a film, which takes its time to be measured."""
        return self.source.suffix.lower() in CLIP_ENDINGS

    @property
    def is_series(self) -> bool:
        """Whether ``source`` holds angles already."""
        return self.source.name.endswith(SERIES_ENDING)


@dataclass(frozen=True)
class Session:
    """A folder of recordings of one rig."""

    directory: Path
    rig: Rig
    recordings: tuple[Recording, ...]
    """In the order of their names."""
    problems: tuple[InputError, ...] = ()
    """What made a recording unusable, one for each."""
    notes: tuple[str, ...] = ()
    """What the user should know, a line each."""


def command_beside(source: Path) -> Command | None:
    """Read the command file that stands beside a recording, ``None`` if there is none."""
    path = source.with_name(recording_name(source) + COMMAND_ENDING)
    return read_command(path) if path.exists() else None


def recording_name(source: Path) -> str:
    """Return a recording's name: its file's name without the ending, of tracks without what a program has added."""
    if source.name.endswith(SERIES_ENDING):
        return source.name.removesuffix(SERIES_ENDING)
    if source.suffix.lower() not in TRACKS_ENDINGS:
        return source.stem
    return name_by_tool(source.stem) or _name_beside(source)


def _name_beside(tracks: Path) -> str:
    """Return the longest name of a clip or command beside tracks that theirs begins with, else their own."""
    folder = tracks.parent
    if not folder.is_dir():
        return tracks.stem
    names = {clip.stem for clip in find_clips(folder)}
    names |= {path.name.removesuffix(COMMAND_ENDING) for path in folder.glob(f"*{COMMAND_ENDING}")}
    begins = [name for name in names if re.match(re.escape(name) + r"(?![^\W_])", tracks.stem)]
    return max(begins, key=len, default=tracks.stem)


def rig_beside(source: Path) -> Rig:
    """Read ``rig.yaml`` in the folder of ``source`` (or ``source`` itself, if a folder), or the defaults."""
    path = (source if source.is_dir() else source.parent) / "rig.yaml"
    return read_rig(path) if path.exists() else Rig()


def clip_beside(tracks: Path) -> Path | None:
    """Return the clip that tracks were made from: the one of their name in the same folder, ``None`` if none."""
    name = recording_name(tracks)
    return next((clip for clip in find_clips(tracks.parent) if clip.stem == name), None)


def find_clips(directory: Path) -> list[Path]:
    """List the clips of a folder by name."""
    return sorted(p for p in directory.iterdir() if p.is_file() and p.suffix.lower() in CLIP_ENDINGS)


def find_measurable(directory: Path, rig: Rig) -> tuple[list[Path], list[str]]:
    """List what a folder holds to be measured, clips or the tracks in their place, and a line on each unused file."""
    tracks, idle = _choose_tracks(directory, rig)
    return sorted([*(clip for clip in find_clips(directory) if clip.stem not in tracks), *tracks.values()]), idle


def read_session(directory: Path, rig: Rig | None = None) -> Session:
    """Read a session's rig and commands and list its recordings.

    Parameters
    ----------
    directory : Path
        The session's folder.
    rig : Rig, optional
        In place of the ``rig.yaml`` in it.

    Returns
    -------
    Session
        Where recordings share a name, a series stands in the place of tracks, and tracks in that of a clip. Tracks
        are recordings only where the rig declares ``marks``.

    Raises
    ------
    RigError
        Where the folder, its rig file or the names it holds out are wrong, or it has no recording at all.
    """
    if not directory.is_dir():
        found = "is a file; a session is a folder" if directory.is_file() else "no such folder"
        raise RigError(f"{directory}: {found}")
    own = rig is None
    rig = rig_beside(directory) if rig is None else rig
    sources: dict[str, Path] = {}
    problems: list[InputError] = []
    for clip in find_clips(directory):
        if clip.stem in sources:
            problems.append(InputError(f"{clip}: {sources[clip.stem].name} has the same name; rename one"))
            continue
        sources[clip.stem] = clip
    tracks, idle = _choose_tracks(directory, rig)
    sources |= tracks
    sources |= {recording_name(p): p for p in directory.glob(f"*{SERIES_ENDING}") if p.is_file()}
    if not sources:
        found = f"no clip ({', '.join(CLIP_ENDINGS)}) and no *{SERIES_ENDING} in it"
        raise RigError(f"{directory}: {found}" if not idle else idle[0])
    unknown = sorted(set(rig.held_out) - set(sources))
    if unknown and own:
        raise RigError(f"{directory / 'rig.yaml'}: held_out names {unknown[0]}, which is no recording here")
    recordings = []
    for name, source in sorted(sources.items()):
        try:
            recordings.append(Recording(name, source, command_beside(source)))
        except InputError as problem:
            problems.append(problem)
    commands = sorted(directory.glob(f"*{COMMAND_ENDING}"))
    orphans = [p for p in commands if p.name.removesuffix(COMMAND_ENDING) not in sources]
    notes = [f"{p}: not used; there is no recording of that name" for p in orphans]
    known = {*sources.values(), *commands, *find_tracks(directory)}
    others = [p for p in sorted(directory.glob("*.csv")) if p not in known and any(map(p.name.startswith, sources))]
    notes += [f"{p}: not used; a command is NAME{COMMAND_ENDING}, a series NAME{SERIES_ENDING}" for p in others]
    return Session(directory, rig, tuple(recordings), tuple(problems), (*idle, *notes))


def _choose_tracks(directory: Path, rig: Rig) -> tuple[dict[str, Path], list[str]]:
    """Return a folder's tracks by recording, and a line on each file of tracks that is not used.

    Of a recording's several files the one with the shortest name is taken, the others being filtered or trained on
    more; HDF5 before CSV, which holds the same.
    """
    chosen: dict[str, Path] = {}
    idle = []
    files = sorted(find_tracks(directory), key=lambda p: (len(p.stem), p.stem, p.suffix.lower() == ".csv"))
    for path in files:
        if rig.marks is None:
            idle.append(
                f"{path}: not used; say which of its points are which, marks: {{mouth: …, pivot: …}} in rig.yaml"
            )
            continue
        used = chosen.setdefault(recording_name(path), path)
        if used.stem != path.stem:
            idle.append(f"{path}: not used; {used.name} is the same recording")
    return chosen, idle
