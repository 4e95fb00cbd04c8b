"""The files of one clip: the film or the tracks, what is declared about it, and its command.

All that can be found out without opening the film is found out here, before anything is loaded that can.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from anglecam.data.command import Command
from anglecam.errors import InputError, RigError, blame
from anglecam.io.files import require_film_file
from anglecam.io.rig import Rig
from anglecam.io.session import SERIES_ENDING, clip_beside, command_beside, rig_beside
from anglecam.io.tracks.files import TRACKS_ENDINGS

FrameRange = tuple[int | None, int | None]
"""Numbers of the first and the last frame that are measured."""


@dataclass(frozen=True)
class ClipFiles:
    """What is measured, and what is declared about it; the film is not opened."""

    path: Path
    """The clip, or the tracks in its place."""
    rig: Rig
    command: Command | None
    film: Path | None
    """The clip; of tracks the clip that they were made from, ``None`` where it is not in the same folder."""

    @property
    def is_tracks(self) -> bool:
        """Whether another program has found the points already."""
        return self.path.suffix.lower() in TRACKS_ENDINGS


def read_clip_files(path: Path, rig: Rig | None = None, frames: FrameRange = (None, None)) -> ClipFiles:
    """Read what is declared about a clip or tracks in the same folder, and check that they can be read.

    Parameters
    ----------
    path : Path
        A film, a folder of numbered pictures, or a file of tracks.
    rig : Rig, optional
        In place of the ``rig.yaml`` in the folder of ``path``.
    frames : FrameRange
        In place of the rig's; ``None`` leaves the rig's.

    Returns
    -------
    ClipFiles
        Ready to be opened.

    Raises
    ------
    InputError
        Where the file is missing or empty, its command file is wrong, or it holds angles already.
    RigError
        Where the rig file is wrong.
    """
    with blame(path):
        declared = _of_frames(rig_beside(path) if rig is None else rig, frames)
        return _files(path, declared, command_beside(path, declared))


def recording_files(path: Path, rig: Rig, command: Command | None) -> ClipFiles:
    """Return the files of one recording of a session, whose rig and command have been read.

    Raises
    ------
    InputError
        As `read_clip_files`.
    """
    with blame(path):
        return _files(path, rig, command)


def _of_frames(rig: Rig, frames: FrameRange) -> Rig:
    """Return a rig with another range of frames."""
    wanted = {key: k for key, k in zip(("first", "last"), frames, strict=True) if k is not None}
    within = rig.frames.model_copy(update=wanted)
    if within.last is not None and within.last < (within.first or 0):
        raise RigError(f"no frame lies from {within.first} to {within.last}; the first of them must not be the larger")
    return rig.model_copy(update={"frames": within})


def _files(path: Path, rig: Rig, command: Command | None) -> ClipFiles:
    if path.name.endswith(SERIES_ENDING):
        raise InputError(f"{path}: holds angles already; identify or close the folder that contains it")
    is_tracks = path.suffix.lower() in TRACKS_ENDINGS
    if is_tracks and not path.exists():
        raise InputError(f"{path}: no such file")
    film = clip_beside(path) if is_tracks else path
    if film is not None and not film.is_dir():
        require_film_file(film)
    return ClipFiles(path, rig, command, film)
