"""Find files of tracks, read them, and name the clip that they belong to, in every format of this package."""

from __future__ import annotations

import importlib
import pkgutil
from dataclasses import replace
from pathlib import Path

from anglecam.errors import InputError
from anglecam.io import tracks as package
from anglecam.io.tracks.tracks import Tracks
from anglecam.io.tracks.tracks_format import HDF5_ENDINGS, TracksFile, TracksFormat, open_tracks_file


def _collect() -> tuple[TracksFormat, ...]:
    modules = (importlib.import_module(f"{package.__name__}.{m.name}") for m in pkgutil.iter_modules(package.__path__))
    return tuple(sorted((m.FORMAT for m in modules if hasattr(m, "FORMAT")), key=lambda f: f.program))


FORMATS: tuple[TracksFormat, ...] = _collect()
"""Every ``FORMAT`` that a module of `anglecam.io.tracks` defines, in the order of the programs' names."""
TRACKS_ENDINGS = tuple(dict.fromkeys(ending for f in FORMATS for ending in f.endings))
"""File endings, lower case, that a file of tracks can have."""
_COMPANIONS = tuple(ending for f in FORMATS for ending in f.companions)


def read_tracks(path: Path) -> Tracks:
    """Read the points that another program has found in a clip.

    Parameters
    ----------
    path : Path
        A file of one of `FORMATS`.

    Returns
    -------
    Tracks
        Pixels as the program counts them. An offset of half a pixel that all points share does not turn the line
        between two of them.

    Raises
    ------
    InputError
        If the file is of no known format, is damaged, or claims an absurd size.
    """
    with open_tracks_file(path) as file:
        found = _format_of(file)
        try:
            tracks = found.read(file)
        except (ValueError, KeyError, TypeError, IndexError, OSError) as fault:
            if file.is_hdf5:
                raise  # `open_hdf5` words it
            reason = getattr(fault, "strerror", None) or str(fault).partition("\n")[0]
            raise InputError(f"{path}: not a readable {found.program} {found.kind} ({reason})") from fault
        return replace(tracks, software=found.program, usual_limit=found.usual_limit)


def find_tracks(directory: Path) -> list[Path]:
    """List the files of a folder that are tracks, in the order of their names.

    A damaged HDF5 file is listed, so that reading it reports the damage. A text file that cannot be read is not: most
    text files of a folder hold something else. Files that a program writes next to its tracks
    (`TracksFormat.companions`) are not listed.
    """
    found = [p for p in directory.iterdir() if p.suffix.lower() in TRACKS_ENDINGS and p.is_file()]
    return sorted(p for p in found if not p.stem.endswith(_COMPANIONS) and _is_tracks(p))


def name_by_tool(stem: str) -> str | None:
    """Return the clip's name contained in a file name that a tracking program made of it.

    Parameters
    ----------
    stem : str
        The file's name without its ending.

    Returns
    -------
    str or None
        ``None`` if the name follows no program's pattern.
    """
    names = (f.clip_name(stem) for f in FORMATS)
    return next((name for name in names if name is not None), None)


def tracker_names() -> str:
    """Return the names of the programs whose files can be read, for messages: ``DeepLabCut or SLEAP``."""
    return _alternatives([f.program for f in FORMATS])


def _format_of(file: TracksFile) -> TracksFormat:
    """Return the format of a file.

    If only one format has the file's ending, it is returned without a test: its reader states what is wrong in more
    detail.
    """
    candidates = _candidates(file.path)
    if len(candidates) == 1:
        return candidates[0]
    found = next((f for f in candidates if f.recognises(file)), None)
    if found is not None:
        return found
    known = _alternatives([f"{f.program} {f.kind}" for f in candidates or FORMATS])
    raise InputError(f"{file.path}: not a {known} ({file.content()})")


def _is_tracks(path: Path) -> bool:
    try:
        with open_tracks_file(path) as file:
            return any(f.recognises(file) for f in _candidates(path))
    except InputError:
        return path.suffix.lower() in HDF5_ENDINGS


def _candidates(path: Path) -> list[TracksFormat]:
    return [f for f in FORMATS if path.suffix.lower() in f.endings]


def _alternatives(names: list[str]) -> str:
    return " or ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
