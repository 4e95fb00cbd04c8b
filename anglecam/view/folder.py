"""The opened folder: its clips by number, and the files that the page may read or write.

No path comes from the page. A clip is asked for by its number in the list, and a link that leads out of the folder is
not followed.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from anglecam.errors import InputError, RigError
from anglecam.io.session import SERIES_ENDING, find_clips, is_film_of_images, recording_name

RESULTS = "result"
"""Folder of the results, within the opened one."""


@dataclass(frozen=True)
class Folder:
    """A folder of clips, or one clip of it."""

    path: Path
    """Absolute, without links."""
    clips: tuple[Path, ...]
    """In the order of their names."""
    is_session: bool
    """Whether the folder was opened rather than one clip."""

    @property
    def rig_file(self) -> Path:
        """``rig.yaml``, which may be missing."""
        return self.inside(self.path / "rig.yaml")

    @property
    def results(self) -> Path:
        """Folder of the results, which may be missing."""
        return self.inside(self.path / RESULTS)

    def series_file(self, clip: Path) -> Path:
        """Return the file of a clip's angles, which may be missing."""
        return self.inside(self.path / RESULTS / f"{recording_name(clip)}{SERIES_ENDING}")

    def inside(self, path: Path) -> Path:
        """Return a path of this folder; raise `InputError` where a link leads out of it."""
        if not path.resolve().is_relative_to(self.path):
            raise InputError(f"{path}: a link leads out of the folder that is open")
        return path


def open_folder(path: Path) -> Folder:
    """Return what the page is to show.

    Parameters
    ----------
    path : Path
        A clip, a folder of clips, or a folder of numbered pictures, which is a clip.

    Returns
    -------
    Folder
        With at least one clip.

    Raises
    ------
    RigError
        Where there is no such file or folder, or no clip in it.
    """
    if not path.exists():
        raise RigError(f"{path}: no such file or folder")
    if path.is_file():
        clip = path.resolve()  # who names a link means its target
        return Folder(clip.parent, (clip,), is_session=False)
    folder = path.resolve()
    if is_film_of_images(folder):
        return Folder(folder, (folder,), is_session=False)
    clips = tuple(clip for clip in find_clips(folder) if clip.resolve().is_relative_to(folder))
    if not clips:
        raise RigError(f"{path}: no clip in this folder")
    return Folder(folder, clips, is_session=True)
