"""Which files are tracks of points, whose clip they belong to, and reading them."""

from __future__ import annotations

import re
import sys
from pathlib import Path

from anglecam.errors import InputError
from anglecam.io.files import open_text
from anglecam.io.tracks import deeplabcut, sleap
from anglecam.io.tracks.hdf5 import open_hdf5
from anglecam.io.tracks.tracks import Tracks

HDF5_ENDINGS = (".h5", ".hdf5")
TRACKS_ENDINGS = (".csv", *HDF5_ENDINGS)

_SCORER = re.compile(r"(?P<name>.+?)(?:DLC_|DeepCut_|_superanimal_)")
_ANALYSIS = re.compile(r"(?:.*\.\d{3}_)?(?P<name>.+)\.analysis")


def read_tracks(path: Path) -> Tracks:
    """Read the points that DeepLabCut or SLEAP has found in a clip.

    Parameters
    ----------
    path : Path
        DeepLabCut's CSV or HDF5, or SLEAP's analysis HDF5.

    Returns
    -------
    Tracks
        Pixels as those programs count them; half a pixel that all points share turns no line between two of them.

    Raises
    ------
    InputError
        Where the file is none of these, is damaged, or claims an absurd size.
    """
    if path.suffix.lower() not in HDF5_ENDINGS:
        return deeplabcut.read_csv(path)
    with open_hdf5(path) as file:
        if sleap.is_analysis(file):
            return sleap.read_analysis(path, file)
        group = deeplabcut.pandas_group(file)
        if group is not None:
            return deeplabcut.read_hdf5(path, group)
        holds = ", ".join(list(file)[:5]) or "nothing"
    raise InputError(f"{path}: neither a DeepLabCut table nor a SLEAP analysis file (it holds {holds})")


def find_tracks(directory: Path) -> list[Path]:
    """List the files of a folder that are tracks, by name.

    An HDF5 file that cannot be opened is among them, so that it is not passed over in silence; one that holds something
    else is not, nor are the lengths of bones that DeepLabCut calls a skeleton.
    """
    found = [p for p in directory.iterdir() if p.suffix.lower() in TRACKS_ENDINGS and p.is_file()]
    return sorted(p for p in found if not p.stem.endswith("_skeleton") and _looks_like_tracks(p))


def name_by_tool(stem: str) -> str | None:
    """Return the clip's name out of a name that DeepLabCut or SLEAP gave, ``None`` if neither did.

    DeepLabCut appends its scorer (``NAMEDLC_resnet50_…shuffle1_50000``); SLEAP says ``PROJECT.000_NAME.analysis``.
    """
    found = _SCORER.match(stem) or _ANALYSIS.fullmatch(stem)
    return found["name"] if found else None


def _looks_like_tracks(path: Path) -> bool:
    if path.suffix.lower() not in HDF5_ENDINGS:
        try:
            with open_text(path, sys.maxsize) as stream:
                return stream.readline(7) == "scorer,"
        except (OSError, UnicodeDecodeError):
            return False
    try:
        with open_hdf5(path) as file:
            return sleap.is_analysis(file) or deeplabcut.pandas_group(file) is not None
    except InputError:
        return True
